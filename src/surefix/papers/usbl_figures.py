"""Figures 6–9 of paper 000, and what it does not show."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from surefix.experiment import Figure, Panel, Trace
from surefix.papers.usbl_methods import SEVERAL, Estimate
from surefix.simulate.usbl_track import UsblTrack
from surefix.types import BoolArray, FloatArray

__all__ = ["figures"]

_FIRST = ("KF", "Huber", "IGG1", "IGG3")
_OURS = f"{SEVERAL}, offline"
_AXES = ("X", "Y", "Z")
_LABEL = "time, s"


def figures(
    common: UsblTrack,
    found: Mapping[str, Estimate],
    independent: UsblTrack,
    found_independent: Mapping[str, Estimate],
) -> tuple[Figure, ...]:
    """Draw one run: its gross errors, each axis under each method, the track seen from above.

    Parameters
    ----------
    common, found
        The track whose run of errors has a common offset, and what each method made of it.
    independent, found_independent
        The same for errors that are independent within the run.
    """
    return (
        _errors(common),
        *(_axis(common, found, axis) for axis in range(3)),
        _above(common, found),
        _run(common, found, independent, found_independent),
    )


def _errors(track: UsblTrack) -> Figure:
    """Where the gross errors stand and how large they are."""
    panels = tuple(
        Panel(
            title=name,
            x_label=_LABEL,
            y_label="gross error, m",
            traces=(
                Trace("isolated", *_stems(track, axis, ~track.burst)),
                Trace("run of 30", *_stems(track, axis, track.burst)),
            ),
        )
        for axis, name in enumerate(_AXES)
    )
    return Figure(
        key="errors", title="The gross errors added to the track (beside Fig. 6)", panels=panels
    )


def _stems(track: UsblTrack, axis: int, among: BoolArray) -> tuple[FloatArray, FloatArray]:
    """Draw each error as a line from zero."""
    rows = np.flatnonzero(track.gross & among)
    x, y = np.full(3 * rows.size, np.nan), np.full(3 * rows.size, np.nan)
    x[0::3] = x[1::3] = track.time[rows]
    y[0::3], y[1::3] = 0.0, track.error[rows, axis]
    return x, y


def _axis(track: UsblTrack, found: Mapping[str, Estimate], axis: int) -> Figure:
    """One axis: the filtered tracks, their errors, and the same errors near zero."""
    name, truth = _AXES[axis], track.position[:, axis]
    middle, half = 0.5 * (truth.max() + truth.min()), 0.5 * np.ptp(truth)
    lines = {row: found[row].position[:, axis] for row in _FIRST}
    ours = found[_OURS].position[:, axis]
    errors = tuple(Trace(row, track.time, line - truth) for row, line in lines.items())
    return Figure(
        key=f"axis-{name.lower()}",
        title=f"{name} under the four filters (beside Fig. {7 + axis})",
        panels=(
            Panel(
                title="track",
                x_label=_LABEL,
                y_label=f"{name}, m",
                traces=(
                    Trace("raw fix", track.time, track.fixes[:, axis], "raw"),
                    *(Trace(row, track.time, line) for row, line in lines.items()),
                    Trace("truth", track.time, truth, "truth"),
                ),
                y_range=(middle - half - 30.0, middle + half + 30.0),
            ),
            Panel(title="error", x_label=_LABEL, y_label="m", traces=errors),
            Panel(
                title="error, close to zero",
                x_label=_LABEL,
                y_label="m",
                traces=(*errors[2:], Trace(_OURS, track.time, ours - truth)),
                y_range=(-1.0, 1.0),
            ),
        ),
    )


def _above(track: UsblTrack, found: Mapping[str, Estimate]) -> Figure:
    x, y = track.position[:, 0], track.position[:, 1]
    gross = track.fixes[track.gross]
    panels = tuple(
        Panel(
            title=row,
            x_label="X, m",
            y_label="Y, m",
            traces=(
                Trace("gross error", gross[:, 0], gross[:, 1], "bad"),
                Trace("filtered", found[row].position[:, 0], found[row].position[:, 1]),
                Trace("truth", x, y, "truth"),
            ),
            y_range=(float(y.min()) - 35.0, float(y.max()) + 35.0),
        )
        for row in ("KF", "Huber", "IGG3", _OURS)
    )
    return Figure(key="above", title="The track seen from above", panels=panels, columns=2)


def _run(
    common: UsblTrack,
    found: Mapping[str, Estimate],
    independent: UsblTrack,
    found_independent: Mapping[str, Estimate],
) -> Figure:
    """The two kinds of run, close up."""
    return Figure(
        key="run",
        title="Error in X through the run of 30 gross errors",
        panels=tuple(
            _close_up(track, estimates, title)
            for track, estimates, title in (
                (common, found, "one common offset"),
                (independent, found_independent, "independent errors"),
            )
        ),
        columns=2,
    )


def _close_up(track: UsblTrack, found: Mapping[str, Estimate], title: str) -> Panel:
    rows = np.flatnonzero(track.burst)
    shown = slice(max(0, int(rows[0]) - 25), int(rows[-1]) + 45)
    time, truth = track.time[shown], track.position[shown, 0]
    traces = [Trace("raw fix", time, track.fixes[shown, 0] - truth, "raw")]
    traces += [Trace(row, time, found[row].position[shown, 0] - truth) for row in _FIRST]
    return Panel(title=title, x_label=_LABEL, y_label="m", traces=tuple(traces))
