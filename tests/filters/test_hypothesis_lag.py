"""Axis by axis what the general filter and smoother do: states, jumps, windows of any length."""

import numpy as np
import pytest

from filters.worlds import PLAIN, world
from surefix.filters.hypothesis_lag import filter_decided, not_followed, smooth_windows
from surefix.filters.hypothesis_trail import Decisions
from surefix.filters.records import Recovery
from surefix.filters.rts import smooth, smooth_lag
from surefix.filters.track import filter_track, start

KEEPS = Recovery(np.inf, 10.0, keeps_rate=True)
N = 120


def decided(seed, order, axes, *, jumps=True, velocity=0.3):
    """A world with some components missing, others left out or poor, and jumps of either kind."""
    made = world(
        seed, N, order=order, axes=axes, velocity=velocity, missing=0.2, blocks=False, q=0.2
    )
    rng = np.random.default_rng(seed + 900)
    fixed = rng.choice([0.0, 0.25, 1.0], (N, 2 * axes), p=[0.2, 0.1, 0.7])
    jump = np.zeros(N, np.int64)
    if jumps:
        jump[[30, 31, 80]] = 1, (1 << axes) - 1, 1 << (axes - 1)
        jump[[50, 100]] = 1 << axes, 1 << 2 * axes - 1
    said = Decisions(fixed, jump, np.zeros(N, np.int64))
    told = made.epochs._replace(fixed=fixed, jump=jump)
    _, filtered, _ = filter_track(made.motion, PLAIN, KEEPS, told, start(made.motion, KEEPS))
    return made, said, filtered


def followed(made, said, *cuts):
    out = not_followed(made.motion, N)
    for first, until in zip((0, *cuts), (*cuts, N), strict=True):
        filter_decided(made.motion, KEEPS.sigma_velocity, made.epochs, said, first, until, out)
    return out


def windows(made, said, last, wanted=None, first=0, until=N):
    mean = np.full((N, made.truth.shape[1]), np.nan)
    sigma, every = mean.copy(), np.ones(N, np.bool_)
    smooth_windows(
        made.motion,
        made.epochs.time,
        said.jump,
        followed(made, said),
        last,
        every if wanted is None else wanted,
        first,
        until,
        mean,
        sigma,
    )
    return mean, sigma


def ends(time, lag):
    return np.searchsorted(time, time + lag, side="right") - 1


@pytest.mark.parametrize("axes", [1, 2, 3])
@pytest.mark.parametrize("order", [2, 3])
def test_the_filter_is_the_plain_one(order, axes):
    for seed in range(3):
        made, said, filtered = decided(seed, order, axes)
        out = followed(made, said)
        sigma = np.sqrt(np.einsum("kaii->kia", out.covariance).reshape(N, -1))
        plain = np.sqrt(np.einsum("kij,kij->ki", filtered.factor, filtered.factor))
        mean = out.mean.transpose(0, 2, 1).reshape(N, -1)
        np.testing.assert_allclose(sigma, plain, rtol=1e-7)
        np.testing.assert_allclose((mean - filtered.mean) / plain, 0.0, atol=1e-6)
        known = np.isfinite(made.epochs.z)
        one, other = out.standardised[known], filtered.standardised[known]
        np.testing.assert_allclose(one, other, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("lag", [0.0, 3.0, 20.0, 1e9])
@pytest.mark.parametrize(("order", "axes"), [(2, 1), (2, 3), (3, 2)])
def test_windows_are_those_of_the_general_smoother(order, axes, lag):
    for seed in range(3):
        made, said, filtered = decided(seed, order, axes)
        last = ends(made.epochs.time, lag)
        mean, sigma = windows(made, said, last)
        rows = np.arange(N)
        whole = smooth_lag(made.motion, KEEPS, made.epochs.time, filtered, rows, last)
        plain = np.sqrt(np.einsum("kii->ki", whole.covariance))
        np.testing.assert_allclose(sigma, plain, rtol=1e-6)
        np.testing.assert_allclose((mean - whole.mean) / plain, 0.0, atol=1e-5)


@pytest.mark.parametrize("order", [2, 3])
def test_without_jumps_the_digits_agree(order):
    """With all of the future it is the smoother; nothing vague is in the way."""
    made, said, filtered = decided(5, order, 2, jumps=False)
    mean, sigma = windows(made, said, np.full(N, N - 1))
    whole = smooth(made.motion, KEEPS, made.epochs.time, filtered)
    plain = np.sqrt(np.einsum("kii->ki", whole.covariance))
    np.testing.assert_allclose(sigma[5:], plain[5:], rtol=1e-9)
    np.testing.assert_allclose(((mean - whole.mean) / plain)[5:], 0.0, atol=1e-8)


def test_in_pieces_it_is_the_same_to_the_last_bit():
    made, said, _ = decided(2, 2, 3)
    for one, other in zip(followed(made, said), followed(made, said, 17, 18, 90), strict=True):
        np.testing.assert_array_equal(one, other)


def test_rows_nobody_wants_and_rows_outside_keep_what_they_have():
    made, said, _ = decided(3, 2, 2)
    last = ends(made.epochs.time, 10.0)
    wanted = np.arange(N) % 3 > 0
    mean, sigma = windows(made, said, last, wanted, 20, 70)
    whole, wide = windows(made, said, last)
    at_once, _ = windows(made, said, np.arange(N))
    inside = np.zeros(N, np.bool_)
    inside[20:70] = True
    assert np.isnan(mean[~inside]).all()
    np.testing.assert_allclose(mean[inside & wanted], whole[inside & wanted], rtol=1e-9, atol=1e-9)
    np.testing.assert_array_equal(mean[inside & ~wanted], at_once[inside & ~wanted])
    assert (sigma[inside & ~wanted] >= wide[inside & ~wanted]).all()
    windows(made, said, last, wanted, 40, 40)


def test_a_window_is_not_longer_for_being_long():
    """Twenty thousand epochs, each smoothed over all the others: twenty thousand steps, not 4e8."""
    made = world(1, 20_000, axes=1, velocity=0.3, blocks=False)
    n = len(made.truth)
    said = Decisions(np.ones((n, 2)), np.zeros(n, np.int64), np.zeros(n, np.int64))
    out = not_followed(made.motion, n)
    filter_decided(made.motion, 10.0, made.epochs, said, 0, n, out)
    mean, sigma = np.empty((n, 2)), np.empty((n, 2))
    every = np.ones(n, np.bool_)
    end = np.minimum(np.arange(n) + n // 2, n - 1)
    smooth_windows(made.motion, made.epochs.time, said.jump, out, end, every, 0, n, mean, sigma)
    ratio = ((mean - made.truth) / sigma)[:, 0]
    assert np.mean(ratio**2) == pytest.approx(1.0, abs=0.1)
