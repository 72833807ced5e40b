"""The library's front door: the same pipeline as the command line, on files or on arrays."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from surefix.io.edits import read_edits
from surefix.pipelines.clean import clean_sources
from surefix.pipelines.editing import edit_sources
from surefix.pipelines.inputs import Data, open_inputs
from surefix.pipelines.locate import Located, LocateMode, locate_sights
from surefix.pipelines.options import CleanOptions
from surefix.pipelines.survey import Survey, read_survey
from surefix.types import Cleaned

if TYPE_CHECKING:
    import pyarrow as pa

__all__ = ["clean", "locate", "to_table"]


def clean(
    data: Data,
    *,
    depth: Data | None = None,
    velocity: Data | None = None,
    heading: Data | None = None,
    attitude: Data | None = None,
    ship: Sequence[Data] = (),
    columns: Mapping[str, str] | None = None,
    target: str | None = None,
    edits: str | Path | None = None,
    options: CleanOptions | None = None,
) -> Cleaned:
    """Clean a log and give the track, and for every fix a verdict with its reason.

    Parameters
    ----------
    data
        Fixes: ``time`` (s or ISO 8601), ``x, y, z`` (m, z up) or ``lat, lon`` and ``depth`` or
        ``height``, optionally velocities and standard deviations. A path or several, or a table
        (pandas, Polars, Arrow, a mapping of names to arrays), or a list of such. Nothing of it is
        modified.
    depth, velocity, heading, attitude
        Other sensors, each of the same kinds, with their own clocks and rates.
    ship
        Logs with position and heading of the ship that an acoustic positioning system is on, where
        they are not in its own log; the one to be preferred first.
    columns
        What columns mean where their names do not say it: ``{"time": "lcm_timestamp:us"}``.
    target
        Whose fixes to take from the log of an acoustic positioning system: a transponder, or
        ``ship``; default the transponder that is seen most often.
    edits
        An edit log of ``surefix edit`` or ``surefix review``.
    options
        Mode, method and figures; see `CleanOptions`.

    Raises
    ------
    InputError, ParseError, OptionsError
        What was given, what was expected, and the remedy.

    Examples
    --------
    >>> cleaned = clean({"time": [0, 1, 2, 3], "x": [0.0, 0.9, 2.1, 3.0]})
    >>> cleaned.track.position.shape
    (4, 3)
    """
    several = isinstance(data, Sequence) and not isinstance(data, str)
    sources = open_inputs(
        list(data) if several else [data],
        depth=depth,
        velocity=velocity,
        heading=heading,
        attitude=attitude,
        ship=ship,
        columns=columns,
        target=target,
    )
    if edits is not None:
        sources = edit_sources(sources, read_edits(edits))
    return clean_sources(sources, options or CleanOptions())


def locate(data: Data, survey: Survey | str | Path, *, mode: LocateMode = "offline") -> Located:
    """Estimate positions from ranges, bearings and depths, of which any may be wrong.

    Parameters
    ----------
    data
        One table: a path, or a data frame or mapping of names to arrays.
    survey
        What its columns mean and where the receivers are, or the TOML file that says so.
    mode
        ``offline`` or ``realtime``.

    Raises
    ------
    InputError, ParseError, OptionsError
        What was given, what was expected, and the remedy.
    """
    known = survey if isinstance(survey, Survey) else read_survey(survey)
    return locate_sights(data, known, mode)


def to_table(cleaned: Cleaned) -> pa.Table:
    """Give the rows of a result as an Arrow table, with the columns of the output files.

    ``to_table(cleaned).to_pandas()`` is a data frame.

    Parameters
    ----------
    cleaned
        From `clean`.
    """
    from surefix.io.records import Batch, Form, table

    form = Form(cleaned.track.geodetic is not None, cleaned.has_depth, False)
    return table(
        Batch(cleaned.track, cleaned.verdicts, cleaned.sensors, cleaned.sensor, cleaned.row), form
    )
