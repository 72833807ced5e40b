"""The ship's chain: each stage, and what a failure or a return of a sensor does."""

import math

import numpy as np
import pytest

from reference import ship_cleaning as twin
from surefix.cleaning.plausibility import Check
from surefix.errors import OptionsError
from surefix.metrics import mean_bounds
from surefix.pipelines.ship import integrate
from surefix.pipelines.ship_cleaning import Stream, clean_stream
from surefix.pipelines.ship_fusion import Aligned, Quality, align, fuse
from surefix.pipelines.ship_options import ShipOptions, thresholds
from surefix.types import Reason, Verdict

TURN = 2.0 * np.pi


def stream(sensor, quantity, value, time=None, valid=None):
    value = np.asarray(value, dtype=np.float64)
    time = np.arange(float(len(value))) if time is None else time
    return Stream(
        sensor, quantity, time, value, np.ones(len(value), np.bool_) if valid is None else valid
    )


def combined(values, sigmas, *, period=0.0, fade_s=30.0, window=60, drift=0.0, gate=6.0):
    value = np.column_stack(values).astype(np.float64)
    sigma = np.broadcast_to(np.asarray(sigmas, dtype=np.float64), value.shape)
    aligned = align(value, sigma, 1.0, window, drift, period)
    return fuse(aligned, 1.0, gate=gate, fade_s=fade_s, period=period, systematic=0.0)


def noise(seed, sigma, n=2000):
    return np.random.default_rng(seed).normal(0.0, sigma, n)


def test_one_epoch_is_the_weighted_mean_of_the_textbook():
    for values, sigmas in (([1.0, 1.4], [0.5, 0.2]), ([3.0, 3.1, 2.8], [0.3, 0.1, 0.6])):
        z, variance = np.array([values]), np.square([sigmas])
        found = fuse(
            Aligned(z, np.zeros_like(z), variance, np.zeros(1)),
            1.0, gate=9.0, fade_s=30.0, period=0.0, systematic=0.0,
        )  # fmt: skip
        mean, sigma = twin.inverse_variance(values, sigmas)
        assert found.value[0] == pytest.approx(mean, abs=1e-9)
        assert found.sigma[0] == pytest.approx(sigma, abs=1e-9)
        assert found.sources[0] == 2 ** len(values) - 1


def test_headings_are_combined_on_the_circle():
    z = np.radians([[359.0, 2.0]])
    found = fuse(
        Aligned(z, np.zeros_like(z), np.full((1, 2), 1e-2), np.zeros(1)),
        1.0, gate=9.0, fade_s=30.0, period=TURN, systematic=0.0,
    )  # fmt: skip
    assert np.degrees(found.value[0]) == pytest.approx(0.5, abs=1e-9)


@pytest.mark.parametrize("seed", range(4))
def test_the_combination_is_better_than_each_sensor_and_its_sigma_honest(seed):
    sigmas = (0.5, 0.7, 1.0)
    values = [noise(10 * seed + i, s) + (0.0, 3.0, -2.0)[i] for i, s in enumerate(sigmas)]
    found = combined(values, sigmas)
    late = slice(200, None)
    rms = np.sqrt(np.mean(found.value[late] ** 2))
    assert rms < 0.85 * min(sigmas)
    # offsets come from medians of 60 differences: one in thirty epochs is independent of the last
    low, high = mean_bounds(1, 1800 // 30, 0.9999)
    assert low < np.mean((found.value[late] / found.sigma[late]) ** 2) < high
    assert (found.quality[late] == Quality.VALID).mean() > 0.99


def test_a_drifting_sensor_stands_in_without_lag():
    t = np.arange(2000.0)
    truth = 4.0 * t
    gnss = truth + noise(1, 1.0)
    gnss[1500:1800] = np.nan
    ins = truth + 800.0 + 0.3 * t + noise(2, 0.05)
    found = combined([gnss, ins], [1.0, 0.05], drift=0.1)
    error = found.value - truth
    assert np.abs(error[300:1500]).max() < 2.0
    assert np.abs(error[1500:1800]).max() < 12.0  # of the slope of medians: under 0.04 m/s
    assert np.abs(np.diff(error[1400:1800])).max() < 1.5
    assert np.abs(error[1800:]).max() < 12.0
    assert np.abs(error[1900:]).max() < 2.0
    assert (found.sources[1810:] == 3).mean() > 0.95  # aligned again at once
    inside = found.sources[1500:1800]
    np.testing.assert_array_equal(inside, 2)
    assert (np.diff(found.sigma[1510:1790]) > 0.0).all()


def test_a_return_is_faded_in_and_told():
    t = np.arange(1500.0)
    best, other = noise(3, 0.1, 1500), noise(4, 0.1, 1500)
    best[600:900] = np.nan
    other[650:] += 20.0 * np.minimum((t[650:] - 650.0) / 100.0, 1.0)  # wanders unseen
    found = combined([best, other], [0.1, 0.1], drift=0.05)
    step = np.abs(np.diff(found.value))
    assert step[899] < 1.0  # 20 m between the sensors
    assert (found.quality[900:960] == Quality.DOUBTFUL).all()
    assert abs(found.value[1100]) < 0.5
    wrong = np.abs(found.value[900:1000])
    assert (wrong < 3.0 * found.sigma[900:1000]).mean() > 0.95


@pytest.mark.parametrize("length", [5, 30, 44])
@pytest.mark.parametrize("who", [0, 1])
def test_of_two_sensors_the_one_that_jumps_is_left_out(length, who):
    values = [noise(5, 0.2), 7.0 + noise(6, 0.2)]
    values[who][1000 : 1000 + length] += 15.0
    found = combined(values, [0.2, 0.2], window=90)
    during = slice(1000, 1000 + length)
    assert np.abs(found.value[900:1200]).max() < 1.5
    np.testing.assert_array_equal(found.sources[during], 2 - who)
    assert (found.quality[during] == Quality.DOUBTFUL).all()


def test_of_three_sensors_the_minority_is_left_out():
    values = [noise(s, 0.2) for s in (7, 8, 9)]
    values[0][500:540] -= 30.0
    found = combined(values, [0.2] * 3, window=90)
    assert np.abs(found.value[400:700]).max() < 1.0
    np.testing.assert_array_equal(found.sources[500:540], 6)


def test_a_single_sensor_that_jumps_is_followed_slowly_and_told():
    x = noise(10, 0.1)
    x[1000:] += 40.0
    found = combined([x], [0.1])
    assert np.abs(np.diff(found.value)).max() < 3.0
    assert (found.quality[1000:1060] == Quality.DOUBTFUL).all()
    assert abs(found.value[1300] - 40.0) < 0.5
    assert (found.quality[1400:] == Quality.VALID).mean() > 0.98


def test_nothing_at_all_is_invalid():
    x = noise(11, 0.1, 300)
    x[100:200] = np.nan
    found = combined([x], [0.1])
    np.testing.assert_array_equal(found.quality[100:200], Quality.INVALID)
    assert np.isnan(found.value[100:200]).all()
    assert (found.sources[100:200] == 0).all()
    assert np.isfinite(found.value[200:]).all()


def test_an_unswerving_swing_is_no_contradiction():
    """A heading in a seaway, alone, is predicted badly; it must not be doubted for ever."""
    t = np.arange(3000.0)
    heading = np.mod(0.2 * np.sin(TURN * t / 9.0), TURN)
    found = combined([heading], [0.002], period=TURN)
    off = (found.value - heading + np.pi) % TURN - np.pi
    assert np.abs(off[500:]).max() < 1e-6
    assert (found.quality[500:] == Quality.VALID).all()


def test_each_sample_gets_its_verdict():
    x = 0.01 * np.arange(100.0)
    x[20], x[40], x[41] = np.nan, 60.0, -5.0
    x[60:70] = x[60]
    valid = np.ones(100, np.bool_)
    valid[80] = False
    options = ShipOptions(frozen=4, rate_margin=math.inf)
    done = clean_stream(stream("log", "speed", x, valid=valid), np.empty(0), options)
    verdict, reason = done.verdicts.verdict, done.verdicts.reason
    assert (verdict[20], reason[20]) == (Verdict.MISSING, Reason.NO_VALUE)
    assert (verdict[40], reason[40]) == (Verdict.REJECTED, Reason.OFF)
    assert (verdict[80], reason[80]) == (Verdict.REJECTED, Reason.INVALID)
    np.testing.assert_array_equal(verdict[64:70], Verdict.DUPLICATE)
    np.testing.assert_array_equal(done.verdicts.detail[64:70], 63.0)
    assert (verdict == Verdict.USED).sum() == 100 - 10
    assert done.replaced[40]
    assert done.replaced[41]
    assert done.verdicts.innovation_sigma[40] > 100.0
    assert np.isnan(done.value[[20, 64, 80]]).all()
    assert abs(done.value[40] - 0.4) < 0.03


@pytest.mark.parametrize("sigma", [0.05, 0.4])
def test_noise_is_evaluated(sigma):
    options = ShipOptions(max_acceleration=50.0)
    for seed in range(3):
        x = noise(seed, sigma) + 5.0
        found = clean_stream(stream("log", "speed", x), np.empty(0), options).sigma
        assert np.median(found[200:]) == pytest.approx(sigma, rel=0.06)


def test_coarse_digits_have_their_rounding_as_noise():
    x = np.round(5.0 + noise(1, 0.01), 1)
    found = clean_stream(stream("log", "speed", x), np.empty(0), ShipOptions())
    assert found.sigma[-1] == 0.01  # never changes: a share of the threshold
    x = np.round(5.0 + noise(1, 0.05), 1)
    found = clean_stream(stream("log", "speed", x), np.empty(0), ShipOptions())
    assert (found.sigma >= 0.1 / np.sqrt(12.0) - 1e-12).all()


def test_positions_and_every_sensor_meet_in_the_record():
    n, t = 900, np.arange(900.0)
    latitude = np.radians(60.0) + 5.0 * t / 6.37e6
    longitude = np.mod(np.radians(179.99) + 8.0 * t / 3.19e6 + np.pi, TURN) - np.pi  # over 180°
    east, north = np.full(n, 3.0), np.full(n, 4.0)
    streams = [
        stream("INS", "v_east", east + noise(1, 0.02, n)),
        stream("INS", "v_north", north + noise(2, 0.02, n)),
        stream("GNSS", "latitude", latitude + noise(3, 1e-7, n)),
        stream("GNSS", "longitude", longitude + noise(4, 2e-7, n)),
        stream("gyro", "heading", np.mod(noise(5, 0.002, n), TURN)),
        stream("sounder", "depth", (50.0 + noise(6, 0.1, n))[::5], t[::5]),
    ]
    record = integrate(streams, ShipOptions())
    assert set(record.quantities) == {"east", "north", "speed", "heading", "depth"}
    late = slice(100, 890)
    assert np.abs(record.latitude - latitude)[late].max() < 5e-7
    off = np.abs((record.longitude - longitude + np.pi) % TURN - np.pi)
    assert off[late].max() < 1e-6
    assert np.abs(record.quantities["speed"].value[late] - 5.0).max() < 0.2
    heading = (record.quantities["heading"].value + np.pi) % TURN - np.pi
    assert np.abs(heading[late]).max() < 0.01
    assert np.isfinite(record.quantities["depth"].value[late]).all()  # between slower samples
    assert record.sensors["speed"] == ("INS",)


def test_order_says_who_is_trusted():
    x = noise(1, 0.1, 600)
    streams = [stream("B", "depth", 30.0 + x), stream("A", "depth", 33.0 + noise(2, 0.1, 600))]
    for order, level in ((("A", "B"), 33.0), (("B",), 30.0), ((), 30.0)):
        record = integrate(streams, ShipOptions(order=order))
        assert np.median(record.quantities["depth"].value) == pytest.approx(level, abs=0.05)


def test_streams_are_not_changed_and_bad_ones_are_harmless():
    x = noise(1, 0.1, 300)
    x[::7] = np.inf
    before = x.copy()
    nothing = stream("C", "depth", np.full(300, np.nan))
    record = integrate([stream("A", "depth", 20.0 + x), nothing], ShipOptions())
    np.testing.assert_array_equal(x, before)
    assert np.isfinite(record.quantities["depth"].value[5:290]).all()
    assert (record.streams[1].check == Check.MISSING).all()


def test_wrong_options_and_streams():
    for wrong in ({"max_speed": 0.0}, {"gate": np.nan}, {"frozen": -1}, {"drift": {"speed": -1.0}}):
        with pytest.raises(OptionsError):
            ShipOptions(**wrong)
    with pytest.raises(OptionsError, match="no samples"):
        integrate([], ShipOptions())
    with pytest.raises(OptionsError, match="longitude"):
        integrate([stream("A", "latitude", np.zeros(50))], ShipOptions())
    with pytest.raises(OptionsError, match="quantity"):
        thresholds("salinity", np.arange(3.0), np.empty(0), ShipOptions())
