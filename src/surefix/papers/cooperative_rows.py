"""Paper 001: the figures of every table, for some runs at once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from surefix.fusion.information_gain import fuse_by_gain, gain_weights
from surefix.fusion.track import Estimate, weighted_mean
from surefix.metrics import normalised_squares
from surefix.papers.cooperative_hypotheses import several
from surefix.papers.cooperative_late import LATE, arrivals, fused_late, replayed, same_bits
from surefix.papers.cooperative_options import CooperativeOptions
from surefix.papers.cooperative_tracks import (
    CENTRAL,
    FUSIONS,
    GAIN,
    Sailed,
    central_track,
    local_tracks,
    sail,
)
from surefix.simulate.cooperative import READINGS, Formation, simulate, stack
from surefix.types import FloatArray, IntArray

__all__ = [
    "AXES",
    "BEST",
    "BOUND",
    "BY_SEVERAL",
    "EPOCHS",
    "GROSS",
    "SCALES",
    "SEVERAL",
    "SMOOTHED",
    "TOLD",
    "Rows",
    "Shown",
    "rows_of",
]

Rows = dict[str, FloatArray]
"""Row → (runs, columns)."""

BEST = "best single master"
BOUND = "gain weights, bound"
SEVERAL = "multi-hypothesis"
SMOOTHED = f"{SEVERAL}, offline"
BY_SEVERAL = f"{CENTRAL}, {SEVERAL}"
TOLD = f"{CENTRAL}, told"
EPOCHS = {1: (10, 30, 50, 70, 90), 2: (15, 35, 55, 75, 95)}
"""Iterations of Tables 3 and 5: the paper's are lost but for 70 and 75."""
AXES = (1.0, 2.0, 4.0, 8.0)
"""How many times noisier a master's poor axes are than its good one."""
SCALES = {
    "good ÷ 8": (1.0 / 8.0, 1.0),
    "geometric": (8.0 ** (-2.0 / 3.0), 8.0 ** (1.0 / 3.0)),
    "poor × 8": (1.0, 8.0),
}
"""Three ways to 1:8: factors of σ of a master's good axis and of its two poor ones."""
GROSS = (0.0, 0.05, 0.1, 0.2)
"""Shares of gross errors."""

_WARM_UP_S = 10.0


class Shown(NamedTuple):
    """What the pictures need: scenarios, and errors where messages come late, (T,) m each."""

    sailed: Mapping[str, Sailed]
    late: Mapping[str, FloatArray]


def rows_of(options: CooperativeOptions, seeds: list[list[int]]) -> tuple[dict[str, Rows], Shown]:
    """Everything for some runs: table → row → (runs, columns), and what the pictures show."""
    sailed = {
        name: sail(formation, process, seeds)
        for name, (formation, process) in options.scenarios.items()
    }
    rows: dict[str, Rows] = {"table_2": _at_iteration_70(sailed["1 path"])}
    for case in (1, 2):
        errors = _errors(sailed[f"{case} path"])
        rows[f"case_{case}_m"] = {
            row: error[:, np.array(EPOCHS[case]) - 1] for row, error in errors.items()
        }
        rows[f"case_{case}_fit"] = {
            row: _fit(error, np.array(EPOCHS[case]) - 1) for row, error in errors.items()
        }
    rows |= _comparison(sailed)
    rows["axes"] = _axes(options, seeds, [(1.0 / ratio, 1.0) for ratio in AXES])
    rows["axes_scaled"] = _axes(options, seeds, list(SCALES.values()))
    rows["readings"] = _readings(options, seeds)
    rows |= _gross(options, seeds)
    late, pictures = _late(options, seeds)
    rows |= late
    return rows, Shown(sailed, pictures)


def _errors(sailed: Sailed) -> Rows:
    """Absolute errors of each master and of the fusion, (runs, K) m."""
    off = sailed.tracks.mean - sailed.world.truth[:, :, None]
    rows = {f"AUV{i + 1}": _length(off[:, :, i]) for i in range(off.shape[2])}
    return rows | {GAIN: _length(sailed.fused[GAIN].mean - sailed.world.truth)}


def _at_iteration_70(sailed: Sailed) -> Rows:
    k = 69
    weight = gain_weights(sailed.tracks.gain[:, k])
    errors = {row: error[:, k] for row, error in _errors(sailed).items()}
    places = {f"AUV{i + 1}": sailed.tracks.mean[:, k, i] for i in range(weight.shape[1])}
    rows = {
        row: np.column_stack((place, errors[row], sailed.tracks.gain[:, k, i], weight[:, i]))
        for i, (row, place) in enumerate(places.items())
    }
    rows[GAIN] = np.column_stack((sailed.fused[GAIN].mean[:, k], errors[GAIN]))
    rows["truth"] = sailed.world.truth[:, k]
    return {
        row: np.pad(values, ((0, 0), (0, 6 - values.shape[1])), constant_values=np.nan)
        for row, values in rows.items()
    }


def _fit(error: FloatArray, epochs: IntArray) -> FloatArray:
    """Mean square, and standard deviation about the truth, of some epochs and of all."""
    some = np.square(error[:, epochs])
    total = np.square(error).mean(axis=1)
    deviation = np.sqrt(some.sum(axis=1) / (len(epochs) - 1))
    return np.column_stack((some.mean(axis=1), deviation, total, np.sqrt(total)))


def _comparison(sailed: Mapping[str, Sailed]) -> dict[str, Rows]:
    """RMSE, its ratio to the centralised filter, and NEES per axis, a column per scenario."""
    rmse: dict[str, list[FloatArray]] = {name: [] for name in (BEST, *FUSIONS)}
    nees: dict[str, list[FloatArray]] = {name: [] for name in (*FUSIONS, BOUND)}
    for one in sailed.values():
        truth = one.world.truth
        local = np.square(one.tracks.mean - truth[:, :, None]).sum(axis=-1).mean(axis=1)
        rmse[BEST].append(np.sqrt(local.min(axis=1)))
        for name, estimate in one.fused.items():
            rmse[name].append(_rmse(estimate, truth))
            nees[name].append(_nees(estimate, truth))
        alone = one.tracks.mean, one.tracks.posterior, gain_weights(one.tracks.gain)
        nees[BOUND].append(_nees(weighted_mean(*alone), truth))
    table = {name: np.column_stack(values) for name, values in rmse.items()}
    return {
        "rmse_m": table,
        "ratio": {name: values / table[CENTRAL] for name, values in table.items()},
        "nees": {name: np.column_stack(values) for name, values in nees.items()},
    }


def _axes(
    options: CooperativeOptions, seeds: list[list[int]], factors: Sequence[tuple[float, float]]
) -> Rows:
    """Ratio to the centralised filter where each master is good along one axis only."""
    found: dict[str, list[FloatArray]] = {}
    for good, poor in factors:
        ahead, upward = (good, poor, poor), (poor, poor, good)
        quality = (ahead, ahead, upward)  # AUV1 sails east, AUV2 north: x, y and z
        formation = Formation(
            squared_variance=options.variance, process=options.process, quality=quality
        )
        world, _, fused = sail(formation, options.process, seeds)
        standard = _rmse(fused[CENTRAL], world.truth)
        for name, estimate in fused.items():
            found.setdefault(name, []).append(_rmse(estimate, world.truth) / standard)
    return {name: np.column_stack(values) for name, values in found.items()}


def _readings(options: CooperativeOptions, seeds: list[list[int]]) -> Rows:
    """Gains at iteration 70, and RMSE of the masters, their fusion and the centralised filter."""
    rows: Rows = {}
    for reading in READINGS:
        formation = Formation(squared_variance=options.variance, reading=reading)
        world, tracks, fused = sail(formation, options.process, seeds)
        local = _length(tracks.mean - world.truth[:, :, None])
        masters = np.sqrt(np.square(local).mean(axis=(1, 2)))
        by_gain, central = _rmse(fused[GAIN], world.truth), _rmse(fused[CENTRAL], world.truth)
        rows[reading] = np.column_stack((tracks.gain[:, 69], masters, by_gain, central))
    return rows


def _gross(
    options: CooperativeOptions, seeds: list[list[int]], shares: Sequence[float] = GROSS
) -> dict[str, Rows]:
    """RMSE in m with and without a defence, and its ratio to one filter told all gross errors."""
    found: dict[str, list[FloatArray]] = {}
    for share in shares:
        for name, value in _gross_share(options, seeds, share).items():
            found.setdefault(name, []).append(value)
    metres = {name: np.column_stack(values) for name, values in found.items()}
    ratio = {
        name: metres[name] / metres[TOLD]
        for name in (f"{CENTRAL}, thresholds", BY_SEVERAL, SEVERAL, SMOOTHED)
    }
    return {"gross_m": metres, "gross_ratio": ratio}


def _gross_share(options: CooperativeOptions, seeds: list[list[int]], share: float) -> Rows:
    """RMSE, (runs,) m, by method at one share of gross errors."""
    process = options.process
    formation = Formation(squared_variance=options.variance, process=process, gross_share=share)
    world = stack([simulate(formation, seed) for seed in seeds])
    found: Rows = {}
    for ending, loss in (("", None), (", thresholds", options.threshold_loss)):
        tracks = local_tracks(formation, world, process, loss=loss)
        local = np.square(tracks.mean - world.truth[:, :, None]).sum(axis=-1)
        found[f"masters{ending}"] = np.sqrt(local.mean(axis=(1, 2)))
        by_gain, _ = fuse_by_gain(tracks.mean, tracks.posterior, tracks.gain)
        central = central_track(formation, world, process, loss=loss)
        found[GAIN + ending] = _rmse(by_gain, world.truth)
        found[CENTRAL + ending] = _rmse(central, world.truth)
    ours = several(formation, world, process, central.mean)
    blank = np.where(world.gross[..., None], np.nan, world.observed)
    estimates = {
        BY_SEVERAL: central_track(formation, world, process, weight=ours.weight),
        SEVERAL: ours.realtime,
        SMOOTHED: ours.offline,
        TOLD: central_track(formation, world._replace(observed=blank), process),
    }
    return found | {name: _rmse(each, world.truth) for name, each in estimates.items()}


def _late(
    options: CooperativeOptions, seeds: list[list[int]]
) -> tuple[dict[str, Rows], dict[str, FloatArray]]:
    """Ratio to a centralised filter without delay or loss, and NEES, a column per channel."""
    count = int(99.0 / options.fusion_s) + 1
    formation = Formation(
        squared_variance=options.variance,
        process=options.process,
        period_s=options.period_s,
        step_s=options.fusion_s,
        count=count,
    )
    world = stack([simulate(formation, seed) for seed in seeds])
    tracks = local_tracks(formation, world, options.process)
    grid = options.fusion_s * np.arange(count, dtype=np.float64)
    now: FloatArray = grid[grid >= _WARM_UP_S]
    at = np.searchsorted(world.time, now - 1e-6)
    truth = world.truth[:, at]
    central = central_track(formation, world, options.process)
    standard = _rmse(Estimate(central.mean[:, at], central.covariance[:, at]), truth)
    ratio: dict[str, list[FloatArray]] = {name: [] for name in LATE}
    nees: dict[str, list[FloatArray]] = {name: [] for name in LATE}
    for channel in options.channels.values():
        arrival = arrivals(channel, world, [[*seed, 1] for seed in seeds])
        fused = fused_late(formation, world, tracks, options.process, arrival, now)
        fused["replay of observations"] = replayed(formation, world, options.process, arrival, now)
        for name in LATE:
            ratio[name].append(_rmse(fused[name], truth) / standard)
            nees[name].append(_nees(fused[name], truth))
    same = 100.0 * same_bits(formation, world, options.process, arrival, 0)
    rows = {
        "late_ratio": {name: np.column_stack(values) for name, values in ratio.items()},
        "late_nees": {name: np.column_stack(values) for name, values in nees.items()},
        "replay": {"replay of observations": np.array([[same]])},
    }
    pictures = {name: _length(fused[name].mean - truth)[0] for name in LATE}
    return rows, {"time": now} | pictures


def _length(vector: FloatArray) -> FloatArray:
    return np.asarray(np.sqrt(np.square(vector).sum(axis=-1)))


def _rmse(estimate: Estimate, truth: FloatArray) -> FloatArray:
    """Root mean square of the length of the error over the epochs, (runs,) m."""
    square = np.square(estimate.mean - truth).sum(axis=-1)
    return np.asarray(np.sqrt(square.mean(axis=1)))


def _nees(estimate: Estimate, truth: FloatArray) -> FloatArray:
    """Mean NEES per axis over the epochs, (runs,)."""
    squares = normalised_squares(estimate.mean - truth, estimate.covariance)
    return np.asarray(squares.mean(axis=1) / truth.shape[-1])
