"""What can be compared: the methods of `surefix clean`, and baselines of the literature beside."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final, NamedTuple

from surefix.comparison.filters import imm, sage_husa, wolf
from surefix.comparison.gnc import gnc
from surefix.errors import OptionsError
from surefix.filters.deciding import AHEAD
from surefix.pipelines.options import METHODS, Mode
from surefix.pipelines.state import Estimator

__all__ = ["BASELINES", "COMPARED", "Baseline", "cleaner_of", "works_in"]


class Baseline(NamedTuple):
    """A method that only `compare` knows: how it estimates, and in which mode."""

    estimator: Estimator
    mode: Mode


BASELINES: Final[Mapping[str, Baseline]] = MappingProxyType(
    {
        "gnc": Baseline(gnc, "offline"),
        "wolf": Baseline(wolf, "realtime"),
        "imm": Baseline(imm, "realtime"),
        "sage-husa": Baseline(sage_husa, "realtime"),
    }
)
"""Baselines by name. Noise figures and motion model are settled for them as for `igg3`."""

COMPARED: Final = (*METHODS, *BASELINES)
"""All names."""

_SETTLED_AS: Final = "igg3"


def works_in(method: str, mode: Mode) -> bool:
    """Whether a method of ``COMPARED`` works in a mode.

    Raises
    ------
    OptionsError
        There is no such method.
    """
    if method not in COMPARED:
        raise OptionsError(f"method {method!r}", "one of " + ", ".join(COMPARED))
    if method in BASELINES:
        return BASELINES[method].mode == mode
    return mode != "realtime" or not AHEAD.get(method, 0)


def cleaner_of(method: str) -> tuple[str, Estimator | None]:
    """Give the method of `CleanOptions`, and what estimates in its place if it is a baseline."""
    if method in BASELINES:
        return _SETTLED_AS, BASELINES[method].estimator
    return method, None
