"""The roles a column can have, and the names it is recognised by."""

from __future__ import annotations

from typing import Final, NamedTuple

from surefix.io.units import Dimension

__all__ = ["ALIASES", "CHANNELS", "NEEDS_UNIT", "ROLES", "UNITS", "Names"]


class Names(NamedTuple):
    """How one role is recognised.

    Parameters
    ----------
    dimension
        What its values measure.
    tiers
        Names in groups of falling trust: a group counts only where none before it is met. A ``*``
        stands for anything in front.
    """

    dimension: Dimension
    tiers: tuple[tuple[str, ...], ...]


def _names(dimension: Dimension, *tiers: str) -> Names:
    return Names(dimension, tuple(tuple(tier.split()) for tier in tiers))


ROLES: Final = {
    "time": _names(
        "time",
        "time t timestamp time_stamp utc datetime date_time time_utc utc_time timestamp_utc"
        " utc_timestamp unix_time unixtime epoch epoch_time",
        "*.time *.timestamp",
        "*_timestamp *_time",
    ),
    "date": _names("text", "date utc_date date_utc"),
    "lat": _names("angle", "lat latitude", "gps.lat", "*.lat *.latitude"),
    "lon": _names("angle", "lon longitude lng long", "gps.lon", "*.lon *.longitude *.lng"),
    "height": _names(
        "length",
        "height altitude alt elevation ele ellipsoidal_height orthometric_height"
        " altitude_relative altitude_amsl altitude_msl height_msl",
    ),
    "depth": _names("length", "depth"),
    "x": _names("length", "x east easting pos_x position_x"),
    "y": _names("length", "y north northing pos_y position_y"),
    "z": _names("length", "z up pos_z position_z"),
    "vx": _names("speed", "vx ve v_e vel_x vel_e v_east vel_east velocity_x velocity_east"),
    "vy": _names("speed", "vy vn v_n vel_y vel_n v_north vel_north velocity_y velocity_north"),
    "vz": _names("speed", "vz vu v_u vel_z vel_u v_up vel_up velocity_z velocity_up"),
    "vd": _names("speed", "vd v_d vel_d v_down vel_down velocity_down"),
    "forward": _names("speed", "forward surge v_forward vel_forward velocity_forward"),
    "starboard": _names("speed", "starboard sway v_starboard vel_starboard velocity_starboard"),
    "down": _names("speed", "down heave"),
    "sensor": _names("text", "sensor"),
    "edit": _names("text", "edit"),
    "valid": _names("text", "position_valid", "valid", "status"),
    "sigma": _names("length", "sigma"),
    "sigma_position": _names("length", "sigma_position sigma_pos"),
    "sigma_x": _names("length", "sigma_x sigma_lon sigma_east"),
    "sigma_y": _names("length", "sigma_y sigma_lat sigma_north"),
    "sigma_z": _names("length", "sigma_z sigma_depth sigma_height sigma_up"),
    "sigma_velocity": _names("speed", "sigma_velocity sigma_vel sigma_v"),
    "sigma_vx": _names("speed", "sigma_vx sigma_ve"),
    "sigma_vy": _names("speed", "sigma_vy sigma_vn"),
    "sigma_vz": _names("speed", "sigma_vz sigma_vu"),
    "heading": _names("angle", "heading hdg true_heading heading_true"),
    "roll": _names("angle", "roll roll_angle"),
    "pitch": _names("angle", "pitch pitch_angle"),
    "course": _names("angle", "course cog course_over_ground"),
    "speed": _names("speed", "speed ground_speed sog speed_over_ground"),
}

ALIASES: Final = {
    "ve": "vx",
    "vn": "vy",
    "vu": "vz",
    "sigma_lon": "sigma_x",
    "sigma_lat": "sigma_y",
    "sigma_depth": "sigma_z",
    "sigma_height": "sigma_z",
    "sigma_ve": "sigma_vx",
    "sigma_vn": "sigma_vy",
    "sigma_vu": "sigma_vz",
}

NEEDS_UNIT: Final = ("sog", "speed_over_ground")
"""Names whose unit differs from maker to maker: read only where it is written beside them."""

CHANNELS: Final = {
    "depth": ("depth_m", 0.0),
    "heading": ("heading_deg", 360.0),
    "roll": ("roll_deg", 0.0),
    "pitch": ("pitch_deg", 0.0),
    "course": ("course_deg", 360.0),
    "speed": ("speed_mps", 0.0),
    "forward": ("forward_mps", 0.0),
    "starboard": ("starboard_mps", 0.0),
    "down": ("down_mps", 0.0),
}
"""Scalar series by role: name and period."""

UNITS: Final[dict[Dimension, str]] = {
    "time": "s ms us ns iso",
    "length": "m km cm mm ft",
    "angle": "deg rad",
    "speed": "m/s kn km/h",
    "text": "text",
}
