"""The towed body's filter and smoother against the textbook twin, and their honesty."""

import numpy as np
import pytest

from reference import towed as textbook
from surefix.errors import OptionsError
from surefix.filters.towed import filter_towed, smooth_towed
from surefix.metrics import mean_bounds, normalised_squares
from surefix.models.towed import offset, towed_model
from surefix.robust.loss import loss_named
from surefix.simulate.towed import simulate

HUBER = loss_named("huber")
FIGURES = (600.0, 0.15, 1e-4, 0.1, 0.01)


def filtered(survey, z=None, **options):
    z = survey.z if z is None else z
    return filter_towed(
        survey.start, survey.time, z, survey.sigma, survey.model, rates=survey.rates, **options
    )


def errors(survey, track):
    error = track.mean - survey.truth
    error[:, 0], error[:, 1] = offset(*survey.truth[:, :2].T, *track.mean[:, :2].T)
    return error


@pytest.mark.parametrize(
    ("latitude", "longitude"), [(0.0, 0.0), (45.0, -179.9995), (80.0, -179.9995), (-80.0, 20.0)]
)
def test_filter_and_smoother_are_those_of_the_textbook(latitude, longitude):
    survey = simulate(
        3, minutes=4.0, stretch_s=60.0, latitude_deg=latitude, longitude_deg=longitude
    )
    track = filtered(survey, loss=HUBER)
    known = survey.time, survey.rates, survey.model.beta, textbook.densities(*FIGURES)
    means, covariances = textbook.run(
        survey.start.mean,
        survey.start.covariance,
        survey.time,
        survey.z,
        survey.sigma,
        *known[1:],
        HUBER.k0,
    )
    check(track, means, covariances)
    smoothed = smooth_towed(track, survey.time, survey.model, rates=survey.rates)
    check(smoothed, *textbook.smooth(means, covariances, *known))
    if abs(longitude) > 179.0:
        assert np.ptp(np.sign(track.mean[:, 1])) == 2.0, "the track should cross the date line"


def check(track, means, covariances):
    apart = [textbook.difference(a, b) for a, b in zip(means, track.mean, strict=True)]
    assert np.abs(apart).max() < 1e-7
    size = np.sqrt(np.einsum("kii->ki", covariances))
    scale = size[:, :, None] * size[:, None, :]
    assert np.abs(track.covariance - covariances).max(axis=0) == pytest.approx(0.0, abs=1e-6)
    assert np.abs((track.covariance - covariances) / scale).max() < 1e-7


@pytest.mark.parametrize("place", [(0.0, 30.0), (45.0, 179.999), (80.0, -179.999), (-80.0, 0.0)])
def test_latitude_and_longitude_are_right_at_any_latitude(place):
    """One survey, anywhere on Earth, has the same errors in metres."""
    here = simulate(5, minutes=10.0)
    there = simulate(5, minutes=10.0, latitude_deg=place[0], longitude_deg=place[1])
    for loss in (None, HUBER):
        one, other = (
            errors(here, filtered(here, loss=loss)),
            errors(there, filtered(there, loss=loss)),
        )
        assert other[:, :4] == pytest.approx(one[:, :4], abs=5e-3)
        assert other[:, 4:] == pytest.approx(one[:, 4:], abs=1e-6)


def test_headings_and_longitudes_in_any_turn_are_the_same():
    survey = simulate(2, minutes=6.0)
    turned = survey.z.copy()
    rng = np.random.default_rng(0)
    turned[:, 1:3] += 2.0 * np.pi * rng.integers(-2, 3, (len(turned), 2))
    one, other = filtered(survey, loss=HUBER), filtered(survey, turned, loss=HUBER)
    assert other.mean == pytest.approx(one.mean, abs=1e-9)


@pytest.mark.parametrize(
    "world",
    [
        {},
        {"interval_s": 4.0, "jitter": 0.45, "sigma_position_m": 0.5},
        {"interval_s": 0.5, "sigma_heading_deg": 3.0, "sigma_speed_mps": 0.2},
        {"model": towed_model(correlation_s=60.0, current_mps=0.4, position=0.05)},
    ],
    ids=["as it is", "sparse", "noisy", "restless"],
)
def test_uncertainty_is_honest_where_noise_is_what_the_filter_thinks(world):
    seeds = 40
    squares = {"filter": [], "smoother": []}
    for seed in range(seeds):
        survey = simulate(seed, minutes=9.0, contamination=0.0, stretch_s=150.0, **world)
        track = filtered(survey)
        smoothed = smooth_towed(track, survey.time, survey.model, rates=survey.rates)
        rows = np.searchsorted(survey.time, [60.0, 290.0, 310.0, 500.0])
        for name, found in (("filter", track), ("smoother", smoothed)):
            error = errors(survey, found)[rows]
            squares[name].append(normalised_squares(error, found.covariance[rows]))
    low, high = mean_bounds(6, seeds, 0.9999)
    for name, values in squares.items():
        mean = np.mean(values, axis=0)
        assert (low < mean).all(), (name, mean)
        assert (mean < high).all(), (name, mean)


def test_dead_reckoning_grows_less_sure_and_surfacing_mends_it():
    survey = simulate(1, contamination=0.0)
    track = filtered(survey)
    spread = np.sqrt(track.covariance[:, 0, 0] + track.covariance[:, 1, 1])
    below = (survey.time > 240.0) & (survey.time < 480.0)
    assert (np.diff(spread[below]) > 0.0).all()
    assert spread[below][-1] > 5.0 * spread[survey.time < 240.0][-1]
    assert spread[np.searchsorted(survey.time, 520.0)] < 2.5
    smoothed = smooth_towed(track, survey.time, survey.model, rates=survey.rates)
    assert (smoothed.covariance[:, 0, 0] <= track.covariance[:, 0, 0] * (1.0 + 1e-9)).all()
    assert smoothed.covariance[below, 0, 0].max() < 0.2 * track.covariance[below, 0, 0].max()


def test_nothing_observed_is_only_predicted():
    survey = simulate(1, minutes=9.0)
    track = filtered(survey, np.full_like(survey.z, np.nan), loss=HUBER)
    assert np.isfinite(track.mean).all()
    assert np.isnan(track.weight).all()
    assert not track.sweeps.any()
    assert np.trace(track.covariance[-1]) > np.trace(track.covariance[0])


def test_half_a_position_and_infinite_values_are_missing():
    survey = simulate(1, minutes=9.0)
    broken, missing = survey.z.copy(), survey.z.copy()
    broken[10, 0], broken[20, 2], broken[30, 3] = np.nan, np.inf, -np.inf
    missing[10, :2], missing[20, 2], missing[30, 3] = np.nan, np.nan, np.nan
    one, other = filtered(survey, broken, loss=HUBER), filtered(survey, missing, loss=HUBER)
    assert (one.mean == other.mean).all()
    assert np.isnan(one.weight[10]).tolist() == [True, True, False, False]


def test_equal_times_and_unknown_rates_do_no_harm():
    survey = simulate(1, minutes=9.0)
    time, rates = survey.time.copy(), survey.rates.copy()
    time[50] = time[49]
    rates[100:110] = np.nan
    track = filter_towed(
        survey.start, time, survey.z, survey.sigma, survey.model, rates=rates, loss=HUBER
    )
    smoothed = smooth_towed(track, time, survey.model, rates=rates)
    for found in (track, smoothed):
        assert np.isfinite(found.mean).all()
        assert np.linalg.eigvalsh(found.covariance).min() > 0.0


def test_iterated_form_counts_its_sweeps_and_uses_both_weights():
    survey = simulate(4, minutes=9.0, sigma_position_m=0.5, model=towed_model(position=0.25))
    track = filtered(survey, loss=HUBER, state_loss=HUBER, sweeps=60)
    assert 1 < track.sweeps.max() <= 60
    assert (track.state_weight < 1.0).any()
    printed = filtered(survey, loss=HUBER, state_loss=HUBER)
    assert (printed.state_weight == 1.0).all()
    assert set(printed.sweeps) == {1}


def test_inputs_are_untouched():
    survey = simulate(1, minutes=9.0)
    kept = [each.copy() for each in (*survey.start, survey.time, survey.z, survey.rates)]
    track = filtered(survey, loss=HUBER)
    smooth_towed(track, survey.time, survey.model, rates=survey.rates)
    now = (*survey.start, survey.time, survey.z, survey.rates)
    assert all(np.array_equal(a, b, equal_nan=True) for a, b in zip(now, kept, strict=True))
    again = filtered(survey, loss=HUBER)
    assert (track.mean == again.mean).all()


@pytest.mark.parametrize(
    "wrong",
    [
        {"z": np.zeros((3, 3))},
        {"time": [0.0, 2.0, 1.0]},
        {"time": [0.0, np.nan, 1.0]},
        {"sigma": [1.0, 1.0, 0.0, 1.0]},
        {"rates": np.zeros((2, 2))},
        {"state_loss": loss_named("gate")},
    ],
)
def test_options_that_do_not_fit_are_refused(wrong):
    start = simulate(1, minutes=9.0).start
    given = {"time": [0.0, 1.0, 2.0], "z": np.zeros((3, 4)), "sigma": np.ones(4)} | wrong
    with pytest.raises(OptionsError):
        filter_towed(start, model=towed_model(), **given)
