"""Time surefix against its peers, side by side in one run: ``make bench``.

Prints a table, and writes docs/benchmarks.md, .svg and .json. Peers that are not installed are
skipped, and said so. ``--only TEXT`` runs the contests whose name contains it and writes nothing.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import warnings
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import by_hand
from contest import Contest, Standing, decide
from contests import all_contests
from page import aims_of, chart, page

DOCS = Path(__file__).parent.parent / "docs"
ROUNDS = 41
PEERS = (
    "bottleneck", "dynamax", "fast-kalman", "filterpy", "hampel", "jax", "kalman-py",
    "opencv-python-headless", "scipy", "simdkalman", "statsmodels", "stonesoup",
)  # fmt: skip


def main() -> None:
    """Run the contests."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", default="", help="contests whose name contains this")
    parser.add_argument("--rounds", type=int, default=ROUNDS)
    given = parser.parse_args()
    warnings.simplefilter("ignore")
    results: list[tuple[Contest, list[Standing]]] = []
    for make in all_contests():
        contest = make()
        if given.only not in contest.name:
            continue
        standings = decide(contest, given.rounds)
        results.append((contest, standings))
        show(contest, standings)
    if given.only:
        return
    about = machine()
    (DOCS / "benchmarks.json").write_text(record(about, results), encoding="utf-8")
    (DOCS / "benchmarks.svg").write_text(chart(results), encoding="utf-8")
    (DOCS / "benchmarks.md").write_text(page(about, results), encoding="utf-8")
    print(f"wrote {DOCS / 'benchmarks.md'}, .svg and .json")


def show(contest: Contest, standings: list[Standing]) -> None:
    """Print one contest."""
    print(f"\n{contest.name} ({contest.unit})")
    for each in standings:
        same = "" if each.agreement is None else f"  differs by {each.agreement:.0e}"
        print(
            f"  {each.name:24} {each.cost:10.3f}  [{each.low:.3f} … {each.high:.3f}]"
            f"  {each.times_ours:9.2f} × ours{same}"
        )
    for aim, reached in aims_of(contest, standings):
        print(f"    {'reached' if reached else 'MISSED '} {aim}")
    for name, why in contest.skipped.items():
        print(f"  {name}: skipped, {why}")


def machine() -> dict[str, str]:
    """What ran where."""
    about = {
        "date": datetime.now(UTC).date().isoformat(),
        "processor": _processor(),
        "cores": str(os.cpu_count()),
        "system": f"{platform.system()} {platform.machine()}",
        "load at the end": " ".join(f"{each:.1f}" for each in os.getloadavg()),
        "python": platform.python_version(),
    }
    for name in ("surefix", "numba", "numpy", *PEERS):
        try:
            about[name] = version(name)
        except PackageNotFoundError:
            about[name] = "not installed"
    try:
        about["gcc"] = by_hand.compiler()
    except FileNotFoundError:
        about["gcc"] = "not installed"
    return about


def record(about: dict[str, str], results: list[tuple[Contest, list[Standing]]]) -> str:
    """Everything that was measured, as JSON."""
    rows = [
        {
            "contest": contest.name,
            "unit": contest.unit,
            "standings": [vars(each) for each in standings],
            "aims": [
                {"aim": aim, "reached": reached} for aim, reached in aims_of(contest, standings)
            ],
            "skipped": contest.skipped,
        }
        for contest, standings in results
    ]
    return json.dumps({"machine": about, "contests": rows}, indent=1, ensure_ascii=False) + "\n"


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
        names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
        return names[0]
    except (OSError, IndexError):
        return platform.processor() or "unknown"


if __name__ == "__main__":
    main()
