"""A real surveillance radar against the tracks of its centre: its known errors are found."""

import csv
import re

import numpy as np
import pytest
from pyproj import Transformer

from surefix.fusion.registration import reference_bias
from surefix.models.radar import polar_difference, site, to_polar

FOOT, MILE = 0.3048, 1852.0


def number(text):
    return float(text) if text else np.nan


@pytest.fixture(scope="module")
def plots(data):
    """Range, azimuth and no elevation of the plots, and where the centre's tracks were, ECEF m."""
    folder = data / "radar_atc"
    if not folder.is_dir():
        pytest.skip("no recorded radar")
    notes = (data / "README.md").read_text(encoding="utf-8")  # says where the radar stands
    tracks = {}
    with (folder / "cat062_tracks_fds260429.csv").open() as file:
        for row in csv.DictReader(file):
            line = [number(row[name]) for name in ("tot_s", "lat", "lon")]
            tracks.setdefault(row["mode3a"], {}).setdefault(row["trk"], []).append(line)
    seen = []
    with (folder / "cat048_plots_260429.csv").open() as file:
        for row in csv.DictReader(file):
            same = tracks.get(row["mode3a"], {})
            if not row["mode3a"] or len(same) != 1:
                continue  # the code belongs to no track, or to several
            track = np.array(sorted(next(iter(same.values()))))
            when = number(row["tod_s"])
            k = int(np.searchsorted(track[:, 0], when))
            if 0 < k < len(track) and track[k, 0] - track[k - 1, 0] < 13.0:
                place = [np.interp(when, track[:, 0], track[:, i]) for i in (1, 2)]
                height = 100.0 * FOOT * number(row["fl_100ft"])
                polar = [MILE * number(row["rho_nmi"]), np.radians(number(row["theta_deg"]))]
                seen.append([*polar, *place, height])
    rows = np.array(seen)
    to_ecef = Transformer.from_crs("EPSG:4979", "EPSG:4978", always_xy=True)
    position = np.column_stack(to_ecef.transform(rows[:, 3], rows[:, 2], rows[:, 4]))
    south, west = re.search(r"\| `radar_atc` .*?([\d.]+) S ([\d.]+) W", notes).groups()
    lat, lon = np.radians([-float(south), -float(west)])
    up = [np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)]
    east = [-np.sin(lon), np.cos(lon), 0.0]
    axes = np.column_stack([east, np.cross(up, east), up])
    at = site(to_ecef.transform(-float(west), -float(south), 0.0), axes)
    polar = np.column_stack([rows[:, :2], np.full(len(rows), np.nan)])
    return polar, position, at


def test_range_and_azimuth_errors_are_those_of_the_recording(plots):
    polar, position, at = plots
    assert len(polar) > 1500
    found = reference_bias(polar, position, at, len(polar))
    assert found.bias[-1, 0] == pytest.approx(194.0, abs=10.0)
    assert np.degrees(found.bias[-1, 1]) == pytest.approx(0.53, abs=0.01)
    off = polar_difference(polar, to_polar(position, at)) - found.bias[-1]
    spread = 1.4826 * np.nanmedian(np.abs(off[:, :2]), axis=0)
    assert spread[0] == pytest.approx(71.0, rel=0.15)
    assert np.degrees(spread[1]) == pytest.approx(0.056, rel=0.15)


def test_they_are_found_within_some_turns_of_the_antenna(plots):
    polar, position, at = plots
    found = reference_bias(polar, position, at, 300).bias[300:]
    assert np.abs(found[:, 0] - 194.0).max() < 60.0
    assert np.degrees(np.abs(found[:, 1])).min() > 0.5
