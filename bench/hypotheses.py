"""What several hypotheses cost: µs an epoch, and how many times the plain filter of the same data.

Run ``python bench/hypotheses.py`` (``--json`` for machines). Fixes of one to three axes of which a
fifth is wild, with velocities (aided) or without (alone); medians of several rounds in turn, in
time of the processor. The lagged output is what it costs beyond the filter, whose trail it reads.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable
from functools import partial

import numpy as np

from surefix.filters.hypotheses import no_hypotheses
from surefix.filters.learning import supposed
from surefix.filters.multi_hypothesis import filter_hypotheses
from surefix.filters.multi_hypothesis_modes import lagged_hypotheses
from surefix.filters.records import Epochs, Motion, Recovery
from surefix.filters.track import by_axis, filter_track, start
from surefix.robust.loss import loss_named
from surefix.simulate.contamination import SCENARIOS, World, alone, draw

EPOCHS = 20_000
ROUNDS = 7
LAG = 40.0  # intervals
MOST = (16, 32, 64)
SCENARIO = "isolated-20"

Row = dict[str, float | int | str]


def main() -> None:
    """Print one row per kind of data, or all of them as JSON."""
    rows = [
        row
        for axes in (1, 2, 3)
        for kind in ("aided", "alone")
        for row in measured(axes, aided=kind == "aided")
    ]
    if "--json" in sys.argv:
        print(json.dumps(rows, indent=1))
        return
    print("axes   data  most  µs an epoch  × plain   live   lagged +µs")
    for row in rows:
        print(
            f"{row['axes']:4d}  {row['data']}  {row['most']:4d}  {row['us']:11.2f}"
            f"  {row['ratio']:7.1f}  {row['live']:5.1f}  {row['lagged_us']:11.2f}"
        )


def measured(axes: int, *, aided: bool) -> list[Row]:
    """Cost of one kind of data, a row for each number of hypotheses."""
    motion, epochs, interval = series(axes, aided=aided)
    sigma, speed = np.sqrt(epochs.variance[0, [0, axes]])
    prior = supposed(axes, sigma, speed, 20.0 * sigma / interval, 39.5 * interval)
    prior = prior._replace(isolated=SCENARIOS[SCENARIO].share)
    every = np.ones(len(epochs.time), np.bool_)
    never = Recovery(np.inf, prior.sigma_velocity)
    calls: dict[str, Callable[[], object]] = {
        "plain": partial(
            filter_track, motion, loss_named("kalman"), never, epochs, start(motion, never)
        )
    }
    for most in MOST:
        bank = no_hypotheses(motion, most)
        calls[f"filter {most}"] = partial(filter_hypotheses, motion, prior, epochs, bank)
        calls[f"lagged {most}"] = partial(
            lagged_hypotheses, motion, prior, epochs, LAG * interval, every, most
        )
    cost = medians(calls, len(epochs.time))
    return [
        {
            "axes": axes,
            "data": "aided" if aided else "alone",
            "most": most,
            "us": cost[f"filter {most}"],
            "ratio": cost[f"filter {most}"] / cost["plain"],
            "live": live(calls[f"filter {most}"]),
            "lagged_us": cost[f"lagged {most}"] - cost[f"filter {most}"],
        }
        for most in MOST
    ]


def series(axes: int, *, aided: bool) -> tuple[Motion, Epochs, float]:
    """Draw a log and its model."""
    world = World(epochs=EPOCHS, axes=axes)
    trial = draw(SCENARIO, world, [5, axes])
    trial = trial if aided else alone(trial)
    n = len(trial.time)
    variance = np.repeat([world.sigma_m**2, world.sigma_mps**2], axes) * np.ones((n, 1))
    z, none = np.hstack([trial.fixes, trial.velocities]), np.zeros(n, np.int64)
    epochs = Epochs(trial.time, z, variance, np.full(z.shape, np.nan), none, none)
    density = np.full(axes, world.process**2)
    return Motion(2, axes, density, by_axis(axes), 2 * axes, 0.0), epochs, world.interval_s


def medians(calls: dict[str, Callable[[], object]], epochs: int) -> dict[str, float]:
    """µs an epoch of each call, the median of rounds in turn; compiled before."""
    taken: dict[str, list[float]] = {name: [] for name in calls}
    for call in calls.values():
        call()
    for _ in range(ROUNDS):
        for name, call in calls.items():
            begin = time.process_time()
            call()
            taken[name].append(time.process_time() - begin)
    return {name: 1e6 * float(np.median(each)) / epochs for name, each in taken.items()}


def live(call: Callable[[], object]) -> float:
    """Mean number of hypotheses that are kept."""
    trail = call()[2]  # type: ignore[index]
    return float(np.mean(np.diff(trail.first)))


if __name__ == "__main__":
    main()
