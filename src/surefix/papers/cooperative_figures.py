"""Paper 001: its Figures 7 to 15 from the first run, and what our tables say beside them."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from surefix.experiment import Figure, Panel, Table, Trace
from surefix.papers.cooperative_rows import AXES, GROSS, Shown
from surefix.papers.cooperative_tracks import CENTRAL, GAIN, Sailed, observed_positions
from surefix.types import FloatArray

__all__ = ["figures"]

_XYZ = ("x, m", "y, m", "z, m")
_OBSERVED = "observations"
_MEAN = "mean of observations"
_ESTIMATES = "mean of estimates"


def figures(shown: Shown, tables: Mapping[str, Table]) -> tuple[Figure, ...]:
    """Draw the paper's figures and ours.

    Parameters
    ----------
    shown
        Of the first runs; run 0 is drawn.
    tables
        By key; the means over all runs are drawn.
    """
    one, two = shown.sailed["1 path"], shown.sailed["2 path"]
    return (
        _single_master(one),
        _all_masters(one),
        _three_planes(one),
        _accuracy(one),
        _formation(two),
        _coordinates(two),
        _cumulative(shown.sailed),
        _limits(tables["axes"], tables["gross_m"]),
        _late(shown.late, tables["late_ratio"]),
    )


def _single_master(sailed: Sailed) -> Figure:
    seen, found = observed_positions(sailed.world)[0, :, 0], sailed.tracks.mean[0, :, 0]
    panels = tuple(
        _plane(a, b, sailed, [(_OBSERVED, seen, "raw"), ("UKF of AUV1", found, "line")])
        for a, b in ((0, 2), (0, 1))
    )
    return Figure(key="fig-7", title="One master (Figure 7)", panels=panels, columns=2)


def _all_masters(sailed: Sailed) -> Figure:
    seen, found = observed_positions(sailed.world)[0], sailed.tracks.mean[0]
    traces = [(_OBSERVED, seen[:, i], "raw") for i in range(seen.shape[1])]
    traces += [(f"UKF of AUV{i + 1}", found[:, i], "line") for i in range(found.shape[1])]
    traces += [(GAIN, sailed.fused[GAIN].mean[0], "line")]
    panels = tuple(_plane(a, b, sailed, traces) for a, b in ((0, 2), (0, 1)))
    return Figure(key="fig-8", title="All masters and fusion (Figure 8)", panels=panels, columns=2)


def _three_planes(sailed: Sailed) -> Figure:
    traces = [
        (_MEAN, sailed.fused[_MEAN].mean[0], "raw"),
        (GAIN, sailed.fused[GAIN].mean[0], "line"),
    ]
    panels = tuple(_plane(a, b, sailed, traces) for a, b in ((0, 1), (1, 2), (2, 0)))
    title = "Fusion against the mean of the observations (Figure 9)"
    return Figure(key="fig-9", title=title, panels=panels, columns=3)


def _plane(a: int, b: int, sailed: Sailed, traces: list[tuple[str, FloatArray, str]]) -> Panel:
    truth = sailed.world.truth[0]
    drawn = [Trace(name, at[:, a], at[:, b], kind) for name, at, kind in traces]  # type: ignore[arg-type]
    return Panel(
        x_label=_XYZ[a],
        y_label=_XYZ[b],
        traces=(*drawn, Trace("truth", truth[:, a], truth[:, b], "truth")),
    )


def _iterations(sailed: Sailed) -> FloatArray:
    return np.arange(1.0, len(sailed.world.time) + 1.0)


def _errors(sailed: Sailed) -> dict[str, FloatArray]:
    """Lengths of the errors of the masters, m, (K,) each."""
    off = sailed.tracks.mean[0] - sailed.world.truth[0][:, None]
    length = np.sqrt(np.square(off).sum(axis=-1))
    return {f"UKF of AUV{i + 1}": length[:, i] for i in range(length.shape[1])}


def _error(sailed: Sailed, fusion: str) -> FloatArray:
    off = sailed.fused[fusion].mean[0] - sailed.world.truth[0]
    return np.asarray(np.sqrt(np.square(off).sum(axis=-1)))


def _cumulative(sailed: Mapping[str, Sailed]) -> Figure:
    panels = []
    for name, one in sailed.items():
        if "path" not in name:
            continue
        iteration = _iterations(one)
        errors = _errors(one) | {fusion: _error(one, fusion) for fusion in (GAIN, CENTRAL)}
        traces = tuple(
            Trace(who, iteration, np.cumsum(error) / iteration) for who, error in errors.items()
        )
        title = f"Case {name.replace(' path', '')}"
        panel = Panel(
            title=title, x_label="iteration", y_label="mean error so far, m", traces=traces
        )
        panels.append(panel)
    title = "Cumulative mean errors (Figures 10, 12 and 15)"
    return Figure(key="cumulative", title=title, panels=tuple(panels), columns=3)


def _accuracy(sailed: Sailed) -> Figure:
    iteration = _iterations(sailed)
    groups = (_errors(sailed), {name: _error(sailed, name) for name in (_ESTIMATES, GAIN)})
    top = max(error.max() for error in groups[0].values())
    panels = tuple(
        Panel(
            title=title,
            x_label="iteration",
            y_label="error, m",
            traces=tuple(Trace(name, iteration, error) for name, error in group.items()),
            y_range=(0.0, 1.05 * float(top)),
        )
        for title, group in zip(("Masters", "Fused"), groups, strict=True)
    )
    title = "Errors of masters of different accuracy, and of their fusion (Figure 11)"
    return Figure(key="fig-11", title=title, panels=panels, columns=2)


def _formation(sailed: Sailed) -> Figure:
    world, fused = sailed.world, sailed.fused[GAIN].mean[0]
    panels = []
    for a, b in ((0, 1), (0, 2)):
        masters = [Trace(f"AUV{i + 1}", at[:, a], at[:, b]) for i, at in enumerate(world.master[0])]
        slave = Trace("slave, truth", world.truth[0, :, a], world.truth[0, :, b], "truth")
        found = Trace(f"slave, {GAIN}", fused[:, a], fused[:, b], "line")
        traces = (*masters, slave, found)
        panels.append(Panel(x_label=_XYZ[a], y_label=_XYZ[b], traces=traces))
    title = "Four masters and the slave, case 2 (Figure 13)"
    return Figure(key="fig-13", title=title, panels=tuple(panels), columns=2)


def _coordinates(sailed: Sailed) -> Figure:
    iteration = _iterations(sailed)
    mean, fused = sailed.fused[_MEAN].mean[0], sailed.fused[GAIN].mean[0]
    panels = tuple(
        Panel(
            x_label="iteration",
            y_label=_XYZ[a],
            traces=(
                Trace(_MEAN, iteration, mean[:, a], "raw"),
                *(
                    Trace(f"UKF of AUV{i + 1}", iteration, found[:, a])
                    for i, found in enumerate(sailed.tracks.mean[0].swapaxes(0, 1))
                ),
                Trace(GAIN, iteration, fused[:, a]),
                Trace("truth", iteration, sailed.world.truth[0, :, a], "truth"),
            ),
        )
        for a in range(3)
    )
    title = "Coordinates of the slave, case 2 (Figure 14)"
    return Figure(key="fig-14", title=title, panels=panels, columns=3)


def _limits(axes: Table, gross: Table) -> Figure:
    apart = tuple(
        Trace(name, np.array(AXES), _row(axes, name), "points")
        for name in (GAIN, "covariance intersection", "Bar-Shalom–Campo", "tracklets")
    )
    share = 100.0 * np.array(GROSS)
    wild = tuple(
        Trace(name, share, _row(gross, name), "points")
        for name in (GAIN, f"{GAIN}, thresholds", "multi-hypothesis")
    )
    panels = (
        Panel(
            title="Masters that are good along one axis each",
            x_label="σ of the two poor axes ÷ σ of the good one",
            y_label="RMSE ÷ centralised",
            traces=apart,
        ),
        Panel(
            title="Gross errors",
            x_label="gross errors, %",
            y_label="RMSE, m",
            traces=wild,
        ),
    )
    title = "Where the gain weights fail, and what mends it"
    return Figure(key="limits", title=title, panels=panels, columns=2)


def _late(late: Mapping[str, FloatArray], ratio: Table) -> Figure:
    drawn = (
        "in order, as printed",
        "timely, as printed",
        "timely, gain weights",
        "replay of observations",
    )
    channel = np.arange(float(len(ratio.columns)))
    panels = (
        Panel(
            title=f"Error, {ratio.columns[-1]}",
            x_label="time, s",
            y_label="error, m",
            traces=tuple(Trace(name, late["time"], late[name]) for name in drawn),
        ),
        Panel(
            title="From good to bad channels",
            x_label="",
            x_names=ratio.columns,
            y_label="RMSE ÷ centralised",
            traces=tuple(Trace(name, channel, _row(ratio, name), "points") for name in drawn),
        ),
    )
    title = "Messages that come late, out of order or not at all"
    return Figure(key="late", title=title, panels=panels, columns=2)


def _row(table: Table, name: str) -> FloatArray:
    return np.asarray(table.mean[table.rows.index(name)])
