"""How likely observations are under several hypotheses: what accounts of them are compared by."""

from __future__ import annotations

from surefix.filters.hypotheses import Prior, no_hypotheses
from surefix.filters.multi_hypothesis import filter_hypotheses
from surefix.filters.records import Epochs, Motion

__all__ = ["BEGIN", "BRIEFLY", "evidence"]

BEGIN = 3  # epochs whose likelihood is that of the start
BRIEFLY = 16  # hypotheses that are enough to compare


def evidence(
    motion: Motion, prior: Prior, epochs: Epochs, most: int = BRIEFLY, *, begin: int = 0
) -> float:
    """Log-likelihood of epochs under a motion and what is supposed of wrong fixes.

    Parameters
    ----------
    motion, prior, epochs
        As for the filter.
    most
        Hypotheses kept; one takes every fix for good.
    begin
        So many epochs at the beginning do not count.
    """
    _, found, _ = filter_hypotheses(
        motion, prior, epochs, no_hypotheses(motion, most), traced=False
    )
    return float(found.evidence[begin:].sum())
