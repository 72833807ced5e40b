"""What the inputs of a fleet are: single logs, or one data set of many tracks."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from surefix.errors import InputError, OptionsError
from surefix.fleet.dataset import schema_of
from surefix.fleet.options import TRACK

__all__ = ["Found", "find_inputs"]

_LOGS = {".csv", ".txt", ".tsv", ".log", ".nmea", ".parquet", ".gz"}


class Found(NamedTuple):
    """Absolute paths: of the logs, or of the files of the data set below ``root``."""

    logs: tuple[Path, ...]
    root: Path | None = None
    files: tuple[str, ...] = ()


def find_inputs(inputs: Sequence[str | Path], place: Path, track: str | None) -> Found:
    """Look at the inputs.

    A Parquet file with the column of the track, or a folder of such (or whose paths name it, as
    ``track_id=7/part-0.parquet``), is a data set; any other folder stands for the logs in it.

    Parameters
    ----------
    inputs
        Files and folders.
    place
        The folder of the outputs; what is below it is no input.
    track
        Name of the column, which must be there; None for the usual one, if it is.

    Raises
    ------
    OptionsError
        There is nothing, a data set among other inputs, or no column of that name.
    """
    logs: dict[Path, None] = {}
    for given in inputs:
        path = Path(given).absolute()
        files = _below(path, place.absolute()) if path.is_dir() else [path]
        tables = [str(file) for file in files if file.suffix.lower() == ".parquet"]
        root = path if path.is_dir() else path.parent
        if tables and _has_track(tables, str(root), track or TRACK):
            if len(inputs) > 1:
                raise OptionsError(
                    f"{given}, a data set of many tracks, beside other inputs",
                    "one data set, or logs of one track each",
                    "run them one after the other",
                )
            return Found((), root, tuple(tables))
        logs |= dict.fromkeys(file.resolve() for file in files)
    if track is not None:
        raise OptionsError(
            f"no column {track} in {', '.join(str(each) for each in inputs)}",
            "a Parquet data set with a column that names the track of each row",
        )
    if not logs:
        told = ", ".join(str(each) for each in inputs) or "no input"
        raise OptionsError(f"{told}: no log there", "files " + ", ".join(sorted(_LOGS)))
    return Found(tuple(logs))


def _below(folder: Path, place: Path) -> list[Path]:
    """Files of a folder that may be logs; hidden ones and those of the fleet itself are not."""
    return [
        file
        for file in sorted(folder.rglob("*"))
        if file.suffix.lower() in _LOGS
        and file.is_file()
        and not file.is_relative_to(place)
        and not any(part[0] in "._" for part in file.relative_to(folder).parts)
    ]


def _has_track(tables: Sequence[str], root: str, track: str) -> bool:
    try:
        return track in schema_of(tables, root, track).names
    except InputError:  # a log that cannot be read, which its own outcome will say
        return False
