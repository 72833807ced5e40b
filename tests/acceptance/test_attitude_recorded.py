"""A recorded ship that pitches: the receiver on its mast against the one that corrects itself.

The arm of the Palmer's P-code receiver is what its distance from the Seapath's position does by
roll (33.5 m to starboard per rad, ± 0.4) and by pitch (34.1 m aft), and what it is on average.
"""

import numpy as np
import pytest

from surefix.api import clean
from surefix.io.nmea_log import read_nmea
from surefix.pipelines.options import CleanOptions

ARM = [-0.9, 0.0, 33.5]  # m forward, starboard, up


@pytest.fixture(scope="module")
def palmer(data):
    """The log of the mast, that of the Seapath, and the times and positions that it tells."""
    mast, seapath = (
        data / "ship_palmer" / f"NBP1406_{name}-2014-08-01" for name in ("PCOD", "seap")
    )
    (log,) = read_nmea(seapath)
    return mast, seapath, log.fixes.time, log.fixes.position


def differences(cleaned, time, position):
    """East and north, m, of a track from the Seapath, and σ of the track."""
    at, here = cleaned.track.time, cleaned.track.geodetic
    inside = (at > time[0] + 20.0) & (at < time[-1] - 5.0)
    there = [np.interp(at, time, column) for column in position.T]
    east = (here[:, 1] - there[1]) * 111_195.0 * np.cos(np.radians(there[0]))
    north = (here[:, 0] - there[0]) * 111_195.0
    return np.column_stack([east, north])[inside], cleaned.track.sigma_position[inside, :2]


def test_roll_and_pitch_take_the_swing_of_the_mast_out(palmer):
    mast, seapath, time, position = palmer
    options = {"mode": "realtime", "settle_rows": 120}
    level = clean(mast, options=CleanOptions(**options))
    off, _ = differences(level, time, position)
    arms = {mast.name: ARM}
    told = clean(mast, attitude=seapath, options=CleanOptions(**options, lever_arm=arms))
    left, sigma = differences(told, time, position)
    before, after = off.std(axis=0), left.std(axis=0)
    assert np.all(before > 0.65)
    assert np.all(after < 0.4)
    assert np.all(after < 0.5 * before)
    # Signs the wrong way round would make it twice as bad instead
    wrong = {mast.name: [-ARM[0], 0.0, -ARM[2]]}
    worse, _ = differences(
        clean(mast, attitude=seapath, options=CleanOptions(**options, lever_arm=wrong)),
        time,
        position,
    )
    assert np.all(worse.std(axis=0) > 1.5 * before)
    # … and σ is what it is off by, which includes what lasts
    assert 0.3 < np.sqrt(np.mean((left / sigma) ** 2)) < 2.0
