"""A judgement stays until its cause is clearly gone, so that no alarm flaps."""

import numpy as np

from surefix.service.heard import Heard
from surefix.service.judgement import _judged, _Record

HEARD = Heard("gps", 0, "position", np.arange(60.0), np.zeros(60), 59.0)


def words(name, values):
    """The word of each judgement of one sensor after the other, as a figure of it changes."""
    said = [""]
    for value in values:
        record = _Record(**{"rejected": 0.0, "innovation": 1.0, name: value})
        said.append(_judged(HEARD, record, 0.0, said[-1])[1].partition(":")[0])
    return said[1:]


def test_noisy_until_clearly_less():
    assert words("innovation", [1.4, 1.6, 1.4, 1.35, 1.25, 1.4]) == [
        "", "noisy", "noisy", "noisy", "", "",
    ]  # fmt: skip


def test_jumping_until_clearly_less():
    assert words("rejected", [0.25, 0.35, 0.25, 0.15, 0.25]) == ["", "jumping", "jumping", "", ""]
