"""The methods compared on a towed survey, and their figures of merit (paper 002)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final, NamedTuple

import numpy as np

from surefix.filters.towed import TowedTrack, filter_towed, smooth_towed
from surefix.geo.angle import wrap
from surefix.metrics import normalised_squares, rmse
from surefix.models.towed import offset
from surefix.papers.towed_hypotheses import smooth_several
from surefix.robust.loss import loss_named
from surefix.simulate.towed import TowedSurvey
from surefix.types import BoolArray, FloatArray

__all__ = [
    "AGAIN_S",
    "METHODS",
    "Estimate",
    "estimate",
    "estimate_several",
    "measured_rmse",
    "nees",
    "position_rmse",
    "state_rmse",
    "stretches",
]

AGAIN_S: Final = 30.0
"""How long a body that came up counts as just surfaced, s."""

_SWEEPS: Final = 100
METHODS: Final[Mapping[str, Mapping[str, Any]]] = {
    "KF": {},
    "M eqs 19": {"loss": "huber"},
    "M iterated, W₂": {"loss": "huber", "sweeps": _SWEEPS},
    "M iterated, W₁ W₂": {"loss": "huber", "state_loss": "huber", "sweeps": _SWEEPS},
    "Student-t iterated": {"loss": "student-t", "sweeps": _SWEEPS},
    "IGG3 eqs 19": {"loss": "igg3"},
    "IGG3 innovation": {"loss": "igg3", "standardise": "innovation"},
    "M iterated, W₁": {"state_loss": "huber", "sweeps": _SWEEPS},
    "oracle": {},
}
"""Options of `surefix.filters.towed.filter_towed`, the losses by name."""


class Estimate(NamedTuple):
    """What a method made of a survey.

    Parameters
    ----------
    track
        Filtered or smoothed.
    error
        (N, 6) estimate less truth: m north, m east, m/s, m/s, rad, m/s.
    """

    track: TowedTrack
    error: FloatArray

    @property
    def distance(self) -> FloatArray:
        """(N,) horizontal position error, m."""
        return np.hypot(self.error[:, 0], self.error[:, 1])


def estimate(
    survey: TowedSurvey, method: str, k0: float = 1.5, *, smooth: bool = False
) -> Estimate:
    """Run one method on one survey.

    Parameters
    ----------
    survey
        From `surefix.simulate.towed.simulate`.
    method
        One of ``METHODS``; the oracle is the Kalman filter without the bad values.
    k0
        Constant of Huber's loss.
    smooth
        Smooth backward too.
    """
    options = dict(METHODS[method])
    for side in ("loss", "state_loss"):
        if side in options:
            name = options[side]
            options[side] = loss_named(name, k0=k0 if name == "huber" else None)
    z = np.where(survey.bad, np.nan, survey.z) if method == "oracle" else survey.z
    known = survey.model, survey.rates
    track = filter_towed(
        survey.start, survey.time, z, survey.sigma, known[0], rates=known[1], **options
    )
    if smooth:
        track = smooth_towed(track, survey.time, known[0], rates=known[1])
    return _held(survey, track)


def estimate_several(survey: TowedSurvey) -> Estimate:
    """Smooth one survey by what several hypotheses decide, offline."""
    return _held(survey, smooth_several(survey))


def _held(survey: TowedSurvey, track: TowedTrack) -> Estimate:
    """Hold a track against the truth."""
    error = track.mean - survey.truth
    error[:, 0], error[:, 1] = offset(*survey.truth[:, :2].T, *track.mean[:, :2].T)
    return Estimate(track, error)


def state_rmse(found: Estimate) -> FloatArray:
    """RMSE of each state, (6,): m, m, m/s, m/s, degrees, m/s."""
    return _in_degrees(rmse(found.error))


def measured_rmse(survey: TowedSurvey) -> FloatArray:
    """RMSE of the sensors themselves, as `state_rmse`; NaN for the current."""
    error = np.full((len(survey.time), 6), np.nan)
    error[:, 0], error[:, 1] = offset(*survey.truth[:, :2].T, *survey.z[:, :2].T)
    error[:, 4] = wrap(survey.z[:, 2] - survey.truth[:, 4], 2.0 * np.pi)
    error[:, 5] = survey.z[:, 3] - survey.truth[:, 5]
    return _in_degrees(rmse(error))


def position_rmse(found: Estimate, rows: BoolArray) -> float:
    """Horizontal position RMSE over some epochs, m."""
    return float(rmse(found.distance[rows, None])[0])


def stretches(survey: TowedSurvey, found: Estimate) -> list[float]:
    """Position RMSE at the surface, in the first seconds there after a dive, and below, m."""
    up = survey.time[1:][np.diff(survey.surfaced.astype(np.int64)) == 1]
    since = survey.time[:, None] - up
    again = ((since >= 0.0) & (since < AGAIN_S)).any(axis=1)
    return [position_rmse(found, rows) for rows in (survey.surfaced, again, ~survey.surfaced)]


def nees(found: Estimate) -> list[float]:
    """Mean NEES of all states (6), position, current, and heading with speed (2 each)."""
    error, P = found.error, found.track.covariance
    parts = (slice(0, 6), slice(0, 2), slice(2, 4), slice(4, 6))
    return [float(normalised_squares(error[:, p], P[:, p, p]).mean()) for p in parts]


def _in_degrees(errors: FloatArray) -> FloatArray:
    errors[4] = np.degrees(errors[4])
    return errors
