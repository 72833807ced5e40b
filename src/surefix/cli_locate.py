"""The command ``surefix locate``."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from surefix.errors import OptionsError, OutputError

if TYPE_CHECKING:
    from surefix.pipelines.locate import Located

__all__ = ["locate"]


def locate(
    log: Annotated[Path, typer.Argument(help="Log: CSV or Parquet.", show_default=False)],
    survey: Annotated[
        Path, typer.Option(help="TOML file: columns, receivers, motion.", show_default=False)
    ],
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", help="Where to write the positions: .csv or .parquet."),
    ] = None,
    verdicts: Annotated[
        Path | None, typer.Option(help="Where to write a verdict for every range: .csv, .parquet.")
    ] = None,
    mode: Annotated[
        Literal["offline", "realtime"],
        typer.Option(help="Whether a range is judged by the whole log or by the past."),
    ] = "offline",
    as_json: Annotated[bool, typer.Option("--json", help="Print the result as JSON.")] = False,
) -> None:
    """Positions from ranges, bearings and depths, of which any may be wrong."""
    from surefix.io.write_sights import position_table, verdict_table, write_rows
    from surefix.pipelines.locate import locate_sights
    from surefix.pipelines.survey import read_survey

    places = [place for place in (output, verdicts) if place is not None]
    _check(places, [log, survey])
    found = locate_sights(log, read_survey(survey), mode)
    if output is not None:
        write_rows(output, position_table(found.time, found.position, found.covariance, found.row))
    if verdicts is not None:
        write_rows(
            verdicts,
            verdict_table(found.time, found.row, found.sights, found.value, found.verdicts),
        )
    told = _summary(found)
    if as_json:
        told["written"] = [str(place) for place in places]
        typer.echo(json.dumps(told, indent=2, ensure_ascii=False, allow_nan=False))
        return
    for line in _lines(told):
        typer.echo(line)
    for place in places:
        typer.echo(f"wrote {place}")


def _check(places: list[Path], inputs: list[Path]) -> None:
    read = {path.resolve() for path in inputs}
    if len({path.resolve() for path in places}) < len(places):
        raise OptionsError(f"{places[0]} is named twice", "a file of its own for each output")
    for place in places:
        if place.resolve() in read:
            raise OptionsError(f"output {place} is also an input", "another name")
        if place.suffix.lower() not in (".csv", ".parquet"):
            raise OutputError(f"{place}", "a name that ends in .csv or .parquet")


def _summary(found: Located) -> dict[str, Any]:
    """Counts and figures of a result."""
    import numpy as np

    from surefix.types import Verdict

    codes = found.verdicts.verdict.reshape(found.value.shape)
    names = [verdict.name.lower() for verdict in Verdict]
    known = np.isfinite(found.covariance[:, 0, 0])
    spread = np.sqrt(np.einsum("kii->ki", found.covariance[known]))
    axes = [a for a in range(3) if known.any() and np.isfinite(spread[:, a]).any()]
    return {
        "records": len(found.time),
        "positions": int(known.sum()),
        "sigma_m": {"xyz"[a]: round(float(np.median(spread[:, a])), 4) for a in axes},
        "sights": {
            name: {
                word: int((codes[:, c] == code).sum())
                for code, word in enumerate(names)
                if (codes[:, c] == code).any()
            }
            for c, name in enumerate(found.sights)
        },
        "noise": [each._asdict() for each in found.noise],
        "problems": [each._asdict() for each in found.problems],
    }


def _lines(told: dict[str, Any]) -> list[str]:
    sigma = ", ".join(f"{axis} {value:.3g}" for axis, value in told["sigma_m"].items())
    lines = [
        f"{told['records']:,} records, {told['positions']:,} positions; median σ {sigma or '–'} m"
    ]
    for name, counts in told["sights"].items():
        lines.append(f"{name}: " + ", ".join(f"{n:,} {word}" for word, n in counts.items()))
    lines += [
        f"noise of {each['sensor']}: {each['value']:.4g} {each['unit']} ({each['source']})"
        for each in told["noise"]
    ]
    lines += [f"{each['kind']}: {each['total']:,}, {each['example']}" for each in told["problems"]]
    return lines
