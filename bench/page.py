"""The page of the benchmark and its chart, from what was measured."""

from __future__ import annotations

import math
from html import escape

from contest import Contest, Standing

__all__ = ["aims_of", "chart", "page"]

Results = list[tuple[Contest, list[Standing]]]

WIDE, ROW, LEFT, RIGHT = 860, 17, 330, 90  # px
BLUE, GREY, INK = "#1f5fae", "#b9bec6", "#333333"
FONT = "font-family='system-ui, Segoe UI, Helvetica, Arial, sans-serif'"

HEAD = """# Benchmarks

Made by `make bench`, which runs everything side by side in one process: each round times every
contestant in turn, the best of five short runs, so that all see the same machine. A cost is the
median of the rounds with its quartiles; ratios are medians of ratios within a round. *Differs* is
the largest difference of any figure from ours, as a share of the largest figure.

"""

NOTES = """
## What is compared

- **Kalman filter**: means and covariances of all epochs. C is `bench/kalman.c`, the conventional
  covariance form with sizes known to the compiler, `gcc -O3 -march=native`. Ours also gives
  innovations and their squares. statsmodels takes one component at a time and is exact at every
  epoch (`tolerance=0`). JAX is compiled and warm, in double precision; dynamax adds a little to the
  diagonal of what it inverts, which is its difference.
- **IGG3**: observations with 5 % wild values. FilterPy with a gate is another method, and its
  figures are not compared.
- **One call an epoch**: state and covariance come back to Python each time.
- **Running median**: normal noise, compared where the whole window lies inside the series.
- **Tracks**: means and covariances of all tracks. Without weights and with the same gaps all
  tracks have one covariance. Ours finds that out from the observations, computes it once and gives
  one array that is seen by every track; `vmap` computes it once, too, and writes it for each. What
  the system takes to find the memory is a large part of the time. Where each track has gaps of its
  own, each has covariances of its own; dynamax knows no gaps.
- **Hampel**: the peer computes in single precision.
- **Hypotheses** and the filter and smoother of `surefix clean` have no peer that does the same.
"""


def aims_of(contest: Contest, standings: list[Standing]) -> list[tuple[str, bool]]:
    """What is aimed at, in words, and whether it is reached."""
    ours, others = standings[0], {each.name: each for each in standings[1:]}
    found = []
    for name, share in contest.aims.items():
        rivals = list(others.values()) if name == "fastest" else [others[name]] * (name in others)
        if not rivals:
            continue
        factor = min(each.times_ours for each in rivals)
        who = "the fastest peer" if name == "fastest" else name
        if share >= 1.0:
            text = f"at most {share:g} × {who}: {1.0 / factor:.2f} ×"
        else:
            text = f"{1.0 / share:,.0f} × sooner than {who}: {_number(factor)} ×"
        found.append((text, 1.0 / factor <= share))
    if contest.limit is not None:
        text = f"at most {contest.limit:g} {contest.unit}: {_number(ours.cost)}"
        found.append((text, ours.cost <= contest.limit))
    return found


def page(about: dict[str, str], results: Results) -> str:
    """The whole page."""
    parts = [HEAD, "![Cost of every contestant as a multiple of ours](benchmarks.svg)\n"]
    parts += ["\n## Results\n", *(_section(*each) for each in results)]
    parts += [_faster(results), NOTES, "\n## Machine and versions\n\n| | |\n|---|---|\n"]
    parts += [f"| {name} | {value} |\n" for name, value in about.items()]
    return "".join(parts)


def _section(contest: Contest, standings: list[Standing]) -> str:
    lines = [
        f"\n### {contest.name}\n",
        f"| | {contest.unit} | quartiles | × ours | differs |",
        "|---|---|---|---|---|",
    ]
    for each in standings:
        same = "–" if each.agreement is None or each is standings[0] else f"{each.agreement:.0e}"
        lines.append(
            f"| {each.name} | {_number(each.cost)} | {_number(each.low)} … {_number(each.high)} "
            f"| {_number(each.times_ours)} | {same} |"
        )
    aims = aims_of(contest, standings)
    if aims:
        lines.append("")
        lines += [f"- {aim}{'' if reached else ' – **missed**'}" for aim, reached in aims]
    if contest.skipped:
        lines.append("")
        lines += [f"- {name} was skipped: {why}" for name, why in contest.skipped.items()]
    return "\n".join(lines) + "\n"


def _faster(results: Results) -> str:
    """Name every peer that is faster anywhere."""
    lines = [
        f"- {each.name}, {contest.name}: {1.0 / each.times_ours:.2f} × our speed"
        for contest, standings in results
        for each in _peers(standings)
        if each.times_ours < 1.0
    ]
    return "\n## Where a peer is faster\n\n" + ("\n".join(lines) or "Nowhere in this run.") + "\n"


def _peers(standings: list[Standing]) -> list[Standing]:
    """The contestants that are not ours."""
    return [each for each in standings[1:] if not each.name.startswith(("surefix", "its "))]


def chart(results: Results) -> str:
    """Bars on a logarithmic scale: how many times our cost each peer takes."""
    rows: list[tuple[str, str, float]] = []
    for contest, standings in results:
        rows += [
            (contest.name if i == 0 else "", each.name, each.times_ours)
            for i, each in enumerate(_peers(standings))
        ]
    most = max((each for *_, each in rows), default=10.0)
    low, high = -1.0, max(1.0, math.ceil(math.log10(most)))
    span = WIDE - LEFT - RIGHT

    def place(times: float) -> float:
        return LEFT + span * (max(math.log10(times), low) - low) / (high - low)

    height = ROW * (len(rows) + sum(1 for name, *_ in rows if name)) + 44
    out = [
        f"<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 {WIDE} {height}' {FONT}"
        f" font-size='11' fill='{INK}'>",
        "<title>Cost of every contestant as a multiple of the cost of surefix</title>",
        f"<rect width='{WIDE}' height='{height}' fill='#ffffff'/>",
    ]
    for power in range(int(low), int(high) + 1):
        x = place(10.0**power)
        bold = " stroke-width='1.6'" if power == 0 else ""
        out.append(
            f"<line x1='{x:.1f}' x2='{x:.1f}' y1='8' y2='{height - 30}' stroke='#dddddd'{bold}/>"
            f"<text x='{x:.1f}' y='{height - 14}' text-anchor='middle'>{10.0**power:g} ×</text>"
        )
    y = 8.0
    for name, who, times in rows:
        if name:
            y += ROW
            out.append(f"<text x='8' y='{y - 4:.1f}' font-weight='600'>{escape(name)}</text>")
        y += ROW
        one, end = place(1.0), place(times)
        colour = BLUE if times >= 1.0 else "#c8372d"
        out.append(
            f"<text x='{LEFT - 8}' y='{y - 4:.1f}' text-anchor='end'>{escape(who)}</text>"
            f"<rect x='{min(one, end):.1f}' y='{y - 13:.1f}' width='{abs(end - one):.1f}'"
            f" height='11' fill='{colour}'/>"
            f"<text x='{max(one, end) + 5:.1f}' y='{y - 4:.1f}'>{_number(times)}</text>"
        )
    return "\n".join([*out, "</svg>\n"])


def _number(value: float) -> str:
    """Three figures."""
    if value >= 100.0:
        return f"{value:,.0f}"
    return f"{value:.3g}"
