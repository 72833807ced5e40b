"""States of the filter in the axes, coordinates and words of the user."""

from __future__ import annotations

import functools
import platform
from dataclasses import fields
from importlib.metadata import version

import numpy as np

from surefix.filters.records import Estimate
from surefix.geo.local_frame import rotate
from surefix.pipelines.options import CleanOptions
from surefix.pipelines.setup import Setup
from surefix.types import Cleaned, FloatArray, IntArray, Track, Verdicts

__all__ = ["UNKNOWN", "nothing", "pick", "settings", "track_of"]

_VERSIONS = ("surefix", "numpy", "numba", "scipy", "pyproj", "pyarrow")
UNKNOWN = 1e5
"""m: a standard deviation from here on means that nothing is known."""


def track_of(setup: Setup, found: Estimate | None, time: FloatArray) -> Track:
    """Put states into the axes and coordinates of the input.

    Parameters
    ----------
    setup
        Frame, origin and axes.
    found
        Estimates of n epochs; None where no axis was observed.
    time
        (n,) s, for the output.
    """
    n, d = len(time), len(setup.axes)
    columns = [np.full((n, 3), np.nan) for _ in range(4)]
    for i, axis in enumerate(setup.axes if found is not None else ()):
        assert found is not None
        known = found.sigma[:, i] < UNKNOWN
        series = found.mean[:, i], found.mean[:, d + i], found.sigma[:, i], found.sigma[:, d + i]
        for column, values in zip(columns, series, strict=True):
            column[:, axis] = np.where(known, values, np.nan)
    position, velocity, sigma_position, sigma_velocity = columns
    geodetic = None
    if setup.frame is not None:
        latitude, longitude, convergence = setup.frame.to_geographic(position[:, 0], position[:, 1])
        geodetic = np.column_stack([latitude, longitude, position[:, 2]])
        velocity[:, 0], velocity[:, 1] = rotate(velocity[:, 0], velocity[:, 1], -convergence)
    return Track(time, position + setup.origin, velocity, sigma_position, sigma_velocity, geodetic)


def pick(track: Track, index: IntArray | slice) -> Track:
    """Pick epochs of a track."""
    return Track._make(None if column is None else column[index] for column in track)


def nothing(sensors: tuple[str, ...], options: CleanOptions, setup: Setup | None) -> Cleaned:
    """Make an empty result, for batches without fixes."""
    none, wide = np.empty(0), np.empty((0, 3))
    whole = np.empty(0, np.int64)
    geodetic = wide if setup is not None and setup.frame is not None else None
    return Cleaned(
        sources=(),
        sensors=sensors,
        track=Track(none, wide, wide, wide, wide, geodetic),
        verdicts=Verdicts(whole, none, none, wide, whole, none, wide),
        raw_position=wide,
        raw_coordinates=wide,
        sensor=whole,
        row=whole,
        has_depth=False,
        resampled=None,
        channels=(),
        noise=setup.noise if setup is not None else (),
        events=(),
        problems=(),
        settings=settings(options, setup),
    )


def settings(options: CleanOptions, setup: Setup | None) -> dict[str, str]:
    """Every option as it was used, in words; figures taken from the data are filled in."""
    used = {f.name: getattr(options, f.name) for f in fields(options)}
    if setup is not None:
        used["recovery_s"] = setup.recovery.after
        if options.mode == "lagged":
            used["lag_s"] = setup.lag
        used["interval_s"] = setup.interval
        used["model"] = setup.model
        if setup.frame is not None:
            used["origin"] = f"{setup.frame.latitude_deg:.7f}, {setup.frame.longitude_deg:.7f}"
    out = {
        name: f"{value:.6g}" if isinstance(value, float) else str(value)
        for name, value in used.items()
        if value is not None and value != {}
    }
    return out | _versions()


@functools.cache
def _versions() -> dict[str, str]:
    """Versions of what the figures depend on; looked up once, for that takes a while."""
    found = {name: version(name) for name in _VERSIONS}
    return {"python": platform.python_version(), **found}
