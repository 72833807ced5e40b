"""Rows of a log as epochs of the filter, and what is known of them before it runs."""

from __future__ import annotations

import numpy as np

from surefix.cleaning.duplicates import Repeats
from surefix.filters.hypotheses import MOST_SENSORS
from surefix.filters.records import Epochs
from surefix.pipelines.judge import Status, blank_status
from surefix.pipelines.rows import Rows
from surefix.pipelines.setup import Setup
from surefix.types import BoolArray, Edit, FloatArray, IntArray, Reason, Verdict

__all__ = ["epochs_of", "grid_times", "padded", "status_of", "steady"]

_LONGEST = 60.0  # s: no resampled rows within longer gaps …
_GAP_INTERVALS = 20.0  # … if they are longer than so many intervals too


def steady(tau: FloatArray, last: float) -> FloatArray:
    """Filter time of every row: rows without a time, or late ones, take that of the row before.

    ``last`` is the filter time of the batch before, −∞ at the beginning.
    """
    filled = np.maximum.accumulate(np.where(np.isfinite(tau), tau, last))
    finite = filled[np.isfinite(filled)]
    return np.where(np.isfinite(filled), filled, finite[0] if len(finite) else 0.0)


def status_of(rows: Rows, repeats: Repeats, *, held: bool) -> Status:
    """Verdicts that no filter is needed for."""
    fixes = rows.fixes
    status = blank_status(len(rows.tau))
    status.mark(~np.isfinite(rows.tau), Verdict.MISSING, Reason.NO_TIME)
    status.mark(fixes.edit == Edit.REJECT, Verdict.EDITED, Reason.REJECTED_BY_USER)
    status.mark(rows.late, Verdict.REJECTED, Reason.LATE)
    status.mark(repeats.repeated, Verdict.DUPLICATE, Reason.REPEATED)
    status.mark(~fixes.valid, Verdict.MISSING, Reason.INVALID)
    if held:
        status.mark(repeats.held, Verdict.DUPLICATE, Reason.HELD)
    copies = status.verdict == Verdict.DUPLICATE
    status.detail[copies] = repeats.first[copies]
    before = np.maximum.accumulate(np.where(np.isfinite(rows.time), rows.time, -np.inf))
    status.detail[rows.late] = before[rows.late]
    return status


def grid_times(
    tau: FloatArray, every: float, first: int, last: float, interval: float
) -> FloatArray:
    """Whole multiples of a step up to the end of ``tau``, leaving out long gaps.

    Parameters
    ----------
    tau
        (n,) filter times of the batch, n > 0.
    every, interval
        The step, and the usual interval between fixes, s.
    first
        The first multiple that is due.
    last
        Filter time of the batch before, −∞ at the beginning.
    """
    edges = np.concatenate([[last], tau]) if np.isfinite(last) else tau
    longest = max(_LONGEST, _GAP_INTERVALS * interval)
    breaks = np.flatnonzero(np.diff(edges) > longest)
    starts, ends = [-np.inf, *edges[breaks + 1]], [*edges[breaks], edges[-1]]
    multiples = [
        np.arange(max(np.ceil(a / every), first), np.floor(b / every) + 1.0)
        for a, b in zip(starts, ends, strict=True)
    ]
    return every * np.concatenate(multiples)


def epochs_of(
    rows: Rows,
    tau: FloatArray,
    position: FloatArray,
    velocity: FloatArray,
    status: Status,
    grid: FloatArray,
    setup: Setup,
    sensors: int,
) -> tuple[IntArray, Epochs]:
    """Epochs of rows and regular times together.

    Parameters
    ----------
    rows, tau
        n rows and their filter times.
    position, velocity
        (n, 3) in the local frame.
    status
        Rows it has a verdict for are not observed; rows the user accepts are marked here.
    grid
        (g,) times that only take a prediction.
    setup, sensors
        Noise figures, and how many sensors there are by now.

    Returns
    -------
    order, epochs
        (n + g,) which row each epoch is (grid times count on from n), and the epochs, all arrays of
        which are C-contiguous: kernels have one compiled form.
    """
    axes, motion, n = list(setup.axes), setup.motion, len(tau)
    z = np.hstack([position.take(axes, axis=1), velocity.take(axes, axis=1)])
    declared = rows.fixes.sigma_position, rows.fixes.sigma_velocity
    sigma = np.hstack(
        [
            _sigma(own, figures, sensors, rows.fixes.sensor).take(axes, axis=1)
            for own, figures in zip(declared, (setup.position, setup.velocity), strict=True)
        ]
    )
    if rows.lever.shape[1]:
        arms = rows.lever[:, 6:9], rows.lever[:, 9:]
        own = np.hstack([part.take(axes, axis=1) for part in arms])
        sigma = np.hypot(sigma, own)
    z[status.verdict >= 0] = np.nan
    fixed = np.full((n, motion.groups), np.nan)
    positions = int(motion.group[: len(axes)].max(initial=-1)) + 1
    accepted = (rows.fixes.edit == Edit.ACCEPT) & (status.verdict < 0)
    fixed[accepted, :positions] = 1.0
    status.mark(accepted, Verdict.EDITED, Reason.ACCEPTED_BY_USER)
    if len(grid):
        blank = np.full((len(grid), z.shape[1]), np.nan)
        tau, z = np.concatenate([tau, grid]), np.vstack([z, blank])
        sigma = np.vstack([sigma, np.ones_like(blank)])
        fixed = np.vstack([fixed, np.full((len(grid), motion.groups), np.nan)])
    order = np.argsort(tau, kind="stable") if len(grid) else np.arange(n)
    jump = np.zeros(len(order), np.int64)
    sensor = np.concatenate([rows.fixes.sensor, np.zeros(len(grid), np.int64)])
    sensor = np.minimum(sensor, MOST_SENSORS - 1)
    at = order if len(grid) else slice(None)  # which copies nothing
    return order, Epochs(tau[at], z[at], sigma[at] ** 2, fixed[at], jump, sensor[at])


def _sigma(declared: FloatArray, figures: FloatArray, sensors: int, sensor: IntArray) -> FloatArray:
    """Standard deviation of every component: declared, else its sensor's, else the others'."""
    by_sensor = np.full((sensors, 3), np.nan)
    by_sensor[: len(figures)] = figures
    for axis in range(3):
        known = by_sensor[np.isfinite(by_sensor[:, axis]), axis]
        by_sensor[np.isnan(by_sensor[:, axis]), axis] = np.median(known) if len(known) else 1.0
    return np.where(np.isfinite(declared), declared, by_sensor[sensor])


def padded(values: FloatArray | BoolArray, count: int) -> FloatArray | BoolArray:
    """``values`` along their first axis, filled up with zeros for sensors met later."""
    more = np.zeros((count - len(values), *values.shape[1:]), values.dtype)
    return np.concatenate([values, more])
