"""Fixes that are left out are really out, in blocks, each once."""

from dataclasses import replace

import numpy as np
import pytest

from acceptance.product import gga, survey, zda
from surefix.comparison.leave_out import (
    BEGUN,
    PARTS,
    fixes_of,
    parts_of,
    recorded,
    records,
    without,
)
from surefix.pipelines.clean import clean_sources
from surefix.pipelines.inputs import open_inputs
from surefix.pipelines.options import CleanOptions
from surefix.types import Verdict


def polled(seed=1, n=160):
    """Log whose sensor is polled twice for each fix."""
    log = survey(n, seed=seed, interval=2.0)
    twice = {name: np.repeat(values, 2) for name, values in log.items()}
    twice["time"][1::2] += 1.0
    return twice


@pytest.mark.parametrize("length", [1, 3, 10])
@pytest.mark.parametrize("fixes", [100, 321, 2000])
@pytest.mark.parametrize("seed", range(3))
def test_every_fix_is_in_one_part_and_no_two_neighbouring_blocks_are(seed, fixes, length):
    part = parts_of(fixes, length, [seed])
    assert (part[:BEGUN] == -1).all()
    dealt = part[BEGUN:]
    assert set(dealt) <= set(range(PARTS))
    sizes = np.bincount(dealt, minlength=PARTS)
    assert np.ptp(sizes) <= 2 * length
    blocks = dealt[: len(dealt) // length * length].reshape(-1, length)
    assert (blocks == blocks[:, :1]).all()
    assert (np.diff(dealt[::length]) != 0).all()
    assert (parts_of(fixes, length, [seed]) == part).all()
    assert (parts_of(fixes, length, [seed + 1]) != part).any()


@pytest.mark.parametrize("mode", ["offline", "realtime"])
@pytest.mark.parametrize("method", ["igg3", "multi-hypothesis"])
def test_what_is_left_out_changes_nothing_not_even_by_its_copies(method, mode):
    log = polled()
    options = CleanOptions(method=method, mode=mode)
    recording = recorded(open_inputs([log]))
    whole = clean_sources(without(recording, {}), options)
    held = fixes_of(whole)
    assert len(held.row) == 160
    assert (whole.verdicts.verdict == Verdict.DUPLICATE).sum() == 160
    assert (held.with_copies == np.repeat(np.arange(160), 2)).all()
    gone = np.isin(held.with_copies, np.flatnonzero(parts_of(160, 3, [1]) == 4))
    assert 24 <= gone.sum() <= 40
    wild = {name: np.where(gone, 1e4 - values, values) for name, values in log.items()}
    wild["time"] = log["time"]
    other = recorded(open_inputs([wild]))
    one, two = (
        clean_sources(without(each, records(whole, gone)), options) for each in (recording, other)
    )
    np.testing.assert_array_equal(one.track.position, two.track.position)
    np.testing.assert_array_equal(one.track.sigma_position, two.track.sigma_position)
    assert np.isfinite(one.track.position[gone]).all()
    assert (one.verdicts.verdict[gone] == Verdict.MISSING).all()
    kept = held.row[~np.isin(held.row, np.flatnonzero(gone))]
    assert (one.verdicts.verdict[kept] != Verdict.MISSING).all()


def test_velocities_of_a_fix_go_with_it_and_other_sensors_stay():
    log = survey(120)
    log["vx"], log["vy"] = np.ones(120), np.full(120, 0.3)
    depth = {"time": log["time"] + 0.3, "depth": -log["z"]}
    recording = recorded(open_inputs([log], depth=depth))
    whole = clean_sources(without(recording, {}), CleanOptions())
    gone = np.arange(120) % 7 == 0
    fixes, support = (list(s.logs) for s in without(recording, records(whole, gone)))
    assert np.isnan(fixes[0].fixes.position[gone]).all()
    assert np.isnan(fixes[0].fixes.velocity[gone]).all()
    assert np.isfinite(fixes[0].fixes.position[~gone]).all()
    assert np.isfinite(fixes[0].fixes.time).all()
    assert np.isfinite(support[0].channels[0].value).all()


def test_two_sensors_of_one_file_are_told_apart(tmp_path):
    place = tmp_path / "two.nmea"
    lines = [
        gga(f"12{i // 60:02d}{i % 60:02d}", 36.0 + 1e-5 * i, 1e-5 * (i % 7) - 122, talker=talker)
        for i in range(120)
        for talker in ("GP", "II")
    ]
    place.write_text("".join([zda("120000", 1, 6, 2024), *lines]), encoding="ascii")
    recording = recorded(open_inputs([place]))
    whole = clean_sources(without(recording, {}), CleanOptions())
    held = fixes_of(whole)
    assert len(whole.sensors) == 2
    gone = np.isin(held.with_copies, np.flatnonzero(whole.sensor[held.row] == 0)[10:20])
    found = clean_sources(without(recording, records(whole, gone)), CleanOptions())
    lost = found.verdicts.verdict == Verdict.MISSING
    assert lost.sum() == gone.sum() > 0
    assert set(found.sensor[lost]) == {0}


def test_what_no_method_judges_cannot_be_left_out():
    log = survey(80)
    log["x"][30] = log["y"][30] = log["z"][30] = np.nan
    log["time"][40] = np.nan
    whole = clean_sources(without(recorded(open_inputs([log])), {}), CleanOptions())
    judged = whole.verdicts.verdict[fixes_of(whole).row]
    assert len(judged) == 78
    assert not np.isin(judged, (Verdict.MISSING, Verdict.DUPLICATE)).any()
    wild = replace(whole, verdicts=whole.verdicts._replace(verdict=np.full(80, Verdict.REJECTED)))
    np.testing.assert_array_equal(fixes_of(wild).row, fixes_of(whole).row)
