"""What a fix costs in memory where the whole log is looked at before anything is told."""

import tracemalloc

import numpy as np
import pytest

import surefix

FEW, MANY = 5_000, 20_000


def peak(mode: str, n: int) -> int:
    random = np.random.default_rng(5)
    time = 0.1 * np.arange(n)
    x, y = random.normal(0.0, 0.5, (2, n)) + 30.0 * np.sin(time / 40.0)
    x[random.random(n) < 0.05] += 30.0
    options = surefix.CleanOptions(mode=mode)
    tracemalloc.start()
    try:
        surefix.clean({"time": time, "x": x, "y": y}, options=options)
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize(("mode", "most"), [("offline", 900), ("lagged", 1100)])
def test_bytes_for_each_fix(mode: str, most: int) -> None:
    """A state of four components takes 160 bytes, as found by the filter or by the smoother."""
    peak(mode, FEW)  # compiles
    assert (peak(mode, MANY) - peak(mode, FEW)) / (MANY - FEW) < most
