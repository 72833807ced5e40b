"""Compilations are told before they happen, once for each kernel."""

import ast
from pathlib import Path

import numpy as np

import surefix.jit
from surefix.jit import compilations, helper, kernel
from surefix.types import FloatArray


@helper
def _twice(x: float) -> float:
    return 2.0 * x


def _fresh() -> object:
    def total(values: FloatArray) -> float:
        out = 0.0
        for value in values:
            out += _twice(value)
        return out

    return kernel(total)


def test_a_kernel_is_told_once_and_its_parts_are_not() -> None:
    total = _fresh()
    total.enable_caching = lambda: None  # type: ignore[attr-defined]
    told: list[str] = []
    with compilations(told.append):
        assert total(np.ones(3)) == 6.0  # type: ignore[operator]
        first = list(told)
        assert total(np.ones(3)) == 6.0  # type: ignore[operator]
    assert first in (["total"], [])  # on disk from a run before, it is not compiled
    assert told == first


def test_nothing_is_told_outside() -> None:
    told: list[str] = []
    with compilations(told.append):
        pass
    assert _fresh()(np.ones(2)) == 4.0  # type: ignore[operator]
    assert told == []


def test_helpers_run_as_python_too() -> None:
    assert _twice(1.5) == 3.0


def test_no_kernel_needs_a_blas() -> None:
    """The command line keeps Numba from loading one; see `surefix.cli_begin`."""
    wrong, seen = [], 0
    for place in Path(surefix.jit.__file__).parent.rglob("*.py"):
        for node in ast.walk(ast.parse(place.read_text())):
            if not isinstance(node, ast.FunctionDef):
                continue
            names = {d.id for d in node.decorator_list if isinstance(d, ast.Name)}
            if not names & {*surefix.jit.__all__}:
                continue
            seen += 1
            for part in ast.walk(node):
                product = isinstance(part, ast.BinOp) and isinstance(part.op, ast.MatMult)
                named = isinstance(part, ast.Attribute) and part.attr in ("dot", "linalg", "vdot")
                wrong += [f"{place.name}: {node.name}"] * (product or named)
    assert seen > 100
    assert not wrong
