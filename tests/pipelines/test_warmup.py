"""What is compiled ahead is what cleaning needs."""

from typing import Any

import numpy as np
import pytest

import surefix
from surefix.filters import multi_hypothesis
from surefix.filters.hypotheses import Prior
from surefix.filters.records import Epochs, Motion
from surefix.jit import compilations
from surefix.pipelines.warmup import PARTS, compile_part, missing, parts_for


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
def test_the_filter_is_called_with_one_layout(axes: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Numba compiles a kernel anew for arrays whose columns lie together, not their rows."""
    layouts = set()
    run = multi_hypothesis._run

    def noted(motion: Motion, prior: Prior, epochs: Epochs, *more: Any) -> None:
        layouts.add(all(each.flags.c_contiguous for each in epochs))
        run(motion, prior, epochs, *more)

    monkeypatch.setattr(multi_hypothesis, "_run", noted)
    time = np.arange(80.0)
    log = {"time": time} | {axis: np.sin(time) for axis in axes}
    velocities = {f"v{axis}": np.cos(time) for axis in axes}
    for mode in ("realtime", "lagged", "offline"):
        for given in (log, log | velocities):
            surefix.clean(given, options=surefix.CleanOptions(mode=mode))
    assert layouts == {True}


def test_a_method_asks_for_the_parts_that_it_calls() -> None:
    usual = surefix.CleanOptions()
    assert set(parts_for(usual)) <= set(PARTS)
    assert "fixed lag" not in parts_for(usual)
    assert "fixed lag" in parts_for(surefix.CleanOptions(mode="lagged"))
    assert "hypotheses" not in parts_for(surefix.CleanOptions(method="igg3"))
    assert "cleaners" in parts_for(surefix.CleanOptions(method="hampel"))
