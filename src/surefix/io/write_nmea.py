"""NMEA 0183 output: GGA, RMC, VTG, GST, HDT and DPT of an epoch, at most 82 characters each.

`sentences` is pure: the file and the live service write what it gives. Layouts after the published
NMEA 0183 descriptions (gpsd, "NMEA Revealed"), mode indicators of version 2.3. An epoch that no fix
supports says so: quality 0 in GGA, status V in RMC, mode E (estimated) or, without any position, N.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Iterator
from datetime import UTC, datetime
from typing import BinaryIO, NamedTuple

import numpy as np

from surefix.errors import OptionsError
from surefix.io.nmea import checksum
from surefix.io.records import Batch, Form, believed
from surefix.types import BoolArray

__all__ = ["LONGEST", "TALKER", "TYPES", "Epoch", "nmea_sink", "sentences"]

LONGEST = 82
"""Characters of a sentence at most, CR and LF included, as the standard has it."""
TALKER = "IN"
"""Integrated navigation: who speaks in what is written, unless another talker is given."""
TYPES = ("GGA", "RMC", "VTG", "GST", "HDT", "DPT")
"""Sentence types that are written, in this order, unless others are asked for."""

_KNOT = 1852.0 / 3600.0
_DAY = 8_640_000  # hundredths of a second
_MINUTE = 1_000_000  # steps of a minute of arc that are written
_YEARS = 315_532_800, 3_471_292_800  # Unix s, 1980 up to 2080
_LATEST = 1e12  # s; an instant beyond it is none
_MOST_M = 99_999.99


class Epoch(NamedTuple):
    """What is known at one instant; NaN for what is not.

    Parameters
    ----------
    time
        s, Unix UTC; before 1980 only the time of day is written.
    latitude, longitude
        deg, WGS-84.
    height
        m above mean sea level.
    east, north
        m/s, true directions.
    sigma_east, sigma_north, sigma_up
        m, standard deviations of the position.
    covariance
        m², of the errors east and north.
    heading
        deg, true.
    depth
        m, positive down.
    known
        Whether a fix supports the position. False is dead reckoning.
    """

    time: float
    latitude: float = math.nan
    longitude: float = math.nan
    height: float = math.nan
    east: float = math.nan
    north: float = math.nan
    sigma_east: float = math.nan
    sigma_north: float = math.nan
    sigma_up: float = math.nan
    covariance: float = math.nan
    heading: float = math.nan
    depth: float = math.nan
    known: bool = True


def sentences(epoch: Epoch, *, talker: str = TALKER, types: tuple[str, ...] = TYPES) -> bytes:
    r"""Sentences of one epoch, each with its checksum, CR and LF; nothing for one without a time.

    GST, HDT and DPT are left out where there is nothing to say; GGA, RMC and VTG then have empty
    fields. The horizontal ellipse of GST needs the covariance.

    Parameters
    ----------
    epoch
        What is known.
    talker
        Two letters.
    types
        Which are wanted, of `TYPES` and ``GBS``, the expected errors that gpsd takes for its own.

    Raises
    ------
    OptionsError
        The talker is not two capital letters or digits, or a type is not known.

    Examples
    --------
    >>> sentences(Epoch(1406851200.0, heading=218.53), types=("HDT",))
    b'$INHDT,218.53,T*18\r\n'
    """
    if len(talker) != 2 or not (talker.isascii() and talker.isalnum() and talker.isupper()):
        raise OptionsError(f"talker {talker!r}", "two capital letters, such as IN or GP")
    unknown = [name for name in types if name not in _BODIES]
    if unknown:
        raise OptionsError(f"sentence type {unknown[0]!r}", "one of " + ", ".join(_BODIES))
    if not abs(epoch.time) < _LATEST:
        return b""
    bodies = (_BODIES[name](epoch) for name in _BODIES if name in types)
    return b"".join(_sealed(talker + body) for body in bodies if body)


def _sealed(body: str) -> bytes:
    text = body.encode("ascii")
    return b"$%s*%02X\r\n" % (text, checksum(text))


def _gga(epoch: Epoch) -> str:
    quality = "1" if epoch.known and _somewhere(epoch) else "0"
    height = _number(epoch.height, 2)
    return f"GGA,{_time(epoch)},{_place(epoch)},{quality},,,{height},M,,M,,"


def _rmc(epoch: Epoch) -> str:
    mode = _mode(epoch)
    status = "A" if mode == "A" else "V"
    speed, course = _motion(epoch)
    knots = _number(speed / _KNOT, 2)
    return f"RMC,{_time(epoch)},{status},{_place(epoch)},{knots},{course},{_date(epoch)},,,{mode}"


def _vtg(epoch: Epoch) -> str:
    speed, course = _motion(epoch)
    mode = _mode(epoch) if math.isfinite(speed) else "N"
    knots, kmh = _number(speed / _KNOT, 2), _number(speed * 3.6, 2)
    return f"VTG,{course},T,,M,{knots},N,{kmh},K,{mode}"


def _gst(epoch: Epoch) -> str:
    sigmas = _sigmas(epoch)
    return f"GST,{_time(epoch)},,{_ellipse(epoch)},{sigmas}" if sigmas else ""


def _gbs(epoch: Epoch) -> str:
    sigmas = _sigmas(epoch)
    return f"GBS,{_time(epoch)},{sigmas},,,," if sigmas else ""


def _hdt(epoch: Epoch) -> str:
    return f"HDT,{_angle(epoch.heading)},T" if math.isfinite(epoch.heading) else ""


def _dpt(epoch: Epoch) -> str:
    if not math.isfinite(epoch.depth) or epoch.depth < 0.0:
        return ""
    return f"DPT,{_number(epoch.depth, 2)},0.0"


_BODIES: dict[str, Callable[[Epoch], str]] = {
    "GGA": _gga, "RMC": _rmc, "VTG": _vtg, "GST": _gst, "HDT": _hdt, "DPT": _dpt,
    "GBS": _gbs,
}  # fmt: skip


def _somewhere(epoch: Epoch) -> bool:
    return abs(epoch.latitude) <= 90.0 and math.isfinite(epoch.longitude)


def _mode(epoch: Epoch) -> str:
    """A with a fix, E without one, N without a position."""
    if not _somewhere(epoch):
        return "N"
    return "A" if epoch.known else "E"


def _ticks(epoch: Epoch) -> int:
    """Hundredths of a second; rounded once, so that time and date turn together."""
    return round(epoch.time * 100.0)


def _time(epoch: Epoch) -> str:
    ticks = _ticks(epoch) % _DAY
    minutes, rest = divmod(ticks, 6000)
    return f"{minutes // 60:02d}{minutes % 60:02d}{rest // 100:02d}.{rest % 100:02d}"


def _date(epoch: Epoch) -> str:
    """``ddmmyy``; empty where its two figures would not tell the year."""
    if not _YEARS[0] <= _ticks(epoch) // 100 < _YEARS[1]:
        return ""
    return datetime.fromtimestamp(_ticks(epoch) // 100, UTC).strftime("%d%m%y")


def _place(epoch: Epoch) -> str:
    if not _somewhere(epoch):
        return ",,,"
    longitude = math.remainder(epoch.longitude, 360.0)
    return f"{_degrees(epoch.latitude, 2, 'NS')},{_degrees(longitude, 3, 'EW')}"


def _degrees(value: float, digits: int, sides: str) -> str:
    """``ddmm.mmmmmm,N``: rounded in whole steps, so that there are never 60 minutes."""
    steps = round(abs(value) * 60 * _MINUTE)
    degrees, rest = divmod(steps, 60 * _MINUTE)
    side = sides[value < 0.0 and steps > 0]
    return f"{degrees:0{digits}d}{rest // _MINUTE:02d}.{rest % _MINUTE:06d},{side}"


def _motion(epoch: Epoch) -> tuple[float, str]:
    """Speed m/s and course; no course for one that is too slow to be written."""
    speed = math.hypot(epoch.east, epoch.north)
    if not math.isfinite(speed) or speed / _KNOT < 0.005:
        return speed, ""
    return speed, _angle(math.degrees(math.atan2(epoch.east, epoch.north)))


def _angle(degrees: float) -> str:
    """0.00 to 359.99."""
    hundredths = round(math.fmod(degrees, 360.0) * 100.0) % 36_000
    return f"{hundredths // 100}.{hundredths % 100:02d}"


def _sigmas(epoch: Epoch) -> str:
    """Standard deviations of latitude, longitude and height; empty if there are none."""
    texts = [_size(value) for value in (epoch.sigma_north, epoch.sigma_east, epoch.sigma_up)]
    return ",".join(texts) if any(texts) else ""


def _ellipse(epoch: Epoch) -> str:
    """Semi-major and semi-minor axis m, and the azimuth of the major one, deg true."""
    east, north, r = epoch.sigma_east, epoch.sigma_north, epoch.covariance
    p, q = east * east, north * north
    if not (math.isfinite(p + q + r) and r * r <= p * q):
        return ",,"
    half, spread = (p + q) / 2.0, math.hypot((q - p) / 2.0, r)
    major, minor = math.sqrt(half + spread), math.sqrt(max(half - spread, 0.0))
    turn = math.degrees(0.5 * math.atan2(2.0 * r, q - p)) % 180.0
    return f"{_size(major)},{_size(minor)},{_number(turn, 1)}"


def _size(value: float) -> str:
    return _number(value, 3) if value >= 0.0 else ""


def _number(value: float, decimals: int) -> str:
    """Text of a number; empty for one that is not there or absurdly large."""
    if not math.isfinite(value) or abs(value) > _MOST_M:
        return ""
    text = f"{value:.{decimals}f}"
    return text.removeprefix("-") if float(text) == 0.0 else text


@contextlib.contextmanager
def nmea_sink(file: BinaryIO, form: Form) -> Iterator[Callable[[Batch], None]]:
    """Write batches of a track to an open file: one group of sentences per instant."""
    sink = _Sink(file, form.has_depth)
    yield sink.add
    sink.close()


class _Sink:
    """The epoch that may still be superseded by another of the same instant."""

    def __init__(self, file: BinaryIO, has_depth: bool) -> None:
        self._file, self._has_depth = file, has_depth
        self._held: Epoch | None = None

    def add(self, batch: Batch) -> None:
        """Write the epochs of one batch."""
        for epoch in _epochs(batch, self._has_depth):
            self._take(epoch)

    def close(self) -> None:
        """Write the last epoch."""
        if self._held is not None:
            self._file.write(sentences(self._held))

    def _take(self, epoch: Epoch) -> None:
        held = self._held
        if not math.isfinite(epoch.time):
            return
        if held is not None and _ticks(epoch) <= _ticks(held):
            if not _somewhere(epoch):
                return  # a fix that came too late: the track has passed
            if _ticks(epoch) == _ticks(held):
                self._held = epoch if epoch.known or not held.known else held
                return
        self.close()
        self._held = epoch


def _epochs(batch: Batch, has_depth: bool) -> Iterator[Epoch]:
    track = batch.track
    if track.geodetic is None:
        return
    columns = [track.geodetic, track.velocity[:, :2], track.sigma_position]
    known = _known(batch)
    for time, there, values in zip(
        track.time.tolist(), known.tolist(), np.hstack(columns).tolist(), strict=True
    ):
        epoch = Epoch(time, *values)._replace(known=there)
        yield epoch._replace(depth=-epoch.height) if has_depth else epoch


def _known(batch: Batch) -> BoolArray:
    """Whether a fix that was believed supports each epoch."""
    if batch.known is not None:
        return batch.known
    if batch.verdicts is None:
        return np.ones(len(batch.track.time), np.bool_)
    return believed(batch.verdicts)
