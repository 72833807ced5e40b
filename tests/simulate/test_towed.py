"""The simulated survey is what its description says."""

import numpy as np
import pytest
from pyproj import Geod

from surefix.models.towed import offset, towed_model
from surefix.simulate.towed import simulate

EARTH = Geod(ellps="WGS84")


def test_a_seed_gives_the_same_bits_and_another_seed_others():
    one, same, other = simulate(1), simulate(1), simulate(2)
    for name in ("time", "truth", "z", "bad", "surfaced", "rates"):
        assert np.array_equal(getattr(one, name), getattr(same, name), equal_nan=True)
    assert one.start.mean.tolist() == same.start.mean.tolist()
    assert not np.array_equal(one.truth, other.truth)


@pytest.mark.parametrize("share", [0.0, 0.1, 0.4])
def test_shares_and_widths_of_the_noise(share):
    off, bad = [], []
    for seed in range(8):
        survey = simulate(seed, contamination=share, spread=15.0)
        error = survey.z - survey.truth[:, [0, 1, 4, 5]]
        error[:, 0], error[:, 1] = offset(*survey.truth[:, :2].T, *survey.z[:, :2].T)
        error[:, 2] = np.angle(np.exp(1j * error[:, 2]))
        off.append((error / survey.sigma)[survey.surfaced])
        bad.append(survey.bad[survey.surfaced])
    off, bad = np.concatenate(off), np.concatenate(bad)
    assert bad.mean() == pytest.approx(share, abs=0.01)
    for column in range(4):
        good = off[~bad[:, column], column]
        assert good.std() == pytest.approx(1.0, abs=0.03)
        if share:
            assert off[bad[:, column], column].std() == pytest.approx(15.0, rel=0.1)


def test_surveys_of_one_seed_differ_only_in_what_was_asked():
    clean, dirty = simulate(3, contamination=0.0), simulate(3, contamination=0.2)
    assert (clean.truth == dirty.truth).all()
    assert np.array_equal(clean.z[~dirty.bad], dirty.z[~dirty.bad], equal_nan=True)
    gusty = simulate(3, gust_mps=1.0)
    assert (gusty.truth[:, 4:] == clean.truth[:, 4:]).all()
    jump = np.hypot(*np.diff(gusty.truth[:, 2:4] - clean.truth[:, 2:4], axis=0).T)
    assert jump.max() == pytest.approx(1.0, abs=0.01)
    assert (jump > 0.5).sum() == 2


def test_positions_are_missing_below_and_only_there():
    survey = simulate(1)
    assert (np.isnan(survey.z[:, :2]).all(axis=1) == ~survey.surfaced).all()
    assert np.isfinite(survey.z[:, 2:]).all()
    assert not survey.bad[~survey.surfaced, :2].any()
    assert 0.5 < survey.surfaced.mean() < 0.7


@pytest.mark.parametrize("latitude", [0.0, 45.0, -80.0])
def test_positions_move_as_velocity_says(latitude):
    model = towed_model(position=0.0)
    survey = simulate(1, latitude_deg=latitude, longitude_deg=179.999, model=model)
    speed, heading = survey.truth[:, 5], survey.truth[:, 4]
    velocity = survey.truth[:, 2:4] + speed[:, None] * np.column_stack(
        (np.cos(heading), np.sin(heading))
    )
    phi, lam = np.degrees(survey.truth[:, :2].T)
    azimuth, _, length = EARTH.inv(lam[:-1], phi[:-1], lam[1:], phi[1:])
    step = np.diff(survey.time)
    expected = 0.5 * (velocity[1:] + velocity[:-1]) * step[:, None]
    moved = length[:, None] * np.column_stack(
        (np.cos(np.radians(azimuth)), np.sin(np.radians(azimuth)))
    )
    assert np.abs(moved - expected).max() < 0.03
    assert np.abs((moved - expected).sum(axis=0)).max() < 0.5


def test_current_is_the_process_of_eq_2():
    model = towed_model(correlation_s=60.0, current_mps=0.2)
    series = np.concatenate(
        [simulate(s, minutes=60.0, jitter=0.0, model=model).truth[:, 2:4] for s in range(6)], axis=1
    )
    assert series.std() == pytest.approx(0.2, rel=0.1)
    for lag in (10, 60):
        correlation = (series[lag:] * series[:-lag]).mean() / series.var()
        assert correlation == pytest.approx(np.exp(-lag / 60.0), abs=0.1)


def test_times_are_irregular_and_increase():
    step = np.diff(simulate(1, jitter=0.3).time)
    assert step.min() > 0.3
    assert step.std() > 0.1


def test_kicks_move_the_body_and_nothing_else_does():
    quiet = simulate(1, minutes=20.0)
    kicked = simulate(1, minutes=20.0, state_contamination=0.05)
    walk = [np.diff(s.truth[:, 5]).std() for s in (quiet, kicked)]
    assert walk[1] > 1.5 * walk[0]
