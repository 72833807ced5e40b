"""Registration finds the errors of radars, says how well, and bears wild measurements."""

import numpy as np
import pytest

from reference.registration import joint_least_squares
from surefix.errors import OptionsError
from surefix.fusion.registration import reference_bias, register
from surefix.models.radar import site, to_polar
from surefix.robust.loss import loss_named

SITES = (site([0.0, 0.0, 50.0]), site([25e3, -10e3, 120.0]), site([-15e3, 20e3, 10.0]))
SIGMA = np.array([[25.0, 3e-4, 3e-4], [15.0, 2e-4, 2e-4], [20.0, 4e-4, 4e-4]])
LIMIT = np.array([100.0, 5e-3, 3e-3])


def course(n=600):
    t = np.linspace(0.0, 500.0, n)
    return np.array([-50e3, 60e3, 8e3]) + t[:, None] * np.array([220.0, -40.0, 0.0])


def measured(seed, radars=2, position=None):
    """Measurements of each radar and its true systematic errors."""
    rng = np.random.default_rng(seed)
    position = course() if position is None else position
    bias = rng.uniform(-LIMIT, LIMIT, (radars, 3))
    z = []
    for i in range(radars):
        noise = SIGMA[i] * rng.standard_normal(position.shape)
        polar = to_polar(position, SITES[i]) + bias[i] + noise
        polar[:, 1] %= 2.0 * np.pi
        z.append(polar)
    return z, bias


@pytest.mark.parametrize("radars", [2, 3])
def test_errors_are_found_as_well_as_the_covariance_says(radars):
    squares, plain = [], []
    for seed in range(25):
        z, bias = measured(seed, radars)
        found = register(z, SITES[:radars], SIGMA[:radars])
        off = (found.bias - bias).ravel()
        squares.append(off @ np.linalg.solve(found.covariance, off))
        plain.append(np.abs(off[:3] / LIMIT).max())
        assert found.scale == pytest.approx(1.0, abs=0.1)
    assert np.mean(squares) / (3 * radars) == pytest.approx(1.0, abs=0.35)
    assert np.median(plain) < 0.15


@pytest.mark.parametrize(("seed", "radars"), [(1, 2), (2, 2), (3, 3)])
def test_plain_registration_is_least_squares_with_the_positions_unknown(seed, radars):
    """The noise is scaled by the misfits."""
    where = course(25)
    z, _ = measured(seed, radars, where)
    found = register(z, SITES[:radars], SIGMA[:radars], loss=loss_named("kalman"))
    origins = [each.position for each in SITES[:radars]]
    prior = np.array([1000.0, 0.05, 0.05])
    bias, covariance = joint_least_squares(
        np.array(z), origins, found.scale * SIGMA[:radars], prior, where
    )
    sigma = np.sqrt(np.diag(covariance)).reshape(radars, 3)
    np.testing.assert_allclose(np.sqrt(np.diag(found.covariance)), sigma.ravel(), rtol=0.02)
    assert np.abs((found.bias - bias) / sigma).max() < 0.05


def test_noise_stated_too_small_is_scaled():
    z, _ = measured(1)
    honest = register(z, SITES[:2], SIGMA[:2])
    small = register(z, SITES[:2], SIGMA[:2] / 10.0)
    assert small.scale == pytest.approx(10.0 * honest.scale, rel=0.05)
    np.testing.assert_allclose(small.bias, honest.bias, rtol=0.05, atol=0.5)
    ratio = np.diag(small.covariance) / np.diag(honest.covariance)
    np.testing.assert_allclose(ratio, 1.0, atol=0.1)


def test_wild_epochs_are_put_aside():
    for seed in range(5):
        z, bias = measured(seed)
        z[0][100:160] += [900.0, 0.02, 0.02]
        robust = register(z, SITES[:2], SIGMA[:2])
        plain = register(z, SITES[:2], SIGMA[:2], loss=loss_named("kalman"))
        off = (robust.bias - bias).ravel()
        assert off @ np.linalg.solve(robust.covariance, off) < 25.0
        assert np.abs(plain.bias - bias)[:, 0].max() > 100.0
        assert robust.weight[100:160].max() == 0.0
        assert np.median(robust.weight[200:]) == 1.0


def test_missing_measurements_are_left_out():
    z, bias = measured(3, 3)
    z[0][::2] = np.nan
    z[1][1::3] = np.nan
    z[2][:300] = np.nan
    found = register(z, SITES, SIGMA)
    off = (found.bias - bias).ravel()
    assert off @ np.linalg.solve(found.covariance, off) < 30.0
    alone = (np.isfinite([each[:, 0] for each in z]).sum(axis=0)) < 2
    np.testing.assert_array_equal(np.isnan(found.weight), alone)


def test_radars_at_one_place_only_show_their_difference():
    same = (SITES[0], SITES[0])
    position = course()
    apart = np.array([80.0, 2e-3, 1e-3])
    z = [to_polar(position, SITES[0]) + apart, to_polar(position, SITES[0])]
    rng = np.random.default_rng(4)
    z = [each + SIGMA[0] * rng.standard_normal(each.shape) for each in z]
    found = register(z, same, SIGMA[0])
    difference = found.bias[0] - found.bias[1]
    assert (np.abs(difference - apart) < [6.0, 1e-4, 1e-4]).all()
    assert np.sqrt(found.covariance[0, 0]) > 500.0


def test_nothing_in_common_gives_the_prior():
    z = [np.full((4, 3), np.nan)] * 2
    found = register(z, SITES[:2], SIGMA[:2], prior=(10.0, 0.1, 0.2))
    assert (found.bias == 0.0).all()
    np.testing.assert_allclose(np.sqrt(np.diag(found.covariance)), [10.0, 0.1, 0.2] * 2)


def test_too_few_radars_are_refused():
    z, _ = measured(1)
    with pytest.raises(OptionsError, match="two or more"):
        register(z[:1], SITES[:1], SIGMA[:1])
    with pytest.raises(OptionsError, match="two or more"):
        register(z, SITES, SIGMA)


def test_reference_gives_the_errors_in_real_time():
    ratios = []
    for seed in range(30):
        z, bias = measured(seed)
        found = reference_bias(z[0], course(), SITES[0], 300)
        ratios.append(((found.bias[-1] - bias[0]) / found.sigma[-1]) ** 2)
        assert found.bias.shape == (600, 3)
    assert np.mean(ratios) == pytest.approx(1.0, abs=0.4)


def test_reference_bears_a_minority_of_wild_and_missing_measurements():
    z, bias = measured(7)
    z[0][10:100] += [5000.0, 0.5, 0.5]
    z[0][150:170] = np.nan
    reference = course()
    reference[180:190] = np.nan
    found = reference_bias(z[0], reference, SITES[0], 400)
    assert (np.abs(found.bias[399] - bias[0]) < 6.0 * found.sigma[399]).all()
    assert np.isfinite(found.bias).all()


def test_reference_across_north():
    position = np.column_stack([np.linspace(-2e3, 2e3, 400), np.full(400, 5e4), np.full(400, 1e3)])
    polar = to_polar(position, SITES[0]) + np.array([0.0, 0.01, 0.0])
    polar[:, 1] %= 2.0 * np.pi
    found = reference_bias(polar, position, SITES[0], 400)
    np.testing.assert_allclose(found.bias[-1], [0.0, 0.01, 0.0], atol=1e-9)
