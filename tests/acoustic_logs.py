"""Logs of a simulated ship with an acoustic positioning system, and the truth behind them."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator

from surefix.geo.local_frame import LocalFrame
from surefix.io.nmea import checksum

HOME = LocalFrame(57.0, 10.0)


def line(body: str) -> bytes:
    return b"$%s*%02X\r\n" % (body.encode(), checksum(body.encode()))


def clock(second: float) -> str:
    second %= 86400.0
    hours, rest = divmod(second, 3600.0)
    minutes, seconds = divmod(rest, 60.0)
    return f"{int(hours):02d}{int(minutes):02d}{seconds:06.3f}"


def angle(degrees: float, digits: int, sides: str) -> str:
    whole, part = divmod(abs(degrees), 1.0)
    return f"{int(whole):0{digits}d}{part * 60:010.7f},{sides[degrees < 0]}"


def ship(time: float) -> tuple[float, float, float]:
    """East and north m, heading deg: 2 m/s to the north-east, turning through north."""
    return 1.4 * time, 1.4 * time, (340.0 + 2.0 * time) % 360.0


def vehicle(time: float) -> tuple[float, float, float]:
    """East and north m, depth m."""
    return 30.0 + 0.5 * time, -80.0 + 0.2 * time, 100.0 + 0.1 * time


def on_earth(east: float, north: float) -> tuple[float, float]:
    latitude, longitude, _ = HOME.to_geographic(east, north)
    return float(latitude[0]), float(longitude[0])


def relative(time: float) -> tuple[float, float, float]:
    """The vehicle from the ship: starboard, ahead, depth m."""
    (x, y, heading), (east, north, depth) = ship(time), vehicle(time)
    turn, e, n = math.radians(heading), east - x, north - y
    return e * math.cos(turn) - n * math.sin(turn), e * math.sin(turn) + n * math.cos(turn), depth


def gga(time: float, start: float) -> bytes:
    latitude, longitude = on_earth(*ship(time)[:2])
    place = f"{angle(latitude, 2, 'NS')},{angle(longitude, 3, 'EW')}"
    return line(f"GPGGA,{clock(start + time)},{place},4,12,0.8,5.0,M,40.0,M,,")


def hdt(time: float) -> bytes:
    return line(f"HEHDT,{ship(time)[2]:.4f},T")


def ssb(time: float, start: float, name: str = "B01", status: str = "A,") -> bytes:
    starboard, ahead, depth = relative(time)
    place = f"C,H,M,{starboard:.4f},{ahead:.4f},{depth:.4f}"
    return line(f"PSIMSSB,{clock(start + time)},{name},{status},{place},0.75,N,,")


def dvl(told: float, measured: float, valid: bool = True, **values: object) -> bytes:
    beams = [
        {"id": k, "velocity": 0.00010825289791682735, "distance": 0.5568000078201294,
         "rssi": -30.494251251220703, "nsd": -88.73271179199219, "beam_valid": True}
        for k in range(4)
    ]  # fmt: skip
    covariance = [[2.4471841442164077e-08] * 3] * 3
    report = {
        "time": 106.3935775756836, "vx": 0.5, "vy": -0.1, "vz": 0.02, "fom": 0.004,
        "covariance": covariance, "altitude": 0.4949815273284912, "transducers": beams,
        "velocity_valid": valid, "status": 0, "format": "json_v3.1", "type": "velocity",
        "time_of_validity": round(measured * 1e6), "time_of_transmission": round(told * 1e6),
    }  # fmt: skip
    return json.dumps(report | values).encode() + b"\r\n"


def evologics(told: float, measured: float, east: float, north: float, up: float) -> bytes:
    body = (
        f"USBLLONG,{told:.6f},{measured:.6f},3,1.0,2.0,3.0,{east:.4f},{north:.4f},{up:.4f},"
        "0.0063,0.0269,-0.3295,825,-36,77,1.0375"
    )
    return f"+++AT:{len(body)}:{body}\r\n".encode()


def received(text: bytes, time: float) -> bytes:
    """A line with its time of reception in Unix seconds before it."""
    return b"%.3f %s" % (time, text)


def mission(day: float, start: float = 40_000.0, seconds: int = 60) -> Iterator[bytes]:
    """GGA at 1 Hz, HDT at 5 Hz, two transponders every 2 s, each line with its reception."""
    for tick in range(5 * seconds + 1):
        time = tick / 5
        at = day + start + time
        if tick % 5 == 0:
            yield received(gga(time, start), at)
        yield received(hdt(time), at)
        if tick % 10 == 2:
            yield received(ssb(time + 0.1, start), at + 0.15)
        if tick % 10 == 7 and tick > 100:
            yield received(ssb(time + 0.1, start, "B02"), at + 0.15)
