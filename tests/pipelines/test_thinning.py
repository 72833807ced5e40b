"""What is kept of a long log for the report holds nothing else alive."""

import numpy as np

import surefix
from surefix.pipelines.joining import thinned


def test_a_thinned_result_shares_no_memory_with_the_whole() -> None:
    time = np.arange(200.0)
    log = {"time": time, "x": np.sin(time), "y": time, "heading": time % 360.0}
    whole = surefix.clean(log, options=surefix.CleanOptions(method="igg3"))
    few = thinned(whole, 4)
    for name in ("raw_position", "raw_coordinates", "sensor", "row"):
        part, all_of_it = getattr(few, name), getattr(whole, name)
        np.testing.assert_array_equal(part, all_of_it[::4])
        assert not np.shares_memory(part, all_of_it)
    assert not np.shares_memory(few.track.position, whole.track.position)
    assert len(few.channels) == 1
    assert not np.shares_memory(few.channels[0].raw, whole.channels[0].raw)
