"""What is in a log: sensors, rates, gaps, faults, suspicious values, and the command that fits."""

from __future__ import annotations

import math
import shlex
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from surefix.pipelines.clean import clean_sources
from surefix.pipelines.inputs import Progress, open_inputs
from surefix.pipelines.options import CleanOptions, Mode
from surefix.pipelines.summary import said, span, summary
from surefix.report.headline import counts as counts_of
from surefix.types import Cleaned, Event, FloatArray, Log, Verdict, Verdicts

__all__ = ["describe", "info_lines"]

_LARGE = 64 << 20  # bytes; larger inputs are looked through in real time, not as a whole


def describe(
    inputs: Sequence[str | Path],
    *,
    depth: str | Path | None = None,
    velocity: str | Path | None = None,
    heading: str | Path | None = None,
    attitude: str | Path | None = None,
    ship: Sequence[str | Path] = (),
    columns: Mapping[str, str] | None = None,
    require_checksum: bool = True,
    target: str | None = None,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Look a log through and say what is in it, ready for JSON.

    Parameters
    ----------
    inputs, depth, velocity, heading, attitude, ship, columns, require_checksum, target, progress
        As `surefix.pipelines.inputs.open_inputs`.
    """
    counts: dict[str, dict[str, int]] = {}
    sources = open_inputs(
        inputs,
        depth=depth,
        velocity=velocity,
        heading=heading,
        attitude=attitude,
        ship=ship,
        columns=columns,
        require_checksum=require_checksum,
        target=target,
        progress=progress,
    )
    sources = [
        source._replace(logs=_counting(source.logs, counts.setdefault(source.name, {})))
        for source in sources
    ]
    size = sum(Path(path).stat().st_size for path in inputs if Path(path).exists())
    mode: Mode = "realtime" if size > _LARGE else "offline"
    cleaned = clean_sources(sources, CleanOptions(mode=mode))
    found = summary(cleaned, counts_of(cleaned.verdicts))
    return {
        "inputs": list(cleaned.sources),
        "records": counts,
        "positions": _positions(cleaned),
        "series": _series(cleaned),
        "noise": found["noise"],
        "events": found["events"],
        "problems": found["problems"],
        "command": _command(
            inputs,
            [
                ("--depth", depth),
                ("--velocity", velocity),
                ("--heading", heading),
                ("--attitude", attitude),
                *(("--ship", path) for path in ship),
                ("--target", target),
            ],
            columns,
            require_checksum,
        ),
    }


def _counting(logs: Iterator[Log], counts: dict[str, int]) -> Iterator[Log]:
    """Pass logs on and add up their records by kind."""
    for log in logs:
        for kind, total in log.counts.items():
            counts[kind] = counts.get(kind, 0) + total
        yield log


def _positions(cleaned: Cleaned) -> list[dict[str, Any]]:
    out = []
    for index, name in enumerate(cleaned.sensors):
        mine = cleaned.sensor == index
        if mine.any():
            verdicts = Verdicts._make(column[mine] for column in cleaned.verdicts)
            out.append({"sensor": name, **_stream(cleaned.track.time[mine], verdicts)})
    return out


def _series(cleaned: Cleaned) -> list[dict[str, Any]]:
    return [
        {
            "sensor": channel.sensor,
            "series": channel.name,
            **_stream(channel.time, channel.verdicts),
            "lowest": _rounded(np.nanmin(channel.raw, initial=np.inf)),
            "highest": _rounded(np.nanmax(channel.raw, initial=-np.inf)),
        }
        for channel in cleaned.channels
    ]


def _stream(time: FloatArray, verdicts: Verdicts) -> dict[str, Any]:
    """Figures of one stream: span, rate, and shares of what is wrong with it."""
    n = len(verdicts.verdict)
    known = np.sort(time[np.isfinite(time)])
    steps = np.diff(known)
    steps = steps[steps > 0.0]
    share = {
        verdict.name.lower(): _rounded(float((verdicts.verdict == verdict).sum()) / max(n, 1))
        for verdict in (Verdict.MISSING, Verdict.DUPLICATE)
    }
    judged = np.isfinite(verdicts.innovation_sigma)
    suspicious = float((verdicts.innovation_sigma[judged] > 5.0).sum()) / max(int(judged.sum()), 1)
    return {
        "records": n,
        "start": _rounded(known[0]) if len(known) else None,
        "end": _rounded(known[-1]) if len(known) else None,
        "interval_s": _rounded(float(np.median(steps))) if len(steps) else None,
        "longest_gap_s": _rounded(float(steps.max())) if len(steps) else None,
        **share,
        "suspicious": _rounded(suspicious),
    }


def _rounded(value: float) -> float | None:
    return round(float(value), 6) if np.isfinite(value) else None


def _command(
    inputs: Sequence[str | Path],
    others: Sequence[tuple[str, str | Path | None]],
    columns: Mapping[str, str] | None,
    require_checksum: bool,
) -> str:
    """The `clean` command that fits these inputs."""
    stem = Path(inputs[0]).stem
    words = ["surefix", "clean", *(str(path) for path in inputs)]
    for option, path in others:
        words += [option, str(path)] if path is not None else []
    for role, column in (columns or {}).items():
        words += ["--column", f"{role}={column}"]
    if not require_checksum:
        words.append("--no-checksum")
    return shlex.join([*words, "-o", f"{stem}.clean.csv", "--report", f"{stem}.html"])


def info_lines(found: Mapping[str, Any]) -> list[str]:
    """Say what `describe` found in a few lines of text."""
    out = []
    for name, counts in found["records"].items():
        told = ", ".join(f"{total} {kind}" for kind, total in counts.items())
        out.append(f"{name}: {told or 'nothing that can be read'}")
    for stream in found["positions"]:
        out.append(f"  positions of {stream['sensor']}: {_told(stream)}")
    for stream in found["series"]:
        limits = f", {stream['lowest']} … {stream['highest']}"
        out.append(f"  {stream['sensor']} {stream['series']}: {_told(stream)}{limits}")
    out += [
        f"  noise: {n['sensor']} {n['quantity']} {n['value']:.3g} {n['unit']}"
        for n in found["noise"]
        if n["value"] is not None
    ]
    out += [f"  note: {_event(event)}" for event in found["events"][:20]]
    if len(found["events"]) > 20:
        out.append(f"  note: and {len(found['events']) - 20} more, see --json")
    for problem in found["problems"]:
        remedy = f"; {problem['remedy']}" if problem["remedy"] else ""
        out.append(
            f"  input: {problem['total']} × {problem['kind']} ({problem['example']}){remedy}"
        )
    return [*out, "to clean it:", f"  {found['command']}"]


def _event(event: Mapping[str, Any]) -> str:
    time = math.nan if event["time"] is None else event["time"]
    return said(Event(event["kind"], time, event["text"]))


def _told(stream: Mapping[str, Any]) -> str:
    parts = [f"{stream['records']} records"]
    if stream["start"] is not None:
        parts[0] += span(stream["start"], stream["end"])
    if stream["interval_s"] is not None:
        parts.append(
            f"every {stream['interval_s']:.3g} s, longest gap {stream['longest_gap_s']:.4g} s"
        )
    for word in ("missing", "duplicate", "suspicious"):
        if stream[word]:
            parts.append(f"{100.0 * stream[word]:.2g} % {word}")
    return ", ".join(parts)
