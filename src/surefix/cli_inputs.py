"""Options of the command line about what is read, shared by the commands that read logs."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from surefix.errors import OptionsError

if TYPE_CHECKING:
    from surefix.pipelines.options import CleanOptions

__all__ = [
    "Columns",
    "Depth",
    "Heading",
    "NoChecksum",
    "Ship",
    "Target",
    "Velocity",
    "chosen_options",
    "delays",
    "keep_inputs",
    "seconds",
]

_SECONDS = {"ms": 1e-3, "": 1.0, "s": 1.0, "min": 60.0, "h": 3600.0}

Columns = Annotated[
    list[str] | None,
    typer.Option(
        "--column",
        metavar="ROLE=COLUMN[:UNIT]",
        help="What a column means, such as time=lcm_timestamp:us or z=-depth; repeatable.",
    ),
]
Depth = Annotated[Path | None, typer.Option(help="Log of a depth sensor that supports the fixes.")]
Velocity = Annotated[
    Path | None, typer.Option(help="Log of a velocity sensor that supports the fixes.")
]
Heading = Annotated[
    Path | None, typer.Option(help="Log of a heading sensor; turns body velocities.")
]
Attitude = Annotated[
    Path | None, typer.Option(help="Log of roll and pitch; they carry lever arms.")
]
Ship = Annotated[
    list[Path] | None,
    typer.Option(
        help="Log with position or heading of the ship that an acoustic system is on, where they "
        "are not in its own; repeatable, the best first."
    ),
]
NoChecksum = Annotated[
    bool, typer.Option("--no-checksum", help="Accept NMEA sentences without a checksum.")
]
Target = Annotated[
    str | None,
    typer.Option(
        help="Whose fixes to take from an acoustic log: a transponder, or ship; "
        "default the transponder seen most often."
    ),
]


def keep_inputs(inputs: list[Path], outputs: list[Path]) -> None:
    """Refuse to write over what is read.

    Raises
    ------
    OptionsError
        An output is also an input.
    """
    read = {path.resolve() for path in inputs}
    for path in outputs:
        if path.resolve() in read:
            raise OptionsError(f"output {path} is also an input", "another name")


def chosen_options(
    file: Path | None, given: dict[str, Any], delays: dict[str, float]
) -> tuple[CleanOptions, dict[str, str]]:
    """Options of the file, over which those of the command line win, and columns of the file.

    Raises
    ------
    InputError, OptionsError
        The file cannot be read, or an option is wrong.
    """
    from surefix.io.options_file import OptionsFile, read_options
    from surefix.pipelines.options import options_from

    stored = read_options(file) if file is not None else OptionsFile({}, {})
    words = {name: value for name, value in given.items() if value is not None}
    if delays:
        words["sensor_delay_s"] = {**stored.clean.get("sensor_delay_s", {}), **delays}
    return options_from({**stored.clean, **words}), stored.columns


def delays(words: list[str]) -> dict[str, float]:
    """Read texts NAME=DURATION; s by name.

    Raises
    ------
    OptionsError
        One of them is none.
    """
    out = {}
    for word in words:
        name, equals, duration = word.rpartition("=")
        late = seconds("--sensor-delay", duration) if equals else None
        if not name or late is None:
            raise OptionsError(f"--sensor-delay {word!r}", "NAME=DURATION, such as usbl=1.3s")
        out[name] = late
    return out


def seconds(option: str, text: str | None) -> float | None:
    """Read the duration, such as 0.5s, 200ms or 2min, that was given to an option; s.

    Raises
    ------
    OptionsError
        It is none.
    """
    if text is None:
        return None
    match = re.fullmatch(r"\s*([0-9.eE+-]+)\s*(ms|s|min|h|)\s*", text)
    try:
        if match is not None:
            return float(match[1]) * _SECONDS[match[2]]
    except ValueError:
        pass
    raise OptionsError(f"{option} {text!r}", "a duration such as 0.5s, 200ms or 2min")
