import numpy as np
import pytest
from pyproj import Proj

from surefix.geo.local_frame import LocalFrame, origin_of, rotate

ORIGINS = [(0.0, 0.0), (36.7, 179.95), (-54.8, -68.3), (89.999, 10.0), (90.0, 10.0), (-90.0, 0.0)]
KM = 1000.0


def ring(radius, count=72):
    angle = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False) + 0.01
    return radius * np.sin(angle), radius * np.cos(angle)


@pytest.mark.parametrize("origin", ORIGINS)
@pytest.mark.parametrize("radius", [0.001, 1.0, KM, 100 * KM, 1000 * KM])
def test_round_trip_is_within_a_micrometre(origin, radius):
    frame = LocalFrame(*origin)
    x, y = ring(radius)
    latitude, longitude, out = frame.to_geographic(x, y)
    again_x, again_y, back = frame.to_local(latitude, longitude)
    assert np.hypot(again_x - x, again_y - y).max() < 1e-6
    assert np.abs(longitude).max() <= 180.0
    assert out == pytest.approx(back, abs=1e-12)


def test_agrees_with_the_projection_of_proj():
    frame = LocalFrame(48.0, 11.0)
    x, y = ring(300 * KM)
    latitude, longitude, _ = frame.to_geographic(x, y)
    east, north = Proj(proj="aeqd", lat_0=48.0, lon_0=11.0, ellps="WGS84")(longitude, latitude)
    assert np.hypot(east - x, north - y).max() < 1e-4


def frame_velocity_by_differences(frame, latitude, longitude, azimuth, step_deg=1e-5):
    """Direction in the frame of a small step of true azimuth, by central differences."""
    north, east = np.cos(azimuth) * step_deg, np.sin(azimuth) * step_deg
    # radii of curvature of WGS-84: degrees of latitude and longitude per metre differ
    squared, sine = 0.00669437999014, np.sin(np.radians(latitude))
    prime_vertical = 1.0 / np.sqrt(1.0 - squared * sine**2)
    meridian = (1.0 - squared) * prime_vertical**3
    d_lat = north / meridian
    d_lon = east / (prime_vertical * np.cos(np.radians(latitude)))
    ahead = frame.to_local(latitude + d_lat, longitude + d_lon)
    behind = frame.to_local(latitude - d_lat, longitude - d_lon)
    return ahead[0] - behind[0], ahead[1] - behind[1]


@pytest.mark.parametrize("origin", [(0.0, 0.0), (36.7, 179.95), (-54.8, -68.3), (75.0, 30.0)])
@pytest.mark.parametrize(
    ("radius", "tolerance"), [(3 * KM, 1e-6), (100 * KM, 22e-6), (1000 * KM, 2.2e-3)]
)
@pytest.mark.parametrize("azimuth", [0.0, 1.0, 2.5, 4.0])
def test_convergence_turns_true_directions_into_the_frame(origin, radius, tolerance, azimuth):
    frame = LocalFrame(*origin)
    latitude, longitude, _ = frame.to_geographic(*ring(radius, 16))
    convergence = frame.to_local(latitude, longitude)[2]
    east, north = rotate(np.sin(azimuth), np.cos(azimuth), convergence)
    dx, dy = frame_velocity_by_differences(frame, latitude, longitude, azimuth)
    off = np.arctan2(dx * north - dy * east, dx * east + dy * north)
    assert np.abs(off).max() < tolerance


def test_rotation_turns_back():
    east, north = rotate([1.0, np.nan], [2.0, 0.0], [0.3, 0.1])
    again = rotate(east, north, [-0.3, -0.1])
    assert again[0] == pytest.approx([1.0, np.nan], nan_ok=True)
    assert again[1] == pytest.approx([2.0, np.nan], nan_ok=True)


def test_a_track_across_the_seam_is_continuous():
    frame = LocalFrame(10.0, 179.9)
    longitude = np.linspace(179.5, 180.5, 2001)
    x, y, convergence = frame.to_local(np.full(2001, 10.0), (longitude + 180.0) % 360.0 - 180.0)
    assert np.diff(x) == pytest.approx(54.8, abs=0.1)
    assert np.ptp(np.diff(y, 2)) < 1e-6
    assert np.abs(np.diff(convergence)).max() < 1e-4


@pytest.mark.parametrize("latitude", [89.999, 90.0, -90.0])
def test_poles_are_finite_whether_origin_or_target(latitude):
    for frame in (LocalFrame(latitude, 20.0), LocalFrame(np.sign(latitude) * 89.99, -160.0)):
        columns = frame.to_local([latitude, latitude], [20.0, -100.0])
        assert np.isfinite(columns).all()
        assert np.isfinite(frame.to_geographic(columns[0], columns[1])).all()


def test_a_track_over_the_pole_is_straight():
    frame = LocalFrame(90.0, 0.0)
    step = np.linspace(-0.01, 0.01, 41)
    x, y, _ = frame.to_local(90.0 - np.abs(step), np.where(step < 0.0, -90.0, 90.0))
    assert np.abs(np.diff(x, 2)).max() < 1e-6
    assert np.abs(y).max() < 1e-6


def test_missing_and_impossible_positions_give_nan():
    frame = LocalFrame(36.7, -122.0)
    latitude = [np.nan, 36.7, 91.0, -90.001, np.inf, 36.7, 36.7]
    longitude = [-122.0, np.nan, -122.0, 0.0, 0.0, -np.inf, -122.0]
    columns = np.asarray(frame.to_local(latitude, longitude))
    assert np.isnan(columns[:, :6]).all()
    assert columns[:, 6] == pytest.approx(0.0)
    assert np.isnan(frame.to_geographic([np.nan, 0.0, np.inf], [0.0, np.nan, 1.0])).all()


def test_no_rows_give_no_rows():
    assert [part.size for part in LocalFrame(1.0, 2.0).to_local([], [])] == [0, 0, 0]
    assert [part.size for part in LocalFrame(1.0, 2.0).to_geographic([], [])] == [0, 0, 0]


def test_origin_is_robust_and_knows_the_seam():
    rng = np.random.default_rng(5)
    latitude = np.concatenate((-17.0 + rng.normal(0, 1e-3, 70), rng.uniform(-90, 90, 15)))
    longitude = np.concatenate((180.0 + rng.normal(0, 1e-3, 70), rng.uniform(-180, 180, 15)))
    zeros, bad = np.zeros(80), np.asarray([np.nan, 95.0, np.inf])
    frame = origin_of(
        np.concatenate((zeros, latitude, bad)), np.concatenate((zeros, longitude % 360.0, bad))
    )
    assert abs(frame.latitude_deg + 17.0) < 0.01
    assert 180.0 - abs(frame.longitude_deg) < 0.01


def test_origin_of_nothing_is_the_zero_point():
    assert origin_of([], []) == LocalFrame(0.0, 0.0)
    assert origin_of([np.nan, 0.0], [3.0, 0.0]) == LocalFrame(0.0, 0.0)
