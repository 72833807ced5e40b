"""The series of sights against the textbook's unscented filter, one epoch and point at a time."""

import numpy as np
import pytest

from reference import sigma_point as textbook
from surefix.errors import OptionsError
from surefix.filters import kalman
from surefix.filters.kalman import gaussian
from surefix.filters.sigma_point import Spread
from surefix.filters.sigma_point_series import filter_sights
from surefix.models.motion import noise_factor, transition
from surefix.models.sights import BEARING, COMPONENT, ELEVATION, RANGE
from surefix.robust.loss import loss_named

KINDS = {
    "ranges and bearings": (2, [RANGE, BEARING, RANGE, BEARING, RANGE, BEARING]),
    "ranges": (2, [RANGE, RANGE, RANGE]),
    "one range": (1, [RANGE]),
    "in space": (3, [RANGE, BEARING, ELEVATION, COMPONENT + 2]),
    "with a velocity": (2, [RANGE, BEARING, COMPONENT + 3]),
}


def value(kind, anchor, x):
    """The sights by NumPy's own functions, axes x east, y north, z up."""
    off = x[: len(anchor)] - anchor
    if kind >= COMPONENT:
        i = kind - COMPONENT
        return off[i] if i < len(anchor) else x[i]
    if kind == RANGE:
        return np.linalg.norm(off)
    return np.arctan2(*off[:2]) if kind == BEARING else np.arctan2(off[2], np.hypot(*off[:2]))


def world(seed, axes, kinds, count=30, order="cv"):
    """A target east of all anchors, so that no bearing wraps; irregular steps, gaps."""
    rng = np.random.default_rng(seed)
    dt = rng.uniform(0.1, 2.0, count)
    F = np.stack([transition(order, axes, step) for step in dt])
    G = np.stack([noise_factor(order, axes, step, 0.05) for step in dt])
    n = F.shape[1]
    anchor = rng.uniform(-300.0, -100.0, (count, len(kinds), axes))
    R = np.diag([0.02**2 if kind in (BEARING, ELEVATION) else 4.0 for kind in kinds])
    m, P = np.concatenate((np.full(axes, 20.0), np.zeros(n - axes))), np.eye(n) * 4.0
    x, z = rng.multivariate_normal(m, P), np.empty((count, len(kinds)))
    for k in range(count):
        x = F[k] @ x + G[k] @ rng.standard_normal(n)
        z[k] = [value(c, a, x) for c, a in zip(kinds, anchor[k], strict=True)]
    z += rng.standard_normal(z.shape) * np.sqrt(np.diag(R))
    z[rng.random(z.shape) < 0.2] = np.nan
    return gaussian(m, P), z, F, G @ np.swapaxes(G, 1, 2), anchor, R


@pytest.mark.parametrize("spread", [Spread(), Spread(0.5, 2.0, 1.0)])
@pytest.mark.parametrize("name", KINDS)
def test_series_is_the_textbook(name, spread):
    axes, kinds = KINDS[name]
    x, z, F, Q, anchor, R = world(len(name), axes, kinds)
    found = filter_sights(x, z, F, Q, kinds, anchor, R, spread=spread)
    m, P = x.mean, x.covariance
    for k in range(len(z)):
        m, P = textbook.predict(m, P, lambda p, F=F[k]: F @ p, Q[k], **spread._asdict())

        def h(p, anchor=anchor[k]):
            return np.array([value(c, a, p) for c, a in zip(kinds, anchor, strict=True)])

        mean, S, _ = textbook.transform(m, P, h, **spread._asdict())
        np.testing.assert_allclose(found.residual[k], z[k] - mean, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(found.nis[k], (z[k] - mean) ** 2 / np.diag(S + R), rtol=1e-6)
        m, P = textbook.update(m, P, z[k], h, R, **spread._asdict())
        np.testing.assert_allclose(found.mean[k], m, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(found.covariance[k], P, rtol=1e-9, atol=1e-9)
    assert np.array_equal(np.isnan(found.weight), np.isnan(z))


@pytest.mark.parametrize("name", ["ranges and bearings", "in space"])
def test_errors_of_sights_may_go_together(name):
    """Correlated noise with gaps and weights: the textbook's numbers on what is left."""
    axes, kinds = KINDS[name]
    x, z, F, Q, anchor, R = world(7, axes, kinds)
    A = np.random.default_rng(7).standard_normal((len(kinds), len(kinds) + 2))
    scale = np.sqrt(np.diag(R))
    R = np.outer(scale, scale) * (np.eye(len(kinds)) + 0.3 * A @ A.T)
    loss = loss_named("huber")
    found = filter_sights(x, z, F, Q, kinds, anchor, R, loss)
    m, P = x.mean, x.covariance
    for k in range(len(z)):
        m, P = textbook.predict(m, P, lambda p, F=F[k]: F @ p, Q[k])

        def h(p, anchor=anchor[k]):
            return np.array([value(c, a, p) for c, a in zip(kinds, anchor, strict=True)])

        mean, S, _ = textbook.transform(m, P, h)
        distance = np.abs(z[k] - mean) / np.sqrt(np.diag(S + R))
        w = np.where(np.isnan(distance), 1.0, np.minimum(1.0, loss.k0 / distance))
        np.testing.assert_allclose(found.weight[k], np.where(np.isnan(z[k]), np.nan, w), rtol=1e-8)
        m, P = textbook.update(m, P, z[k], h, R / np.sqrt(np.outer(w, w)))
        np.testing.assert_allclose(found.mean[k], m, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(found.covariance[k], P, rtol=1e-9, atol=1e-9)
    assert (found.weight < 1.0).any()


@pytest.mark.parametrize("ratio", [1e4, 1e8, 1e12])
def test_a_vague_prior_leaves_digits(ratio):
    """Positions themselves as sights, for which the square-root filter knows the answer."""
    rng = np.random.default_rng(5)
    F, G = transition("cv", 2, 1.0), noise_factor("cv", 2, 1.0, 0.01)
    R = np.array([[1.0, 0.3], [0.3, 2.0]]) * 1e-2
    x = gaussian(np.zeros(4), np.diag([ratio, ratio, 1.0, 1.0]) * 1e-2)
    z = rng.standard_normal((30, 2))
    kinds = [COMPONENT, COMPONENT + 1]
    found = filter_sights(x, z, F, G @ G.T, kinds, np.zeros((2, 2)), R)
    for k, row in enumerate(z):
        x, _ = kalman.update(kalman.predict(x, F, G @ G.T), row, np.eye(2, 4), R)
        size = np.sqrt(np.outer(*[np.diag(x.covariance)] * 2))
        assert (np.abs(found.covariance[k] - x.covariance) / size).max() < 1e-9


def test_constant_acceleration_and_six_states():
    x, z, F, Q, anchor, R = world(4, 2, [RANGE, BEARING], order="ca")
    found = filter_sights(x, z, F, Q, [RANGE, BEARING], anchor, R)
    assert found.mean.shape == (len(z), 6)
    assert np.linalg.eigvalsh(found.covariance).min() > 0.0


def test_a_bearing_may_cross_the_seam():
    """A target that circles its anchor is followed all the way round."""
    turn = np.arange(200) * 0.1
    path = 50.0 * np.column_stack((np.sin(turn), np.cos(turn)))
    z = np.column_stack((np.full(200, 50.0), np.arctan2(path[:, 0], path[:, 1])))
    F, G = transition("cv", 2, 1.0), noise_factor("cv", 2, 1.0, 1.0)
    x = gaussian([0.0, 50.0, 5.0, 0.0], np.diag([1.0, 1.0, 1.0, 1.0]))
    R = np.diag([0.01, 1e-6])
    found = filter_sights(x, z, F, G @ G.T, [RANGE, BEARING], np.zeros((2, 2)), R)
    assert np.abs(found.mean[1:, :2] - path[1:]).max() < 1.0


def test_wild_sights_are_left_out_by_a_loss():
    kinds = KINDS["ranges"][1]
    x, z, F, Q, anchor, R = world(2, 2, kinds)
    wild = z.copy()
    wild[10, 0] += 500.0
    without = z.copy()
    without[10, 0] = np.nan
    loss = loss_named("igg3")
    found = filter_sights(x, wild, F, Q, kinds, anchor, R, loss)
    told = filter_sights(x, without, F, Q, kinds, anchor, R, loss)
    assert found.weight[10, 0] == 0.0 or np.isnan(z[10, 0])
    np.testing.assert_array_equal(found.mean, told.mean)


@pytest.mark.parametrize("wrong", ["z", "kind", "anchor", "angle", "spread", "loss", "Q", "F"])
def test_what_does_not_fit_is_refused(wrong):
    kinds, options = [RANGE, RANGE], {}
    x, z, F, Q, anchor, R = world(1, 2, kinds)
    if wrong == "z":
        z = z[:, :1]
    elif wrong == "kind":
        kinds = [RANGE, COMPONENT + 4]
    elif wrong == "anchor":
        anchor = anchor[:-1]
    elif wrong == "angle":
        kinds, anchor = [BEARING, RANGE], anchor[..., :1]
    elif wrong == "spread":
        options = {"spread": Spread(1.0, 0.5, 0.0)}
    elif wrong == "loss":
        options = {"loss": loss_named("student-t")}
    elif wrong == "Q":
        Q = -Q
    else:
        F = F[:, :-1]
    with pytest.raises(OptionsError):
        filter_sights(x, z, F, Q, kinds, anchor, R, **options)
