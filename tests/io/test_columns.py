from __future__ import annotations

import math

import pytest

from surefix.errors import OptionsError, ParseError
from surefix.io.columns import Layout, Role, mapping, recognise


def layout(names: str, role: Role = "fixes", first: str = "", **chosen: str) -> Layout:
    return recognise(
        names.split(","), chosen=chosen, role=role, source="log.csv", first=first.split(",")
    )


def columns(found: Layout) -> tuple[int | None, ...]:
    return tuple(pick and pick.column for pick in found.position)


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        ("time,x,y,z", (1, 2, 3)),
        ("z,time", (None, None, 0)),
        ("time,x", (1, None, None)),
        ("TIME,Easting,Northing", (1, 2, None)),
        ("t_s,X [m],Y (m)", (1, 2, None)),
        ("timestamp,lat,lon", (1, 2, None)),
        ("timestamp,lng,Latitude,altitude", (2, 1, 3)),
        ("Timestamp,flightTime,gps.lat,gps.lon,gps2.lat,gps2.lon", (2, 3, None)),
        ("utc,nav.lat,nav.lon,depth", (1, 2, 3)),
        ("time,x,y,lat,lon,height", (3, 4, 5)),
    ],
)
def test_recognises_positions(names: str, expected: tuple[int | None, ...]) -> None:
    assert columns(layout(names)) == expected


def test_units_in_names_become_factors() -> None:
    found = layout("time_ms,lat_rad,lon_rad,depth [ft],ve_kn,vn_kn,speed_kmh,heading_rad")
    assert found.time.unit == "ms"
    assert found.position[0] is not None
    assert found.position[0].factor == pytest.approx(180 / math.pi)
    assert found.position[2] is not None
    assert found.position[2].factor == pytest.approx(-0.3048)
    assert found.depth_positive_down
    assert found.velocity[0] is not None
    assert found.velocity[0].factor == pytest.approx(0.514444, abs=1e-6)
    assert [(name, period) for name, period, _ in found.channels] == [
        ("heading_deg", 360.0),
        ("speed_mps", 0.0),
    ]


def test_competing_times_are_an_error_with_the_remedy() -> None:
    with pytest.raises(ParseError) as caught:
        layout("lcm_timestamp,sensor_timestamp,lat,lon", first="1699643598720397,1,2,3")
    assert "lcm_timestamp and sensor_timestamp" in str(caught.value)
    assert "--column time=lcm_timestamp:us" in str(caught.value)


def test_competing_optional_columns_are_left_out_with_a_note() -> None:
    found = layout("time,lat,lon,altitudeRelative,altitudeAMSL")
    assert columns(found) == (1, 2, None)
    assert "altitudeRelative and altitudeAMSL" in found.notes[0].text
    assert "--column height=altitudeRelative" in found.notes[0].text


def test_depth_beside_a_vertical_axis_is_a_channel() -> None:
    found = layout("time,x,y,z,depth")
    assert columns(found) == (1, 2, 3)
    assert not found.depth_positive_down
    assert found.channels[0][0] == "depth_m"


def test_depth_beats_an_altitude_that_may_be_above_the_seabed() -> None:
    found = layout("time,lat,lon,altitude,depth")
    assert columns(found) == (1, 2, 4)
    assert found.channels == ()


def test_speed_of_unknown_unit_is_not_read() -> None:
    found = layout("time,lat,lon,sog")
    assert found.channels == ()
    assert "--column speed=sog:UNIT" in found.notes[0].text
    assert layout("time,lat,lon,sog_kn").channels[0][2].factor == pytest.approx(0.5144, abs=1e-4)


def test_down_velocity_is_turned_round() -> None:
    found = layout("time,V North [m/s],V East [m/s],V Down [m/s]", role="velocity")
    assert [pick and (pick.column, pick.factor) for pick in found.velocity] == [
        (2, 1.0),
        (1, 1.0),
        (3, -1.0),
    ]


def test_sigma_of_one_axis_beats_the_common_one() -> None:
    found = layout("time,x,y,z,sigma,sigma_z,sigma_velocity")
    assert [pick and pick.column for pick in found.sigma_position] == [4, 4, 5]
    assert [pick and pick.column for pick in found.sigma_velocity] == [6, 6, 6]


def test_sigmas_of_latitude_and_longitude_are_north_and_east() -> None:
    found = layout("time,lat,lon,sigma_lat,sigma_lon")
    assert [pick and pick.column for pick in found.sigma_position] == [4, 3, None]


def test_mapping_with_sign_unit_and_awkward_names() -> None:
    found = layout("a:b,x,y,-d", time="a:b:ms", z="--d:cm")
    assert (found.time.column, found.time.unit) == (0, "ms")
    assert found.position[2] is not None
    assert found.position[2].factor == pytest.approx(-0.01)
    plain = layout("a,x,y,altitudeRelative", time="a", depth="-altitudeRelative:m")
    assert plain.position[2] is not None
    assert plain.position[2].factor == 1.0
    assert plain.depth_positive_down


def test_mapping_uses_the_unit_in_the_name() -> None:
    found = layout(
        "t,DVL X [m/s],DVL Y [km/h]", "velocity", forward="DVL X [m/s]", starboard="DVL Y [km/h]"
    )
    assert [pick.factor for _, _, pick in found.channels] == pytest.approx([1.0, 1 / 3.6])


@pytest.mark.parametrize(
    ("names", "chosen", "error", "said"),
    [
        ("time,x,y", {"z": "depth"}, ParseError, "no column depth"),
        ("time,x,y", {"zz": "x"}, OptionsError, "zz is not a role"),
        ("time,x,y", {"x": "x:kn"}, OptionsError, "m km cm mm ft"),
        ("x,y", {}, ParseError, "no time column"),
        ("time,foo", {}, ParseError, "no position columns"),
        ("time,lat,latitude,lon", {}, ParseError, "lat and latitude"),
        ("time,x,easting", {}, ParseError, "x and easting"),
        ("time,x (px),y", {}, ParseError, "unit of x (px)"),
        ("time,depth,pressure", {}, ParseError, "--depth FILE"),
    ],
)
def test_unclear_columns_are_errors_that_teach(
    names: str, chosen: dict[str, str], error: type[Exception], said: str
) -> None:
    with pytest.raises(error) as caught:
        layout(names, **chosen)
    assert said in str(caught.value)


def test_body_velocities_are_channels() -> None:
    found = layout("time,forward,starboard,down", role="velocity")
    assert [name for name, _, _ in found.channels] == ["forward_mps", "starboard_mps", "down_mps"]
    assert not found.has_fixes


def test_mapping_texts() -> None:
    assert mapping(["time = a=b", "z=-d"]) == {"time": "a=b", "z": "-d"}
    with pytest.raises(OptionsError):
        mapping(["time"])
