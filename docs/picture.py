"""Draw docs/dive.svg: the raw and the clean track of the demonstration dive.

Run ``python docs/picture.py``. The data are simulated, so that anyone can make the same picture.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

import surefix
from surefix.simulate.rov_dive import columns, depth_columns, simulate, velocity_columns

__all__ = ["draw", "write"]

PLACE = Path(__file__).parent / "dive.svg"
SEED = 7  # as `surefix demo`
WIDE, TALL, GAP, HEAD, FOOT, MARGIN = 430, 300, 20, 34, 30, 12  # px
INK, GREY, RED, BLUE = "#333333", "#8a8f98", "#c8372d", "#1f5fae"
FONT = "font-family='system-ui, Segoe UI, Helvetica, Arial, sans-serif'"


def draw() -> str:
    """Make the picture: the fixes joined as they came, and the clean track beside them."""
    dive = simulate(SEED)
    cleaned = surefix.clean(
        columns(dive), depth=depth_columns(dive), velocity=velocity_columns(dive)
    )
    raw, track = cleaned.raw_position[:, :2], cleaned.track.position[:, :2]
    rejected = raw[cleaned.verdicts.verdict == surefix.Verdict.REJECTED]
    jump = np.flatnonzero(cleaned.verdicts.reason == surefix.Reason.JUMP).tolist()
    middle = 0.5 * (raw.min(axis=0) + raw.max(axis=0))
    scale = float(np.min((np.array([WIDE, TALL]) - 2 * MARGIN) / np.ptp(raw, axis=0)))

    def place(points: np.ndarray, panel: int) -> np.ndarray:
        """Pixels of points (n, 2) in one of the two panels, north up."""
        x = panel * (WIDE + GAP) + 0.5 * WIDE + (points[:, 0] - middle[0]) * scale
        y = HEAD + 0.5 * TALL - (points[:, 1] - middle[1]) * scale
        return np.column_stack([x, y])

    pieces = np.split(track, jump)
    width, height = 2 * WIDE + GAP, HEAD + TALL + FOOT
    return "\n".join(
        [
            f"<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 {width} {height}' {FONT}>",
            "<title>Plan view of a simulated dive: raw fixes and clean track</title>",
            f"<rect width='{width}' height='{height}' fill='#ffffff'/>",
            _heading(0, f"Raw: {len(raw):,} USBL fixes"),
            _heading(1, f"Clean track, and {len(rejected)} rejected fixes"),
            _frame(0),
            _frame(1),
            _line(place(raw, 0), GREY, 0.8),
            _dots(place(raw, 0)),
            *(_line(place(piece, 1), BLUE, 2.0) for piece in pieces),
            _crosses(place(rejected, 1)),
            _scale_bar(0, scale),
            _scale_bar(1, scale),
            "</svg>\n",
        ]
    )


def write() -> None:
    """Write the picture."""
    PLACE.write_text(draw(), encoding="utf-8")


def _heading(panel: int, text: str) -> str:
    return (
        f"<text x='{panel * (WIDE + GAP)}' y='{HEAD - 12}' fill='{INK}' font-size='17' "
        f"font-weight='600'>{text}</text>"
    )


def _frame(panel: int) -> str:
    return (
        f"<rect x='{panel * (WIDE + GAP) + 0.5}' y='{HEAD + 0.5}' width='{WIDE - 1}' "
        f"height='{TALL - 1}' fill='#f7f8fa' stroke='#d5d8dd'/>"
    )


def _scale_bar(panel: int, scale: float) -> str:
    x, y, length = panel * (WIDE + GAP), HEAD + TALL + 18, 50.0 * scale
    return (
        f"<path d='M{x} {y - 4}v8m0-4h{length:.1f}m0-4v8' stroke='{INK}' fill='none'/>"
        f"<text x='{x + length + 8:.1f}' y='{y + 4}' fill='{INK}' font-size='13'>50 m, "
        "north up</text>"
    )


def _path(points: np.ndarray) -> str:
    return "M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in points)


def _line(points: np.ndarray, colour: str, width: float) -> str:
    return (
        f"<path d='{_path(points)}' fill='none' stroke='{colour}' stroke-width='{width}' "
        "stroke-linejoin='round'/>"
    )


def _dots(points: np.ndarray) -> str:
    """Points as strokes of no length, whose round ends are dots."""
    d = "".join(f"M{x:.1f} {y:.1f}h0" for x, y in points)
    return f"<path d='{d}' stroke='{INK}' stroke-width='2.6' stroke-linecap='round'/>"


def _crosses(points: np.ndarray) -> str:
    d = "".join(f"M{x - 3:.1f} {y - 3:.1f}l6 6m0-6l-6 6" for x, y in points)
    return f"<path d='{d}' stroke='{RED}' stroke-width='1.3' fill='none'/>"


if __name__ == "__main__":
    write()
