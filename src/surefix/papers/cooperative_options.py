"""Paper 001: how the experiment is run."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from surefix.errors import OptionsError
from surefix.experiment import check_least
from surefix.papers.cooperative_late import Channel
from surefix.robust.loss import Loss, loss_named
from surefix.simulate.cooperative import Formation

__all__ = ["CooperativeOptions"]


@dataclass(frozen=True, kw_only=True)
class CooperativeOptions:
    """How the experiment is run; variances are the paper's.

    Parameters
    ----------
    seed, runs
        What everything is drawn from, and how often.
    process, process_raised, process_2
        Q per iteration, m² per axis: case 1, case 1 of Figure 12, case 2.
    variance, variance_2
        R, m⁴: cases 1 and 2.
    thresholds
        T₁ and T₂ of the threshold weighting, standard deviations.
    period_s, fusion_s
        Own periods of the masters and of the fusion where messages come late, s.
    delay_s, loss, disorder_s
        Delay of a message beside the travel of sound, s; share lost; greatest further delay, s.
    """

    seed: int = 1
    runs: int = 20
    process: float = 5.0
    process_raised: float = 7.5
    process_2: float = 0.5
    variance: float = 2.5e7
    variance_2: float = 1.5e7
    thresholds: tuple[float, float] = (1.5, 4.5)
    period_s: tuple[float, float, float] = (1.0, 1.4, 1.9)
    fusion_s: float = 2.0
    delay_s: float = 0.8
    loss: float = 0.2
    disorder_s: float = 4.0

    def __post_init__(self) -> None:
        check_least(self, seed=0, runs=1)
        for name in ("process", "process_raised", "process_2", "variance", "variance_2"):
            if not 0.0 < getattr(self, name) < np.inf:
                raise OptionsError(f"{name} = {getattr(self, name)}", "a positive variance")
        if not all(0.0 < time < np.inf for time in (*self.period_s, self.fusion_s)):
            raise OptionsError("a period that is not positive", "seconds")
        if not (self.delay_s >= 0.0 and self.disorder_s >= 0.0 and 0.0 <= self.loss < 1.0):
            raise OptionsError("messages that cannot be", "delays from 0 s, loss from 0, below 1")
        self.threshold_loss  # noqa: B018  # refuses thresholds out of order

    @property
    def threshold_loss(self) -> Loss:
        """The threshold weighting of section 2.1: the loss ``igg1``."""
        return loss_named("igg1", k0=self.thresholds[0], k1=self.thresholds[1])

    @property
    def scenarios(self) -> dict[str, tuple[Formation, float]]:
        """Formations by name, and the Q per iteration that the filters expect.

        ``path``: the slave keeps to its path, as in the paper. ``noise``: it leaves it with that Q.
        """
        raised = f"Q{self.process_raised:g}"
        one, two = self.variance, self.variance_2
        found = {}
        for name, real in (("path", 0.0), ("noise", 1.0)):
            for key, case, R, Q in (
                (f"1 {name}", 1, one, self.process),
                (f"1 {name} {raised}", 1, one, self.process_raised),
                (f"2 {name}", 2, two, self.process_2),
            ):
                found[key] = Formation(case=case, squared_variance=R, process=real * Q), Q
        return found

    @property
    def channels(self) -> dict[str, Channel]:
        """What the water does to messages, from bad to worse."""
        delay, loss = self.delay_s, self.loss
        return {
            "own periods": Channel(sound=False),
            "+ delay": Channel(delay_s=delay),
            "+ loss": Channel(delay_s=delay, loss=loss),
            "+ disorder": Channel(delay_s=delay, loss=loss, disorder_s=self.disorder_s),
        }
