"""The date that goes with the bare times of day of an NMEA log."""

from __future__ import annotations

import re
from dataclasses import dataclass
from math import isnan, nan

from surefix.geo.time import (
    DAY,
    GPS_ROLLOVER,
    nearest_day,
    parse_time,
    unix_seconds,
    week_rollovers,
)

__all__ = ["LogClock", "receive_time"]

_NUMBER = re.compile(r"\d{9,19}(?:\.\d{1,9})?", re.ASCII)
_TAG_BLOCK = re.compile(r"\\(?:[^\\]*,)?c:(\d{9,16})[,*][^\\]*\\", re.ASCII)
_AROUND = " \t\0,;|[]()<>\"'"


def receive_time(prefix: bytes) -> float:
    r"""Instant at which a line was received, from what stands before its sentence.

    Calendar text, Unix seconds (or ms, µs, ns) or the ``c:`` of a tag block; NaN for anything else.

    >>> receive_time(b"2014-08-01T00:00:00.25Z "), receive_time(b"1406851200250,")
    (1406851200.25, 1406851200.25)
    >>> receive_time(rb"\s:GN01,c:1406851200*0F\ ")
    1406851200.0
    """
    text = prefix.decode("ascii", "replace").strip(_AROUND)
    if text[4:5] == "-":
        return parse_time(text)
    block = _TAG_BLOCK.fullmatch(text)
    number = block[1] if block else text
    if _NUMBER.fullmatch(number):
        return float(unix_seconds(float(number)))
    return parse_time(text)


@dataclass(slots=True)
class LogClock:
    """Turns times of day into instants, sentence by sentence.

    Parameters
    ----------
    receive
        s, when the present line was received; NaN if it does not say.
    latest
        s, the instant of the latest sentence with a time.
    dated
        False as long as no date has been met: times then count from midnight of the first day.
    settled
        True once undated times have been given out: a later date no longer changes the count.
    shift
        s to add to the times given before, once the first date has come.
    rollovers
        1024-week periods by which the dates of this log are behind.
    """

    receive: float = nan
    latest: float = nan
    dated: bool = False
    settled: bool = False
    shift: float = 0.0
    rollovers: int = 0

    def now(self) -> float:
        """Instant of a sentence that has no time of its own."""
        return self.latest if isnan(self.receive) else self.receive

    def at(self, second: float, day: int | None) -> float:
        """Instant of a time of day (NaN: none), with the date that came with it, if any.

        The date is the one nearest to the time of reception; without that, the sentence's own;
        without that, the one nearest to the sentence before.
        """
        if isnan(second):
            return self.now()
        if not isnan(self.receive):
            time = nearest_day(second, self.receive)
            if day is not None and abs(day * DAY + second - time) > DAY:
                self.rollovers = week_rollovers(day * DAY + second, time) or self.rollovers
            self._date(time)
        elif day is not None and not self.settled:
            time = day * DAY + second + self.rollovers * GPS_ROLLOVER
            self._date(time)
        elif not isnan(self.latest):
            time = nearest_day(second, self.latest)
        else:
            time = second
        self.latest = time
        return time

    def settle(self) -> None:
        """Times so far have been given out: if they had no date, none shall have one."""
        self.settled = not isnan(self.latest) and not self.dated

    def _date(self, time: float) -> None:
        if not self.dated and not isnan(self.latest):
            self.shift = time - nearest_day(time % DAY, self.latest)
        self.dated = True
