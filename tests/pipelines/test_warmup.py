"""What is compiled ahead is what cleaning needs."""

import numpy as np

import surefix
from surefix.jit import compilations
from surefix.pipelines.warmup import PARTS, compile_part, warm_up


def test_a_part_is_compiled_once() -> None:
    compile_part("sentences")
    assert compile_part("sentences") == 0


def test_parts_are_told_and_nothing_is_left_to_clean() -> None:
    told: dict[str, int] = {}

    def tell(name: str, count: int) -> None:
        told[name] = count

    total = warm_up(tell, processes=1)
    assert list(told) == [*PARTS, "all"]
    assert total == sum(told.values())
    time = np.arange(40.0)
    log = {"time": time, "x": np.sin(time), "y": time}
    late: list[str] = []
    with compilations(late.append):
        for method in ("multi-hypothesis", "igg3"):
            surefix.clean(log, options=surefix.CleanOptions(method=method, mode="realtime"))
    assert late == []
