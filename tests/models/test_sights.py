"""Values and Jacobians of single sights."""

import numpy as np
import pytest

from surefix.models.sights import BEARING, COMPONENT, ELEVATION, RANGE, expected, sight

KINDS = {1: [RANGE, COMPONENT, COMPONENT + 1], 2: [RANGE, BEARING, COMPONENT + 1, COMPONENT + 2]}
KINDS[3] = [RANGE, BEARING, ELEVATION, COMPONENT + 2, COMPONENT + 5]


@pytest.mark.parametrize("axes", [1, 2, 3])
def test_jacobians_are_the_derivatives_of_the_values(axes):
    rng = np.random.default_rng(axes)
    for kind in KINDS[axes]:
        x, anchor = 20.0 * rng.normal(size=2 * axes), rng.normal(size=axes)
        H = np.empty(2 * axes)
        value = sight(kind, anchor, x, axes, H)
        pushed = x + 1e-5 * np.eye(2 * axes), x - 1e-5 * np.eye(2 * axes)
        up, down = (expected(np.array([kind]), anchor, each)[:, 0] for each in pushed)
        np.testing.assert_allclose(H, (up - down) / 2e-5, atol=1e-8)
        assert value == expected(np.array([kind]), anchor, x[None])[0, 0]


def test_conventions():
    state = [[4.0, 2.0, 8.0, 0.1, 0.2, 0.3]]
    kinds = np.array([RANGE, BEARING, ELEVATION, COMPONENT + 1, COMPONENT + 5])
    range_, bearing, elevation, y, vz = expected(kinds, [1.0, 2.0, 4.0], state)[0]
    assert range_ == pytest.approx(5.0)
    assert np.degrees(bearing) == pytest.approx(90.0)  # east
    assert elevation == pytest.approx(np.arctan2(4.0, 3.0))
    assert (y, vz) == (0.0, 0.3)
