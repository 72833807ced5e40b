"""Which column of a table means what.

The contract: ``time`` (s or ISO 8601), then ``x, y, z`` (m, z up, one to three of them) or
``lat, lon`` with ``depth`` (positive down) or ``height``; optionally ``vx, vy, vz`` or
``ve, vn, vu`` (m/s), ``sensor``, ``sigma…``, ``edit``, ``valid``, and the scalar series ``depth``,
``heading``, ``roll``, ``pitch``, ``speed``, ``course``. Other names are recognised where only one
column can be meant: without regard to case, with the unit in the name (``time_ms``, ``depth [m]``,
``speed_kn``), and by the synonyms of `surefix.io.roles`. Where two columns compete for a required
role the answer is an error that names the remedy; for an optional role both are left out and a note
says so.

The user decides with ``role=[-]column[:unit]``:

======================================  ============================================
``time=lcm_timestamp:us``               Unix microseconds
``z=-depth``                            the sign turned round
``depth=-altitudeRelative:m``           both
``forward=DVL X [m/s]``                 a name with blanks, its unit in brackets
======================================  ============================================

Units: ``s ms us ns iso``; ``m km cm mm ft``; ``deg rad``; ``m/s kn km/h``. Without one, the unit in
the column's name counts, else s, m, deg, m/s; Unix times in s, ms, µs, ns are told apart by size.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from surefix.errors import OptionsError, ParseError
from surefix.io.match import Pick, Search, candidates, optional, required, search
from surefix.io.roles import CHANNELS
from surefix.types import Event

__all__ = ["Layout", "Picks", "Role", "mapping", "recognise"]

Role = Literal["fixes", "depth", "velocity", "heading", "attitude"]
Picks = tuple[Pick | None, Pick | None, Pick | None]

_NONE: Picks = (None, None, None)
_BODY = ("forward", "starboard", "down")
_TILT = ("roll", "pitch")
_BESIDE = ("depth", "heading", *_TILT, "course", "speed")


@dataclass(frozen=True, kw_only=True)
class Layout:
    """Where everything in a table is.

    ``position`` holds latitude, longitude, height when ``geographic``, else x, y, z (m);
    ``velocity`` and the sigmas are always east, north, up. ``date`` goes before a bare time of day.
    ``channels`` are name, period, column.
    """

    time: Pick
    date: Pick | None = None
    position: Picks = _NONE
    velocity: Picks = _NONE
    sigma_position: Picks = _NONE
    sigma_velocity: Picks = _NONE
    sensor: Pick | None = None
    edit: Pick | None = None
    valid: Pick | None = None
    channels: tuple[tuple[str, float, Pick], ...] = ()
    geographic: bool = False
    depth_positive_down: bool = False
    notes: tuple[Event, ...] = ()

    @property
    def has_fixes(self) -> bool:
        """Whether records are fixes, or only values of scalar series."""
        return any(self.position) or any(self.velocity)

    def columns(self) -> tuple[int, ...]:
        """Return every column that is read, in the order of the file."""
        single = (self.time, self.date, self.sensor, self.edit, self.valid)
        axes = (*self.position, *self.velocity, *self.sigma_position, *self.sigma_velocity)
        every = (*single, *axes, *(pick for _, _, pick in self.channels))
        return tuple(sorted({pick.column for pick in every if pick is not None}))


def mapping(entries: Iterable[str]) -> dict[str, str]:
    """Split the ``role=column`` texts of the command line.

    >>> mapping(["time=lcm_timestamp:us", "z=-depth"])
    {'time': 'lcm_timestamp:us', 'z': '-depth'}

    Raises
    ------
    OptionsError
        A text is not of that form.
    """
    roles: dict[str, str] = {}
    for entry in entries:
        role, _, column = (part.strip() for part in entry.partition("="))
        if not role or not column:
            raise OptionsError(
                f"--column {entry}", "role=column[:unit]", "for example --column time=stamp:us"
            )
        roles[role] = column
    return roles


def recognise(
    names: Sequence[str],
    *,
    chosen: Mapping[str, str],
    role: Role = "fixes",
    source: str,
    first: Sequence[str] = (),
) -> Layout:
    """Find the columns of a table.

    Parameters
    ----------
    names
        Column names as they stand.
    chosen
        The user's mapping, role → ``[-]column[:unit]``.
    role
        What the table is read for.
    source
        Its name, for messages.
    first
        The first record as text; it tells which unit of time a remedy should propose.

    Raises
    ------
    ParseError
        A required column is missing, two compete for it, or a mapped one is not there.
    OptionsError
        The mapping names an unknown role or unit.
    """
    seek = search(names, chosen, source, first)
    time = required(seek, "time")
    match role:
        case "fixes":
            return _fixes(seek, time)
        case "velocity" if any(optional(seek, name) for name in _BODY[:2]):
            return _series(seek, time, _BODY[:2], _BODY[2:])
        case "velocity":
            return _velocities(seek, time)
        case "heading":
            return _series(seek, time, (role,), _TILT)
        case "attitude":
            return _series(seek, time, _TILT, ("heading",))
        case _:
            return _series(seek, time, (role,))


def _fixes(seek: Search, time: Pick) -> Layout:
    geographic = _is_geographic(seek)
    position, down = _geographic(seek) if geographic else _metric(seek)
    if not any(position):
        raise _no_position(seek)
    return Layout(
        time=time,
        date=optional(seek, "date"),
        position=position,
        velocity=_velocity(seek),
        sigma_position=_sigmas(seek, "sigma_x sigma_y sigma_z", "sigma_position", "sigma"),
        sigma_velocity=_sigmas(seek, "sigma_vx sigma_vy sigma_vz", "sigma_velocity"),
        sensor=optional(seek, "sensor"),
        edit=optional(seek, "edit"),
        valid=optional(seek, "valid"),
        channels=_channels(seek, _BESIDE[1:] if down else _BESIDE),
        geographic=geographic,
        depth_positive_down=down,
        notes=tuple(seek.notes),
    )


def _series(seek: Search, time: Pick, needed: Sequence[str], more: Sequence[str] = ()) -> Layout:
    for name in needed:
        required(seek, name)
    return Layout(
        time=time,
        date=optional(seek, "date"),
        channels=_channels(seek, [*needed, *more]),
        valid=optional(seek, "valid"),
        notes=tuple(seek.notes),
    )


def _velocities(seek: Search, time: Pick) -> Layout:
    velocity = _velocity(seek)
    if velocity[0] is None or velocity[1] is None:
        raise ParseError(
            f"{seek.source}: no velocity columns; there are {seek.listed()}",
            "ve, vn, vu (or vx, vy, vz) in the earth frame, or forward, starboard, down",
            "say which they are: --column ve=NAME --column vn=NAME, or"
            " --column forward=NAME --column starboard=NAME",
        )
    return Layout(
        time=time,
        date=optional(seek, "date"),
        velocity=velocity,
        sigma_velocity=_sigmas(seek, "sigma_vx sigma_vy sigma_vz", "sigma_velocity"),
        sensor=optional(seek, "sensor"),
        edit=optional(seek, "edit"),
        valid=optional(seek, "valid"),
        notes=tuple(seek.notes),
    )


def _is_geographic(seek: Search) -> bool:
    if seek.chosen.keys() & {"lat", "lon"}:
        return True
    if seek.chosen.keys() & {"x", "y"}:
        return False
    both = bool(candidates(seek, "lat") and candidates(seek, "lon"))
    if both and (candidates(seek, "x") or candidates(seek, "y")):
        seek.note(
            "the position was read from latitude and longitude; to read x and y instead, say"
            " --column x=NAME --column y=NAME"
        )
    return both


def _geographic(seek: Search) -> tuple[Picks, bool]:
    lat, lon = required(seek, "lat"), required(seek, "lon")
    up, down = _vertical(seek, ("depth", "height", "z"))
    return (lat, lon, up), down


def _metric(seek: Search) -> tuple[Picks, bool]:
    x, y = (
        required(seek, role) if role in seek.chosen or candidates(seek, role) else None
        for role in ("x", "y")
    )
    alone = x is None and y is None
    up, down = _vertical(seek, ("z",) if alone else ("z", "depth", "height"))
    return (x, y, up), down


def _vertical(seek: Search, roles: Sequence[str]) -> tuple[Pick | None, bool]:
    """Find the third axis (up), and whether it was given as a depth; the user's choice first."""
    for role in sorted(roles, key=lambda name: name not in seek.chosen):
        if pick := optional(seek, role):
            down = role == "depth"
            return (pick._replace(factor=-pick.factor) if down else pick), down
    return None, False


def _velocity(seek: Search) -> Picks:
    up, down = optional(seek, "vz"), optional(seek, "vd")
    if up is None and down is not None:
        up = down._replace(factor=-down.factor)
    return optional(seek, "vx"), optional(seek, "vy"), up


def _sigmas(seek: Search, axes: str, *common: str) -> Picks:
    """Find one column per axis; the common one stands in where an axis has none of its own."""
    shared = next((pick for role in common if (pick := optional(seek, role))), None)
    x, y, z = (optional(seek, axis) or shared for axis in axes.split())
    return x, y, z


def _channels(seek: Search, roles: Iterable[str]) -> tuple[tuple[str, float, Pick], ...]:
    found = ((role, optional(seek, role)) for role in roles)
    return tuple((*CHANNELS[role], pick) for role, pick in found if pick is not None)


def _no_position(seek: Search) -> ParseError:
    return ParseError(
        f"{seek.source}: no position columns; there are {seek.listed()}",
        "x, y, z in m, or lat, lon in degrees",
        "say which they are: --column lat=NAME --column lon=NAME, or --column x=NAME"
        " --column y=NAME; a depth alone is read by --depth FILE or with --column z=-depth",
    )
