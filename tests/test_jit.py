"""Compilations are told before they happen, once for each kernel."""

import numpy as np

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
