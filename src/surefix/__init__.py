"""Turn logs full of wild position fixes into a sure track, with a verdict for every fix.

>>> import surefix
>>> log = {"time": [0, 1, 2, 3, 4, 5, 6, 7], "x": [0, 1.1, 1.9, 3, 44, 5.1, 5.9, 7.1]}
>>> cleaned = surefix.clean(log)
>>> [surefix.Verdict(v).name for v in cleaned.verdicts.verdict][4]
'REJECTED'
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from surefix.api import clean, locate, to_table
    from surefix.errors import (
        InputError,
        MissingExtraError,
        OptionsError,
        OutputError,
        ParseError,
        SurefixError,
    )
    from surefix.pipelines.locate import Located
    from surefix.pipelines.options import CleanOptions
    from surefix.pipelines.survey import SightSource, Survey
    from surefix.types import Cleaned, Event, Noise, Problem, Reason, Track, Verdict, Verdicts

__all__ = [
    "CleanOptions",
    "Cleaned",
    "Event",
    "InputError",
    "Located",
    "MissingExtraError",
    "Noise",
    "OptionsError",
    "OutputError",
    "ParseError",
    "Problem",
    "Reason",
    "SightSource",
    "SurefixError",
    "Survey",
    "Track",
    "Verdict",
    "Verdicts",
    "clean",
    "locate",
    "to_table",
]

_HOME = {
    "CleanOptions": "surefix.pipelines.options",
    "Located": "surefix.pipelines.locate",
    "SightSource": "surefix.pipelines.survey",
    "Survey": "surefix.pipelines.survey",
    "clean": "surefix.api",
    "locate": "surefix.api",
    "to_table": "surefix.api",
    **dict.fromkeys((name for name in __all__ if name.endswith("Error")), "surefix.errors"),
}


def __getattr__(name: str) -> Any:
    """Import a public name when it is first used, so that importing surefix costs nothing."""
    if name not in __all__:
        raise AttributeError(f"module 'surefix' has no attribute {name!r}")
    return getattr(import_module(_HOME.get(name, "surefix.types")), name)
