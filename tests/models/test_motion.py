"""The motion models against their defining integrals, and against filterpy."""

import numpy as np
import pytest
from filterpy.common import Q_continuous_white_noise
from scipy.linalg import expm

from surefix.errors import OptionsError
from surefix.models.motion import MODELS, noise_factor, propagate_rows, transition

STEPS = [0.0, 1e-6, 0.05, 1.0, 7.3, 3600.0]


def generator(order, axes):
    """Continuous dynamics: each derivative drives the one before it."""
    return np.kron(np.eye(order, k=1), np.eye(axes))


@pytest.mark.parametrize("dt", STEPS)
@pytest.mark.parametrize("axes", [1, 2, 3])
@pytest.mark.parametrize("model", MODELS)
def test_transition_is_the_matrix_exponential(model, axes, dt):
    np.testing.assert_allclose(
        transition(model, axes, dt), expm(generator(MODELS[model], axes) * dt), rtol=1e-12
    )


@pytest.mark.parametrize("dt", STEPS)
@pytest.mark.parametrize("model", MODELS)
def test_noise_is_that_of_filterpy(model, dt):
    for q in (0.0, 1e-6, 0.3, 40.0):
        G = noise_factor(model, 1, dt, q)
        expected = Q_continuous_white_noise(MODELS[model], dt, q)
        np.testing.assert_allclose(G @ G.T, expected, rtol=1e-12, atol=1e-300)
        assert (np.triu(G, 1) == 0.0).all()


@pytest.mark.parametrize("model", MODELS)
def test_axes_have_densities_of_their_own_and_do_not_mix(model):
    q = np.array([0.1, 2.0, 30.0])
    order = MODELS[model]
    G = noise_factor(model, 3, 1.7, q)
    Q = G @ G.T
    for i in range(3):
        alone = noise_factor(model, 1, 1.7, q[i])
        np.testing.assert_allclose(Q[i::3, i::3], alone @ alone.T, rtol=1e-12)
        for j in range(3):
            if i != j:
                assert (Q[i::3, j::3] == 0.0).all()
    assert Q.shape == (3 * order, 3 * order)


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("axes", [1, 2, 3])
def test_two_steps_are_one_long_step(model, axes):
    """Any time step is right: Q(a + b) = F(b) Q(a) F(b)ᵀ + Q(b)."""
    rng = np.random.default_rng(0)
    for a, b in rng.uniform(0.01, 20.0, (20, 2)):
        Qa, Qb, whole = (
            G @ G.T for G in (noise_factor(model, axes, dt, 0.7) for dt in (a, b, a + b))
        )
        F = transition(model, axes, b)
        np.testing.assert_allclose(F @ Qa @ F.T + Qb, whole, rtol=1e-10)
        np.testing.assert_allclose(
            F @ transition(model, axes, a), transition(model, axes, a + b), rtol=1e-12
        )


@pytest.mark.parametrize("model", MODELS)
def test_rows_are_propagated_in_place_and_only_the_columns_asked_for(model):
    n = 3 * MODELS[model]
    A = np.random.default_rng(1).normal(size=(n, 6))
    before = A.copy()
    propagate_rows(A, MODELS[model], 3, 0.4, 4)
    np.testing.assert_allclose(A[:, :4], transition(model, 3, 0.4) @ before[:, :4], rtol=1e-12)
    np.testing.assert_array_equal(A[:, 4:], before[:, 4:])


def test_an_unknown_model_is_refused():
    with pytest.raises(OptionsError, match="cv, ca"):
        transition("walk", 1, 1.0)
    with pytest.raises(OptionsError, match="'walk'"):
        noise_factor("walk", 1, 1.0, 1.0)
