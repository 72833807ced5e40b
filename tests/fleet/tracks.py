"""Data sets of many tracks, small ones with faults, drawn from a seed."""

from __future__ import annotations

import numpy as np
import pyarrow as pa

import surefix

START = 1_700_000_000.0


def track(name, rows, seed, step=1.0):
    """One track: a walk with noise, five per cent wild fixes, and rows slightly out of order."""
    rng = np.random.default_rng([seed, rows])
    time = START + step * np.arange(rows) + rng.uniform(0.0, 0.4 * step, rows)
    wild = rng.random((rows, 1)) < 0.05
    velocity = np.array([1.0, 0.5]) + np.cumsum(rng.normal(0.0, 0.05, (rows, 2)), axis=0)
    position = np.cumsum(velocity * step, axis=0) + rng.normal(0.0, 0.5, (rows, 2))
    position += wild * rng.uniform(20.0, 60.0, (rows, 2))
    return pa.table(
        {"track_id": [name] * rows, "time": time, "x": position[:, 0], "y": position[:, 1]}
    )


def tracks(count, rows=60, seed=1):
    """Several tracks of different lengths, in one table, each by itself."""
    parts = [track(f"t{k:03d}", rows + 7 * k, [seed, k]) for k in range(count)]
    return pa.concat_tables(parts)


def one(table, name):
    """Rows of one track, without its name."""
    mine = np.array(table.column("track_id").to_pylist()) == name
    return table.filter(pa.array(mine)).drop_columns(["track_id"])


def expected(table, name, **options):
    """What one call on the rows of the track gives."""
    cleaned = surefix.clean(one(table, name), options=surefix.CleanOptions(**options))
    return surefix.to_table(cleaned)


def in_time(table):
    """The rows by time, the tracks mixed."""
    return table.take(pa.array(np.argsort(table.column("time").to_numpy(), kind="stable")))
