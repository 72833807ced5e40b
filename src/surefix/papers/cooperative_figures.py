"""Paper 001: its Figures 7 to 15 from the first run, and what our tables say beside them."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from surefix.experiment import Figure, Panel, Table, Trace
from surefix.papers.cooperative_rows import AXES, Shown
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
    raised = next(name for name in shown.sailed if name.startswith("1 path Q"))
    return (
        _single_master(one),
        _all_masters(one),
        _three_planes(one),
        _cumulative("fig-10", "Cumulative mean error, case 1 (Figure 10)", one),
        _accuracy(one),
        _cumulative(
            "fig-12", f"Cumulative mean error, {raised[7:]} (Figure 12)", shown.sailed[raised]
        ),
        _formation(two),
        _coordinates(two),
        _cumulative("fig-15", "Cumulative mean error, case 2 (Figure 15)", two),
        _axes(tables["axes"]),
        _late(shown.late),
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


def _cumulative(key: str, title: str, sailed: Sailed) -> Figure:
    iteration = _iterations(sailed)
    errors = _errors(sailed) | {name: _error(sailed, name) for name in (GAIN, CENTRAL)}
    traces = tuple(
        Trace(name, iteration, np.cumsum(error) / iteration) for name, error in errors.items()
    )
    panel = Panel(x_label="iteration", y_label="mean error so far, m", traces=traces)
    return Figure(key=key, title=title, panels=(panel,))


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


def _axes(table: Table) -> Figure:
    ratio = np.array(AXES)
    drawn = (GAIN, f"{GAIN}, fed back", "covariance intersection", "Bar-Shalom–Campo")
    traces = tuple(
        Trace(name, ratio, table.mean[table.rows.index(name)], "points") for name in drawn
    )
    panel = Panel(
        x_label="σ of a master's two poor axes ÷ its good one",
        y_label="RMSE ÷ centralised",
        traces=traces,
    )
    title = "Masters that are good along one axis each: one weight is not enough"
    return Figure(key="axes", title=title, panels=(panel,))


def _late(late: Mapping[str, FloatArray]) -> Figure:
    drawn = ("in order, as printed", "timely, as printed", "timely, gain weights")
    traces = tuple(
        Trace(name, late["time"], late[name]) for name in (*drawn, "replay of observations")
    )
    panel = Panel(x_label="time, s", y_label="error, m", traces=traces)
    title = "Messages that come late, out of order or not at all"
    return Figure(key="late", title=title, panels=(panel,))
