"""What is compiled ahead is what cleaning needs."""

import numpy as np

import surefix
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


def test_a_method_asks_for_the_parts_that_it_calls() -> None:
    usual = surefix.CleanOptions()
    assert set(parts_for(usual)) <= set(PARTS)
    assert "fixed lag" not in parts_for(usual)
    assert "fixed lag" in parts_for(surefix.CleanOptions(mode="lagged"))
    assert "hypotheses" not in parts_for(surefix.CleanOptions(method="igg3"))
    assert "cleaners" in parts_for(surefix.CleanOptions(method="hampel"))
