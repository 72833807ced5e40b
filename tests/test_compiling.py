"""Kernels are compiled with less work than Numba does, and kept safely."""

import gc
import os
from pathlib import Path

import numba
import numpy as np
import pytest

from surefix import jit
from surefix.compiling import KernelCache
from surefix.jit import helper, kernel, lean_helper, lean_kernel, on_disk

pytestmark = pytest.mark.skipif(bool(os.environ.get("NUMBA_DISABLE_JIT")), reason="no compiler")


@helper
def _third(x: float) -> float:
    return x / 3.0


@helper
def _thirds(x: np.ndarray) -> np.ndarray:
    out = np.empty(len(x))
    for i in range(len(x)):
        out[i] = _third(x[i])
    return out


@lean_helper
def _add(x: np.ndarray, i: int, by: float) -> None:
    x[i] += by


def _whole(x: np.ndarray) -> float:
    return float(np.sum(_thirds(x)))


def _lean(x: np.ndarray) -> None:
    for i in range(len(x)):
        _add(x, i, 2.0 * i)


def _double(x: float) -> float:
    return 2.0 * x


def test_parts_of_parts_are_in_the_kernel() -> None:
    x = np.array([1.0, 2.0, 4.0])
    assert kernel(_whole)(x) == _whole(x)
    compiled, plain = x.copy(), x.copy()
    lean_kernel(_lean)(compiled)
    _lean(plain)
    np.testing.assert_array_equal(compiled, plain)


def test_garbage_is_collected_again_afterwards(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path))
    kernel(_double)(1.0)
    assert gc.isenabled()


def test_what_was_compiled_is_found_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path))
    first = kernel(_double)
    assert not on_disk(first)
    assert (first(1.5), first(3)) == (3.0, 6)
    again = kernel(_double)
    assert on_disk(again)
    assert (again(1.5), again(3)) == (3.0, 6)
    assert not again.stats.cache_misses  # type: ignore[attr-defined]


def test_processes_that_save_at_once_do_not_mistake_their_code(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path))
    one, other = (KernelCache(_double)._cache_file for _ in range(2))
    keys = [((numba.float64,), "processor", "code"), ((numba.int64,), "processor", "code")]
    before = dict(one.index())  # both look before either has written
    monkeypatch.setattr(one, "index", lambda: dict(before))
    monkeypatch.setattr(other, "index", lambda: dict(before))
    one.save(keys[0], "of floats")
    other.save(keys[1], "of integers")
    reader = KernelCache(_double)._cache_file
    assert reader.load(keys[0]) == "of floats"
    assert reader.load(keys[1]) == "of integers"


def test_code_of_an_older_source_is_not_taken(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path))
    key = ((numba.float64,), "processor", "code")
    file = KernelCache(_double)._cache_file
    file.save(key, "old")
    assert file.load(key) == "old"
    file._source_stamp = ("a later time", 1)
    assert file.load(key) is None


def test_code_that_an_interrupt_dropped_is_made_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path))
    made = kernel(_double)
    made(1.5)
    (compiled,) = made.overloads.values()  # type: ignore[attr-defined]
    compiled.library._compiled_object = None
    made._cache.save_overload(compiled.signature, compiled)  # type: ignore[attr-defined]
    again = kernel(_double)
    assert again(1.5) == 3.0
    assert not again.stats.cache_misses  # type: ignore[attr-defined]


def test_without_a_folder_to_write_to_kernels_are_compiled_each_time(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def none(_: object) -> None:
        raise RuntimeError("no locator available")

    monkeypatch.setattr(jit, "KernelCache", none)
    made = jit._kept(_double)
    assert made(1.5) == 3.0
