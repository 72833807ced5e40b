"""The figures of paper 000: what was printed, what one run gives, and the tables of all runs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final, NamedTuple

import numpy as np

from surefix.experiment import Table, gather
from surefix.metrics import normalised_squares, rmse
from surefix.papers.usbl_methods import (
    METHODS,
    SENSORS,
    Estimate,
    Reading,
    compare,
    estimate,
    printed_gain,
)
from surefix.simulate.usbl_track import UsblTrack, simulate
from surefix.types import FloatArray

__all__ = ["FIRST", "PRINTED_M", "PRINTED_PCT", "THRESHOLD", "figures_of_run", "rejected", "tables"]

FIRST: Final = ("KF", "Huber", "IGG1", "IGG3")
"""The methods of the paper."""
PRINTED_M: Final = {
    "KF": (7.265, 7.147, 6.147),
    "Huber": (4.439, 4.379, 2.267),
    "IGG1": (0.207, 0.237, 0.195),
    "IGG3": (0.209, 0.218, 0.198),
}
"""Table 1: RMSE in X, Y, Z."""
PRINTED_PCT: Final = {
    "KF": (0.0, 1.65, 0.83),
    "Huber": (36.36, 38.84, 43.80),
    "IGG1": (92.56, 82.64, 92.56),
    "IGG3": (91.74, 80.99, 93.39),
}
"""Table 2: share of the gross errors rejected in X, Y, Z."""
THRESHOLD: Final = 0.5
"""m: a gross error counts as rejected where the filtered error is smaller."""

_AXES: Final = ("X", "Y", "Z")
_RUNS: Final = ("common", "independent")
_AS_PRINTED: Final = "Q = 0.1 I, R = I, v in m"
_LITERAL: Final = "P⁻ = 0.1 I always (eq 13)"
_FAST: Final = "epochs of 0.25 s"
_READINGS: Final[Mapping[str, Reading]] = {
    _AS_PRINTED: Reading(),
    "Q = 10 I": Reading(q=10.0),
    "Q = 0.03 I": Reading(q=0.03),
    "Q = 0.01 I": Reading(q=0.01),
    "Q = 0.001 I": Reading(q=0.001),
    _FAST: Reading(),
    _LITERAL: Reading(),
    "v over its own σ": Reading(spread="innovation"),
    "Q of the motion": Reading(q=None),
    "R of the sensors": Reading(sensors=True, spread="innovation"),
    "Q of the motion, R of the sensors": SENSORS,
}
_CONSTANTS: Final = ((1.0, 3.0), (1.0, 4.5), (1.5, 3.0), (1.5, 4.5), (2.0, 4.5))
_NOISES: Final = (0.1, 0.03, 0.01, 0.003, 0.001)
_STARTS: Final = (1.0, 1.5, 2.0)
_LEAST: Final = (5.0, 3.0, 2.0, 1.0)
_SMALL: Final = 2.0
_LARGEST: Final = 42.0

Figures = dict[str, dict[str, list[float]]]


def rejected(track: UsblTrack, position: FloatArray) -> FloatArray:
    """Share of the gross errors whose filtered error is below 0.5 m, per axis, %.

    Parameters
    ----------
    track
        Simulated.
    position
        (n, 3) m as estimated; NaN counts as not rejected.
    """
    near = np.abs(position - track.position)[track.gross] < THRESHOLD
    return np.asarray(100.0 * near.mean(axis=0))


def figures_of_run(seed: Sequence[int], epochs: int) -> Figures:
    """Give all figures of one run: key of the table → row → one figure a column."""
    common = simulate(seed, epochs=epochs)
    independent = simulate(seed, epochs=epochs, run="independent")
    made: Figures = {}
    for track, suffix in ((common, ""), (independent, "_independent")):
        found = compare(track, Reading())
        made[f"rmse{suffix}_m"] = {
            row: rmse(each.position - track.position).tolist() for row, each in found.items()
        }
        made[f"rejected{suffix}_pct"] = {
            row: rejected(track, each.position).tolist() for row, each in found.items()
        }
    fast = simulate(seed, epochs=epochs, interval_s=0.25)
    readings = {
        name: [_of(fast if name == _FAST else common, row, name, reading) for row in FIRST]
        for name, reading in _READINGS.items()
    }
    made["readings_rmse_m"] = {name: [one.m for one in each] for name, each in readings.items()}
    made["readings_rejected_pct"] = {
        name: [one.pct for one in each] for name, each in readings.items()
    }
    made["huber_rejected_pct"] = {
        f"Q = {q:g} I": [_of(common, "Huber", "", Reading(q=q, k0=k0)).pct for k0 in _STARTS]
        for q in _NOISES
    }
    smaller = {
        least: [simulate(seed, epochs=epochs, run=run, gross_m=(least, _LARGEST)) for run in _RUNS]
        for least in _LEAST
    }
    made["constants_rmse_m"] = {
        f"k0 = {k0:g}, k1 = {k1:g}": [
            _of(track, row, "", Reading(k0=k0, k1=k1)).m
            for track in smaller[_SMALL]
            for row in ("Huber", "IGG1", "IGG3")
        ]
        for k0, k1 in _CONSTANTS
    }
    made["least_size_m"] = {
        f"from {least:g} m": [
            _of(track, row, "", Reading()).m
            for track in tracks
            for row in ("IGG1", "IGG3", "IGG3 (Yang)")
        ]
        for least, tracks in smaller.items()
    }
    made["nees"] = {
        row: [
            _nees(track, estimate(track, row.replace("oracle", "KF"), reading, left_out))
            for reading in (Reading(), SENSORS)
            for track in (common, independent)
            for left_out in (track.gross if row == "oracle" else None,)
        ]
        for row in (*METHODS, "oracle")
    }
    return made


class _Score(NamedTuple):
    """Means over the axes: RMSE in m, and share of the gross errors rejected in %."""

    m: float
    pct: float


def _of(track: UsblTrack, row: str, name: str, reading: Reading) -> _Score:
    how = printed_gain if name == _LITERAL else estimate
    position = how(track, row, reading).position
    return _Score(
        float(rmse(position - track.position).mean()), float(rejected(track, position).mean())
    )


def _nees(track: UsblTrack, found: Estimate) -> float:
    error = found.position - track.position
    return float(normalised_squares(error, found.covariance).mean())


def tables(runs: Sequence[Figures]) -> tuple[Table, ...]:
    """Gather the figures of all runs, beside what was printed."""

    def make(
        key: str, title: str, columns: Sequence[str], unit: str = "m", **more: object
    ) -> Table:
        return gather(key, title, columns, [run[key] for run in runs], unit=unit, **more)  # type: ignore[arg-type]

    mean_m = {_AS_PRINTED: tuple(float(np.mean(PRINTED_M[row])) for row in FIRST)}
    mean_pct = {_AS_PRINTED: tuple(float(np.mean(PRINTED_PCT[row])) for row in FIRST)}
    both = tuple(f"{row}, {run}" for run in _RUNS for row in ("Huber", "IGG1", "IGG3"))
    least = tuple(f"{row}, {run}" for run in _RUNS for row in ("IGG1", "IGG3", "Yang"))
    return (
        make(
            "rmse_m", "RMSE, run with a common offset (Table 1)", _AXES, printed=PRINTED_M,
            note="Oracle: told which are gross. Sensor noise: R of the geometry, Q of the motion.",
        ),
        make(
            "rejected_pct", "Gross errors rejected, run with a common offset (Table 2)", _AXES, "%",
            printed=PRINTED_PCT, digits=1, note="Filtered error below 0.5 m.",
        ),
        make("rmse_independent_m", "RMSE, independent errors within the run", _AXES),
        make(
            "rejected_independent_pct", "Gross errors rejected, independent errors within the run",
            _AXES, "%", digits=1,
        ),
        make(
            "readings_rmse_m", "RMSE by reading, mean of the axes", FIRST, printed=mean_m,
            of="Reading",
            note="Each row changes the first in what it names; the last has k0, k1 = 1.5, 4.5 too.",
        ),
        make(
            "readings_rejected_pct", "Gross errors rejected by reading, mean of the axes", FIRST,
            "%", printed=mean_pct, digits=1, of="Reading",
        ),
        make(
            "huber_rejected_pct", "Gross errors rejected by Huber, mean of the axes",
            [f"k0 = {k0:g}" for k0 in _STARTS], "%", digits=1, of="Process noise",
            note="The paper: 36.4, 38.8 and 43.8 % in X, Y and Z.",
        ),
        make(
            "constants_rmse_m", "RMSE by constants of the weights, mean of the axes", both,
            of="Constants",
            note="Gross errors from 2 m on: larger ones are rejected with any of these constants.",
        ),
        make(
            "least_size_m", "RMSE by least size of the gross errors, mean of the axes", least,
            of="Gross errors",
            note="IGG rejects from k1 = 3 m on; what is smaller is used in part.",
        ),
        make(
            "nees", "Normalised squared position error (3 is honest)",
            [f"{which}, {run}" for which in ("as printed", "of the sensors") for run in _RUNS],
            "", digits=2,
        ),
    )  # fmt: skip
