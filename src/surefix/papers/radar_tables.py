"""Paper 004: the figures of one run, and the tables over all runs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final, NamedTuple

import numpy as np

from surefix.experiment import Table, gather
from surefix.filters.median_recursion import filter_medians, median_recursion
from surefix.metrics import rmse
from surefix.papers.radar_breakdown import (
    BOUND,
    KINDS,
    LENGTHS,
    MILD,
    REPEATED,
    burst_methods,
    greatest,
    longest,
    settings,
)
from surefix.papers.radar_methods import COUNTED, OURS, PRINTED
from surefix.papers.radar_series import Cartesian, Fusion
from surefix.simulate.radar import RadarFlight
from surefix.types import BoolArray, FloatArray

__all__ = ["WINDOWS", "Parts", "figures_of_run", "tables"]

WINDOWS: Final = (9, 19, 39, 79, 159)
_OTHER_WINDOWS: Final = (19, 79)
_G, _TURN_S = 9.81, 10.0  # m/s², s
_GAINS, _GATES = (0.1, 0.2, 0.4, 0.7, 1.0), (2.5, 3.0, 4.0, 5.0)
_MILLIDEGREES = np.array([1.0, 1e3 * 180.0 / np.pi, 1e3 * 180.0 / np.pi])
_SURVIVED_NOTE = (
    f"off by at most {BOUND:g} σ from the first wild sample to 78 samples after the last"
)


class Parts(NamedTuple):
    """Which samples of the flight are looked at.

    Parameters
    ----------
    settled
        First sample that counts; what is before registers the radars.
    burst
        From the first wild sample of the burst to two windows after the last.
    manoeuvre, noisy
        While the aircraft swerves, and while radar A is noisier.
    straight
        All other settled samples.
    """

    settled: int
    burst: slice
    manoeuvre: slice
    noisy: slice
    straight: BoolArray


def figures_of_run(
    flight: RadarFlight,
    parts: Parts,
    bias: Mapping[str, FloatArray],
    a: Cartesian,
    one: Mapping[str, FloatArray],
    both: Mapping[str, Fusion],
    burst_seed: Sequence[int],
    *,
    density: float,
    window: int,
    trials: int,
) -> dict[str, dict[str, FloatArray]]:
    """Everything the tables gather: table key → row → figures."""
    truth = flight.position
    found: dict[str, dict[str, FloatArray]] = {
        "disturbed_m": {n: _size(x - truth, parts.burst) for n, x in one.items()},
        "manoeuvre_m": {n: _size(x - truth, parts.manoeuvre) for n, x in one.items()},
        "straight_m": {n: rmse((x - truth)[parts.straight][:, 1:]) for n, x in one.items()},
        "registration": {n: _bias_error(flight, each) for n, each in bias.items()},
        "fusion_m": {
            n: _fused(each.position - truth, parts) for n, each in both.items() if n != COUNTED
        },
        "nees": {
            n: _nees(each, truth, parts)
            for n, each in both.items()
            if np.isfinite(each.variance).any()
        },
        "window_m": {f"window {m}": _window(a, flight, parts, m) for m in WINDOWS},
        "constants": settings(burst_seed, trials, _GAINS, _GATES),
    }
    return found | _bursts(burst_seed, density, window, trials)


def tables(runs: Sequence[Mapping[str, Mapping[str, FloatArray]]], dt: float) -> tuple[Table, ...]:
    """Tables over all runs; `dt` is the step in s."""

    def table(key: str, title: str, columns: Sequence[str], **more: object) -> Table:
        return gather(key, title, columns, [run[key] for run in runs], **more)  # type: ignore[arg-type]

    sizes = ("Y RMSE", "Y largest", "Z RMSE", "Z largest")
    bursts = [f"{length}" for length in LENGTHS]
    angles = [f"{radar} {part}" for radar in "AB" for part in ("range", "azimuth", "elevation")]
    parts = ("straight", "burst", "manoeuvre", "noisy")
    seconds = ", ".join(f"{m} is {m * dt:.2g} s" for m in WINDOWS)
    return (
        table("disturbed_m", "Error of radar A around the burst", sizes, unit="m", digits=1),
        table("manoeuvre_m", "Error of radar A in the manoeuvre", sizes, unit="m", digits=1),
        table("straight_m", "RMSE of radar A on the straight legs", ("Y", "Z"), unit="m", digits=1),
        table(
            "survived_common_pct",
            "Bursts of one common offset survived, by length",
            bursts,
            unit="%",
            digits=0,
            note=_SURVIVED_NOTE,
        ),
        table(
            "survived_own_pct",
            "Bursts of independent errors survived, by length",
            bursts,
            unit="%",
            digits=0,
            note=_SURVIVED_NOTE,
        ),
        table(
            "survived_common_5_pct",
            f"Bursts of one common offset survived by a criterion of {MILD:g} σ, by length",
            bursts,
            unit="%",
            digits=0,
        ),
        table(
            "survived_own_5_pct",
            f"Bursts of independent errors survived by a criterion of {MILD:g} σ, by length",
            bursts,
            unit="%",
            digits=0,
        ),
        table(
            "longest",
            "Longest burst that every trial of a run survived",
            ("common offset", "independent"),
            unit="samples",
            digits=1,
        ),
        table(
            "constants",
            "The printed form under other constants: noise, and bursts of 15 survived in %",
            ("RMSE / σ", *(f"c = {gate:g}" for gate in _GATES)),
            digits=2,
            of="Gain",
        ),
        table(
            "window_m",
            "RMSE of the recursion with feedback, by its window",
            ("Y straight", "Z straight", "Y manoeuvre", "Z manoeuvre", "Y, 1 g for 10 s"),
            unit="m",
            digits=1,
            note=seconds,
            of="Window",
        ),
        table("fusion_m", "RMSE of both radars fused, three axes", parts, unit="m", digits=1),
        table(
            "nees",
            "Squared error over the variance claimed, mean of the axes; 1 is honest",
            parts,
            digits=2,
        ),
        table(
            "registration",
            "Error of the systematic errors, m and thousandths of a degree",
            angles,
            digits=1,
        ),
    )


def _size(error: FloatArray, part: slice) -> FloatArray:
    """RMSE and largest error of Y and of Z."""
    y, z = error[part, 1], error[part, 2]
    return np.array(
        [np.sqrt(np.mean(y**2)), np.abs(y).max(), np.sqrt(np.mean(z**2)), np.abs(z).max()]
    )


def _bias_error(flight: RadarFlight, bias: FloatArray) -> FloatArray:
    true = np.array([log.bias for log in flight.radars])
    return np.asarray(np.abs((bias - true) * _MILLIDEGREES).ravel())


def _fused(error: FloatArray, parts: Parts) -> FloatArray:
    length = np.linalg.norm(error, axis=1)
    each = (parts.straight, parts.burst, parts.manoeuvre, parts.noisy)
    return np.array([np.sqrt(np.mean(length[part] ** 2)) for part in each])


def _nees(fused: Fusion, truth: FloatArray, parts: Parts) -> FloatArray:
    ratio = (fused.position - truth) ** 2 / fused.variance
    each = (parts.straight, parts.burst, parts.manoeuvre, parts.noisy)
    return np.array([np.mean(ratio[part]) for part in each])


def _window(a: Cartesian, flight: RadarFlight, parts: Parts, window: int) -> FloatArray:
    """The recursion on Y, Z, and on Y with a hard turn added where the weak one begins."""
    truth = flight.position
    start = parts.manoeuvre.start
    since = np.clip(flight.dt * (np.arange(len(truth)) - start), 0.0, None)
    turning = np.minimum(since, _TURN_S)
    turn = _G * turning * (since - 0.5 * turning)
    z = np.column_stack([a.position[:, 1:], a.position[:, 1] + turn])
    off = filter_medians(median_recursion(window=window), z)[1].estimate
    off -= np.column_stack([truth[:, 1:], truth[:, 1] + turn])
    hard = slice(start, start + round(_TURN_S / flight.dt))
    return np.concatenate(
        [rmse(off[parts.straight][:, :2]), rmse(off[parts.manoeuvre][:, :2]), rmse(off[hard])[2:]]
    )


def _bursts(
    seed: Sequence[int], density: float, window: int, trials: int
) -> dict[str, dict[str, FloatArray]]:
    methods = burst_methods(density, window)
    off = {kind: greatest(seed, methods, kind, trials, LENGTHS) for kind in KINDS}
    found = {
        f"survived_{kind}{suffix}_pct": {
            n: 100.0 * (each <= bound).mean(axis=1) for n, each in off[kind].items()
        }
        for suffix, bound in (("", BOUND), ("_5", MILD))
        for kind in KINDS
    }
    rows = {n: np.array([longest(off[kind][n], LENGTHS) for kind in KINDS]) for n in methods}
    for other in _OTHER_WINDOWS:
        again = burst_methods(density, other)
        few = {n: again[n] for n in (PRINTED, OURS)}
        if other < window:
            few[REPEATED] = again[REPEATED]
        each = {kind: greatest(seed, few, kind, trials, LENGTHS) for kind in KINDS}
        for n in few:
            rows[f"{n}, window {other}"] = np.array([longest(each[k][n], LENGTHS) for k in KINDS])
    return found | {"longest": rows}
