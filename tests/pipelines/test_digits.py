"""Velocities of few digits: never believed beyond the last one, also where they never change."""

from dataclasses import replace

import numpy as np
import pytest

from surefix.comparison.run import clean_trial
from surefix.io.nmea_sentence import KNOT
from surefix.pipelines.clean import clean_sources
from surefix.pipelines.inputs import open_inputs
from surefix.pipelines.options import CleanOptions
from surefix.simulate.contamination import alone, draw, draw_world
from surefix.types import Verdict

N, SPEED, COURSE = 1000, 5.0 * KNOT, np.radians(50.0)


def wander(rng, scale):
    """A slow change of the given standard deviation, with a memory of 100 s."""
    out, keep = np.zeros(N), np.exp(-0.01)
    for k in range(1, N):
        out[k] = keep * out[k - 1] + np.sqrt(1.0 - keep**2) * rng.standard_normal()
    return scale * out


def under_way(seed, *, wanders, bad=0.05, digits=1):
    """Truth, fixes, velocities of 0.1 or 0.01 knot and 1°, and which fixes are wild."""
    rng = np.random.default_rng(seed)
    speed, course = SPEED + wander(rng, wanders), COURSE + wander(rng, wanders) / SPEED
    place = np.cumsum(_across(speed, course), axis=0)
    fixes = place + rng.standard_normal(place.shape)
    wild = rng.random(N) < bad
    fixes[wild] += rng.uniform(10.0, 80.0, (wild.sum(), 1)) * _across(
        1.0, rng.uniform(0.0, 6.28, wild.sum())
    )
    told = _across(np.round(speed / KNOT, digits) * KNOT, np.radians(np.round(np.degrees(course))))
    return place, fixes, told, wild


def _across(speed, course):
    return np.column_stack([speed * np.sin(course), speed * np.cos(course)])


def velocity_noise(cleaned):
    return next(each.value for each in cleaned.noise if each.quantity == "velocity")


@pytest.mark.parametrize("mode", ["offline", "realtime"])
@pytest.mark.parametrize(("wanders", "values"), [(0.004, 1), (0.02, 3)])
def test_the_track_is_not_nailed_to_a_velocity_that_hardly_changes(wanders, values, mode):
    for seed in range(2):
        place, fixes, told, wild = under_way(seed, wanders=wanders)
        speeds = np.unique(np.round(np.hypot(*told.T), 6))
        assert len(speeds) <= values
        source = {"time": np.arange(N) + 1.7e9, "x": fixes[:, 0], "y": fixes[:, 1]}
        source |= {"vx": told[:, 0], "vy": told[:, 1]}
        cleaned = clean_sources(open_inputs([source]), CleanOptions(mode=mode))
        assert velocity_noise(cleaned) >= 0.1 * KNOT / 12.0**0.5 * 0.999
        off = cleaned.track.position[50:, :2] - place[50:]
        assert np.sqrt((off**2).mean()) < 0.5  # fixes alone: 0.3 at best; nailed to them: 1.1
        assert not (cleaned.verdicts.verdict == Verdict.REJECTED)[~wild].any()


@pytest.mark.parametrize("mode", ["offline", "realtime"])
@pytest.mark.parametrize("wanders", [0.004, 0.02])
def test_sigma_knows_that_a_velocity_stays_off(wanders, mode):
    """For as long as its last digit stays."""
    for seed in range(2):
        place, fixes, told, _ = under_way(seed, wanders=wanders)
        source = {"time": np.arange(N) + 1.7e9, "x": fixes[:, 0], "y": fixes[:, 1]}
        source |= {"vx": told[:, 0], "vy": told[:, 1]}
        track = clean_sources(open_inputs([source]), CleanOptions(mode=mode)).track
        off = (track.position[50:, :2] - place[50:]) / track.sigma_position[50:, :2]
        assert 0.6 < (off**2).mean() < 2.0


@pytest.mark.parametrize("mode", ["offline", "realtime"])
def test_coarse_velocities_leave_sigma_honest_and_help(mode):
    """In worlds drawn at random, with a last digit of 10 … 40 times their noise."""
    honest, ratio = [], []
    for seed in range(20, 24):
        world = draw_world([seed, 3], epochs=600, axes=1 + seed % 3)
        trial = draw("isolated-5", world, [seed, 3])
        digit = world.sigma_mps * (10.0 + 10.0 * (seed - 20))
        rough = replace(trial, velocities=np.round(trial.velocities / digit) * digit)
        one, two = (clean_trial(log, "multi-hypothesis", mode) for log in (rough, alone(trial)))
        d, sigma = world.axes, one.track.sigma_position[20:]
        off = [(each.track.position[:, :d] - trial.position)[20:] for each in (one, two)]
        honest.append((off[0] ** 2 / sigma[:, :d] ** 2).mean())
        ratio.append(np.sqrt((off[0] ** 2).mean() / (off[1] ** 2).mean()))
    assert 0.85 < np.mean(honest) < 1.2
    assert np.max(honest) < 1.5
    assert np.mean(ratio) < 1.0


def test_digits_count_in_the_axes_they_were_recorded_in(tmp_path):
    """The local frame turns along a track in the far north; the course was rounded before."""
    _, fixes, told, _ = under_way(3, wanders=0.3, bad=0.0, digits=2)
    lines = []
    for k in range(N):
        minutes = 60.0 * np.array([80.0 + fixes[k, 1] / 111_700.0, 10.0 + fixes[k, 0] / 19_400.0])
        (south, west), rest = minutes // 60.0, minutes % 60.0
        place = f"{south:02.0f}{rest[0]:08.5f},N,{west:03.0f}{rest[1]:08.5f},E"
        course = np.degrees(np.arctan2(*told[k])) % 360.0
        moved = f"{np.hypot(*told[k]) / KNOT:.2f},{course:.0f}"
        lines.append(f"$GPRMC,12{k // 60:02d}{k % 60:02d}.00,A,{place},{moved},221126,,,A")
    log = tmp_path / "log.nmea"
    log.write_text("\r\n".join(lines) + "\r\n")
    cleaned = clean_sources(open_inputs([log], require_checksum=False), CleanOptions())
    assert velocity_noise(cleaned) >= 0.95 * SPEED * np.radians(1.0) / 12.0**0.5
