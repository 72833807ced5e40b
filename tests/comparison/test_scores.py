"""Scores of fixes left out: a density, honest, robust, and the same measure for all methods."""

from dataclasses import replace

import numpy as np
import pytest
from pyproj import Geod
from scipy.integrate import quad

from acceptance.product import geographic, survey
from surefix.comparison.leave_out import fixes_of, parts_of, recorded, records, without
from surefix.comparison.scores import (
    Yardstick,
    foretold,
    log_density,
    off_and_sigma,
    yardstick,
)
from surefix.pipelines.clean import clean_sources
from surefix.pipelines.inputs import open_inputs
from surefix.pipelines.options import CleanOptions


def measure(axes=2, scale=3.0, extent=500.0):
    return Yardstick(None, list(range(axes)), np.empty((0, axes)), scale, extent)


@pytest.mark.parametrize("scale", [0.5, 20.0])
def test_the_density_is_one_in_all(scale):
    def line(x):
        return np.exp(log_density(np.array([[x]]), np.array([[0.7]]), measure(1, scale)))[0]

    def ring(r):
        off = np.array([[r * 0.6, r * 0.8]])
        density = np.exp(log_density(off, np.array([[0.7, 0.7]]), measure(2, scale)))[0]
        return 2.0 * np.pi * r * density

    far = np.inf
    assert 2.0 * (quad(line, 0, 5)[0] + quad(line, 5, far)[0]) == pytest.approx(1.0, abs=1e-4)
    assert quad(ring, 0, 5)[0] + quad(ring, 5, far)[0] == pytest.approx(1.0, abs=1e-3)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("axes", [1, 2])
def test_the_honest_standard_deviation_scores_best_gross_errors_or_not(seed, axes):
    rng = np.random.default_rng(seed)
    off = rng.normal(0.0, 0.8, (4000, axes))
    for share in (0.0, 0.05):
        wild = rng.random(4000) < share
        seen = np.where(wild[:, None], rng.normal(0.0, 60.0, off.shape), off)
        scores = [
            log_density(seen, np.full_like(seen, sigma), measure(axes, 10.0)).mean()
            for sigma in (0.4, 0.65, 0.8, 1.0, 2.0)
        ]
        assert np.argmax(scores) == 2


def test_a_gross_error_costs_nearly_the_same_whoever_foretold_it():
    off, sharp, blunt = np.array([[40.0, 0.0]]), np.full((1, 2), 0.3), np.full((1, 2), 1.0)
    one, two = (log_density(off, sigma, measure()) for sigma in (sharp, blunt))
    assert one == pytest.approx(two, abs=1e-9)
    farther = log_density(2.0 * off, sharp, measure())
    assert one - farther == pytest.approx(3.0 * np.log(2.0), abs=0.02)


def test_what_nothing_foretells_counts_as_far_as_the_log_is_wide():
    off, sigma = np.array([[np.nan, np.nan], [300.0, 400.0]]), np.array([[np.nan] * 2, [1.0] * 2])
    one, two = log_density(off, sigma, measure(extent=500.0))
    assert one == pytest.approx(two)
    np.testing.assert_allclose(foretold(off, measure(extent=500.0)), [500.0, 500.0])


@pytest.mark.parametrize("globe", [False, True])
def test_differences_are_those_of_the_fixes_from_the_track(globe):
    log = survey(150, seed=3)
    given = geographic(log, 61.0, 179.9995) if globe else log
    recording = recorded(open_inputs([given]))
    whole = clean_sources(without(recording, {}), CleanOptions())
    held = fixes_of(whole)
    scale = yardstick(whole, held)
    fixes = np.flatnonzero(parts_of(150, 3, [2]) == 1)
    gone = records(whole, np.isin(held.with_copies, fixes))
    found = clean_sources(without(recording, gone), CleanOptions())
    order = np.random.default_rng(1).permutation(150)
    shuffled = _reordered(found, order)
    off, sigma = off_and_sigma(scale, whole, held, fixes, shuffled)
    if globe:  # the distance on the ellipsoid, worked out apart
        lat, lon = found.track.geodetic[fixes, :2].T
        far = Geod(ellps="WGS84").inv(lon, lat, given["lon"][fixes], given["lat"][fixes])[2]
        np.testing.assert_allclose(np.linalg.norm(off, axis=1), far, atol=1e-4)
        assert (np.sign(off[:, 1]) == np.sign(given["lat"][fixes] - lat)).all()
    else:
        raw = np.column_stack([log["x"], log["y"]])[fixes]
        np.testing.assert_allclose(off, raw - found.track.position[fixes, :2])
    noise = next(each.value for each in found.noise if each.quantity == "position")
    np.testing.assert_allclose(sigma, np.hypot(found.track.sigma_position[fixes, :2], noise))
    assert scale.axes == [0, 1]
    assert 2.0 < scale.scale < 10.0


def _reordered(found, order):
    track = type(found.track)._make(c if c is None else c[order] for c in found.track)
    return replace(found, track=track, row=found.row[order], sensor=found.sensor[order])


def test_heights_alone_are_scored_as_heights():
    log = survey(120)
    recording = recorded(open_inputs([{"time": log["time"], "z": log["z"]}]))
    whole = clean_sources(without(recording, {}), CleanOptions())
    held = fixes_of(whole)
    scale = yardstick(whole, held)
    off, sigma = off_and_sigma(scale, whole, held, np.arange(120), whole)
    assert scale.axes == [2]
    np.testing.assert_allclose(off[:, 0], log["z"] - whole.track.position[:, 2])
    assert (sigma > 0.3).all()
