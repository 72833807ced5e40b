"""The simplex search against the one of scipy, to the last bit."""

import numpy as np
import pytest
from scipy.optimize import minimize

from surefix.filters.simplex import descend


@pytest.mark.parametrize("size", [1, 2, 3, 5])
@pytest.mark.parametrize("most", [3, 40, 400])
@pytest.mark.parametrize("seed", range(3))
def test_as_scipy(size: int, most: int, seed: int) -> None:
    random = np.random.default_rng([size, seed])
    bowl = random.normal(size=(size, size))
    middle = random.normal(size=size)

    def cost(x: np.ndarray) -> float:
        off = bowl @ (x - middle)
        return float(off @ off + np.abs(x).sum() + np.sin(3.0 * x).sum())

    simplex = np.vstack([np.zeros(size), 0.25 * np.eye(size)])
    ours = descend(cost, simplex, near=1e-3, level=1e-4, most=most)
    theirs = minimize(
        cost,
        simplex[0],
        method="Nelder-Mead",
        options={"initial_simplex": simplex, "xatol": 1e-3, "fatol": 1e-4, "maxiter": most},
    )
    np.testing.assert_array_equal(ours.x, theirs.x)
    assert ours.value == theirs.fun
    assert not simplex[0].any()
