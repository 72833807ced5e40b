"""Sources that are late: what `clean` and `info` say, and what removing does."""

import numpy as np
import pytest

import surefix
from surefix.errors import OptionsError
from surefix.pipelines.info import describe, info_lines
from surefix.pipelines.options import CleanOptions
from surefix.simulate.rov_dive import columns, depth_columns, simulate, velocity_columns

LATE = 1.5


@pytest.fixture(scope="module")
def dive():
    return simulate(11, minutes=16.0, gross_share=0.2, dvl_clock_ppm=0.0)


def logs(dive, delay):
    fixes = columns(dive)
    fixes["time"] = fixes["time"] + delay
    return fixes, depth_columns(dive), velocity_columns(dive)


def cleaned(dive, delay, **options):
    fixes, depth, velocity = logs(dive, delay)
    chosen = CleanOptions(**options)
    return surefix.clean(fixes, depth=depth, velocity=velocity, options=chosen)


def said(result):
    return [event.text for event in result.events if event.kind == "latency"]


def off(result, dive):
    """Median horizontal distance of the track from the truth at its times, m."""
    truth = np.column_stack(
        [np.interp(result.track.time, dive.time, axis) for axis in dive.position.T]
    )
    return float(np.nanmedian(np.hypot(*(result.track.position - truth)[:, :2].T)))


@pytest.mark.parametrize("mode", ["offline", "realtime"])
def test_late_fixes_are_reported(dive, mode):
    (text,) = said(cleaned(dive, LATE, mode=mode))
    assert text.startswith("fixes of fix are 1.")
    assert " s late against the velocity of velocity" in text
    assert "; remove with --sensor-delay fix=1." in text


def test_early_fixes_are_reported_with_their_sign(dive):
    (text,) = said(cleaned(dive, -LATE))
    assert " s early against" in text
    assert "fix=-1." in text


def test_fixes_in_time_are_not_spoken_of(dive):
    assert said(cleaned(dive, 0.0)) == []


def test_nobody_looks_who_is_told_not_to(dive):
    assert said(cleaned(dive, LATE, latency="ignore")) == []


@pytest.mark.parametrize("mode", ["offline", "lagged"])
def test_removing_brings_the_track_to_its_place(dive, mode):
    as_it_is, removed = (
        cleaned(dive, LATE, mode=mode),
        cleaned(dive, LATE, latency="remove", mode=mode),
    )
    (text,) = said(removed)
    assert text.endswith("; removed")
    assert off(removed, dive) < 0.5 * off(as_it_is, dive)
    assert np.isfinite(removed.track.time).all()
    assert (np.diff(removed.track.time) > 0.0).all()


def test_removing_is_the_same_as_giving_the_delay(dive):
    removed = cleaned(dive, LATE, latency="remove")
    delay = float(removed.settings["sensor_delay_s"].split(":")[1].strip(" }"))
    given = cleaned(dive, LATE, latency="ignore", sensor_delay_s={"fix": delay})
    np.testing.assert_allclose(removed.track.time, given.track.time, atol=1e-6)
    np.testing.assert_allclose(removed.track.position, given.track.position, atol=1e-4)
    np.testing.assert_array_equal(removed.verdicts.verdict, given.verdicts.verdict)
    np.testing.assert_array_equal(removed.row, given.row)


def test_what_was_removed_is_not_found_again(dive):
    found = cleaned(dive, LATE, latency="remove").settings["sensor_delay_s"]
    delay = float(found.split(":")[1].strip(" }"))
    assert said(cleaned(dive, LATE, sensor_delay_s={"fix": delay})) == []


def test_real_time_cannot_remove_what_it_does_not_know_yet():
    with pytest.raises(OptionsError, match="realtime"):
        CleanOptions(mode="realtime", latency="remove")


def test_there_are_three_ways_to_treat_it():
    with pytest.raises(OptionsError, match="report, remove, ignore"):
        CleanOptions(latency="maybe")


def test_without_a_velocity_there_is_nothing_to_say(dive):
    fixes, depth, _ = logs(dive, LATE)
    assert said(surefix.clean(fixes, depth=depth)) == []


def test_info_says_it_too(dive, tmp_path):
    import pandas as pd

    fixes, _, velocity = logs(dive, LATE)
    places = {"usbl": fixes, "dvl": velocity}
    for name, table in places.items():
        pd.DataFrame(table).to_csv(tmp_path / f"{name}.csv", index=False)
    found = describe([tmp_path / "usbl.csv"], velocity=tmp_path / "dvl.csv")
    assert any(event["kind"] == "latency" for event in found["events"])
    assert any("fixes of usbl are 1." in line for line in info_lines(found))
