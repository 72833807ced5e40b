"""The table of losses against one line of textbook each."""

import numpy as np
import pytest
from scipy import stats

from reference import robust_weights
from surefix.errors import OptionsError
from surefix.robust.loss import LOSSES, LossCode, block_scale, loss_named, weight, weights

V = np.concatenate([[0.0, 1.5, 4.5], np.geomspace(1e-9, 1e9, 2000), np.linspace(0.0, 10.0, 2001)])
ROBUST = sorted(set(LOSSES) - {"kalman"})


def expected(method, v, loss):
    k0, k1 = loss.k0, loss.k1
    return {
        "kalman": lambda: np.ones_like(v),
        "gate": lambda: (v <= k1) * 1.0,
        "huber": lambda: robust_weights.huber(v, k0),
        "igg1": lambda: robust_weights.igg1(v, k0, k1),
        "igg3": lambda: robust_weights.igg3_printed(v, k0, k1),
        "igg3-yang": lambda: robust_weights.igg3_yang(v, k0, k1),
    }[method]()


@pytest.mark.parametrize(("k0", "k1"), [(None, None), (1.0, 3.0), (2.0, 8.5), (0.3, 0.31)])
@pytest.mark.parametrize("method", sorted(set(LOSSES) - {"student-t"}))
def test_weights_are_those_of_the_textbook(method, k0, k1):
    loss = loss_named(method, k0=k0, k1=k1)
    found = [weight(float(v), loss.code, loss.k0, loss.k1) for v in V]
    np.testing.assert_allclose(found, expected(method, V, loss), rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("axes", [1, 2, 3])
@pytest.mark.parametrize("method", sorted(LOSSES))
def test_a_series_of_distances_over_a_block(method, axes):
    loss = loss_named(method)
    nis = np.append(V**2, np.nan)
    found = weights(nis, axes, loss)
    assert np.isnan(found[-1])
    if method == "student-t":
        again = robust_weights.student_t(V**2, loss.k0, axes)
    else:
        again = expected(method, V / [1.0, loss.scale2, loss.scale3][axes - 1], loss)
    np.testing.assert_allclose(found[:-1], again, rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("method", ROBUST)
def test_weights_never_rise_and_stay_within_their_bounds(method):
    loss = loss_named(method)
    found = weights(np.sort(V) ** 2, 1, loss)
    assert (np.diff(found) <= 1e-15).all()
    assert found.min() >= 0.0
    most = (loss.k0 + 1.0) / loss.k0 if method == "student-t" else 1.0
    assert found.max() <= most


@pytest.mark.parametrize("method", ["huber", "igg1", "igg3", "igg3-yang", "gate", "student-t"])
def test_the_influence_of_the_impossible(method):
    """w(v)·v: bounded for huber, nought for the others, also where v² overflows."""
    loss = loss_named(method)
    for v in (1e6, 1e150, 1e200, np.inf):
        with np.errstate(over="ignore"):
            w = weights(np.array([v]) ** 2, 1, loss)[0]
        assert 0.0 <= w < 1e-5
        if method not in ("huber", "student-t"):
            assert w == 0.0
    assert weight(1e9, LossCode.HUBER, 1.5, 0.0) * 1e9 == pytest.approx(1.5)


@pytest.mark.parametrize("rate", [0.0027, 0.01, 0.05])
@pytest.mark.parametrize("axes", [1, 2, 3])
def test_the_gate_rejects_the_share_it_promises(axes, rate):
    loss = loss_named("gate", false_alarm=rate)
    nis = np.random.default_rng(0).chisquare(axes, 400_000)
    rejected = np.mean(weights(nis, axes, loss) == 0.0)
    assert rejected == pytest.approx(rate, abs=4.0 * np.sqrt(rate / 400_000))


@pytest.mark.parametrize("tail", [1e-6, 0.0027, 0.05, 0.5])
def test_block_scale_is_a_ratio_of_quantiles(tail):
    for axes in (1, 2, 3):
        ratio = np.sqrt(stats.chi2.isf(tail, axes) / stats.chi2.isf(tail, 1))
        assert block_scale(axes, tail) == pytest.approx(ratio, rel=1e-9)


@pytest.mark.parametrize(
    ("method", "constants"),
    [
        ("tukey", {}),
        ("igg3", {"k0": 4.5, "k1": 1.5}),
        ("igg1", {"k0": 2.0, "k1": 2.0}),
        ("huber", {"k0": -1.0}),
        ("student-t", {"k0": 0.0}),
        ("gate", {"false_alarm": 0.0}),
        ("gate", {"false_alarm": 1.0}),
        ("igg3", {"false_alarm": -0.1}),
    ],
)
def test_impossible_constants_are_refused(method, constants):
    with pytest.raises(OptionsError):
        loss_named(method, **constants)


@pytest.mark.parametrize("constants", [{"k0": np.nan}, {"k1": np.nan}, {"k0": np.inf}])
def test_constants_that_are_no_numbers_are_refused(constants):
    with pytest.raises(OptionsError):
        loss_named("igg3", **constants)
    if "k0" in constants and np.isnan(constants["k0"]):
        with pytest.raises(OptionsError):
            loss_named("huber", **constants)
        with pytest.raises(OptionsError):
            loss_named("student-t", **constants)
