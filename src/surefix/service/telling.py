"""What goes out of what is known."""

from __future__ import annotations

from surefix.io.write_nmea import Epoch
from surefix.service.station import Latest

__all__ = ["epoch_of"]


def epoch_of(known: Latest) -> Epoch:
    """Bring what is known to the form that sentences are written from.

    Without latitude and longitude, as in a metric log, no position goes out.
    """
    if known.geodetic is None:
        return Epoch(known.time, heading=known.heading, depth=known.depth, known=False)
    latitude, longitude, height = known.geodetic
    east, north, _ = known.velocity
    sigma_east, sigma_north, sigma_up = known.sigma_position
    return Epoch(
        time=known.time,
        latitude=float(latitude),
        longitude=float(longitude),
        height=float(height),
        east=float(east),
        north=float(north),
        sigma_east=float(sigma_east),
        sigma_north=float(sigma_north),
        sigma_up=float(sigma_up),
        heading=known.heading,
        depth=known.depth,
        known=not known.dead_reckoned,
    )
