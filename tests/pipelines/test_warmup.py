"""What is compiled ahead is what cleaning needs."""

from typing import Any

import numpy as np
import pytest

import surefix
from surefix.filters.modes import realtime
from surefix.filters.records import Epochs, Motion, Recovery
from surefix.filters.track import start
from surefix.io.table import from_frame
from surefix.jit import compilations
from surefix.pipelines.clean import Source, clean_sources
from surefix.pipelines.warmup import PARTS, compile_part, missing, parts_for
from surefix.robust.loss import loss_named


def test_a_part_is_compiled_once() -> None:
    compile_part("sentences")
    assert compile_part("sentences") == 0
    assert "sentences" not in missing(PARTS)


def test_nothing_is_left_to_clean() -> None:
    for name in PARTS:
        compile_part(name)
    time = np.arange(80.0)
    wild = np.where(time == 40.0, 60.0, 0.0)
    late: list[str] = []
    with compilations(late.append):
        for axes in ("x", "xy", "xyz"):
            log = {"time": time} | {axis: np.sin(time) + wild for axis in axes}
            for method in ("multi-hypothesis", "igg3", "53h", "hampel", "median"):
                surefix.clean(log, options=surefix.CleanOptions(method=method))
            for mode in ("realtime", "lagged"):
                surefix.clean(log, options=surefix.CleanOptions(mode=mode))
    assert late == []


@pytest.mark.parametrize("axes", ["x", "xy", "xyz"])
def test_kernels_get_rows_side_by_side_as_they_were_compiled_for(axes: str) -> None:
    """Another order of memory would be compiled anew at the first log."""
    forms: list[bool] = []

    def estimator(motion: Motion, recovery: Recovery, epochs: Epochs, memory: Any) -> Any:
        forms.extend(column.flags.c_contiguous for column in epochs)
        return memory, realtime(
            motion, loss_named("igg3"), recovery, epochs, start(motion, recovery)
        )[1]

    time = np.arange(80.0)
    log = from_frame({"time": time} | {axis: np.sin(time) for axis in axes})
    options = surefix.CleanOptions(mode="realtime")
    clean_sources([Source(iter([log]), "fixes", "log")], options, estimator)
    assert forms
    assert all(forms)


def test_a_method_asks_for_the_parts_that_it_calls() -> None:
    usual = surefix.CleanOptions()
    assert set(parts_for(usual)) <= set(PARTS)
    assert "fixed lag" not in parts_for(usual)
    assert "fixed lag" in parts_for(surefix.CleanOptions(mode="lagged"))
    assert "hypotheses" not in parts_for(surefix.CleanOptions(method="igg3"))
    assert "cleaners" in parts_for(surefix.CleanOptions(method="hampel"))
