"""Options of a fleet."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from surefix.errors import OptionsError
from surefix.io.writers import SUFFIXES
from surefix.pipelines.options import CleanOptions

__all__ = ["TRACK", "FleetOptions"]

TRACK = "track_id"
"""Column that names the track, unless the options say otherwise."""


@dataclass(frozen=True, kw_only=True)
class FleetOptions:
    """How a fleet is cleaned.

    Parameters
    ----------
    clean
        Of every log or track.
    columns
        What columns mean, as for a single log.
    beside
        Role (``depth``, ``velocity``, ``heading``, ``attitude``) and file name of the logs that
        stand in the folder of each log and support it.
    require_checksum
        False accepts NMEA sentences without a checksum.
    target
        Whose fixes to take from acoustic logs; None for the transponder seen most often.
    track
        Column that says which track a row of a data set belongs to; default `TRACK`, where there is
        one.
    suffix
        Of the outputs of logs; those of tracks are Parquet files.
    jobs
        Processes.
    """

    clean: CleanOptions = field(default_factory=CleanOptions)
    columns: Mapping[str, str] = field(default_factory=dict)
    beside: Mapping[str, str] = field(default_factory=dict)
    require_checksum: bool = True
    target: str | None = None
    track: str | None = None
    suffix: str = ".parquet"
    jobs: int = 1

    def __post_init__(self) -> None:
        if self.jobs < 1:
            raise OptionsError(f"jobs = {self.jobs}", "one process or more")
        if self.suffix not in SUFFIXES:
            raise OptionsError(f"suffix {self.suffix!r}", "one of " + ", ".join(SUFFIXES))
