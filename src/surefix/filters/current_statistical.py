"""The mean-adaptive Kalman filter on the current statistical model, axis by axis.

Singer's model (`surefix.models.singer`) with the newest estimate of the acceleration as its mean ā,
and the variance that goes with it:

    x⁻ = Φ x + U â,   P⁻ = Φ P Φᵀ + 2 α σ²(â) Q,

then the ordinary update with the observed position. Φ + U [0 0 1] is the transition of constant
acceleration, so the mean is carried on as if the acceleration stayed; only the covariance knows α.
The filter follows manoeuvres, and bursts of errors with them: it is the baseline of paper 004.

Source: Zhou and Kumar 1984, J. Guidance 7, 596–602.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from surefix.errors import OptionsError
from surefix.jit import kernel
from surefix.linalg import absorb, triangularize
from surefix.models.singer import Singer, rayleigh_variance
from surefix.types import FloatArray

__all__ = ["CurrentState", "filter_current", "start_current"]

_STATES = 3


class CurrentState(NamedTuple):
    """The state of d axes.

    Parameters
    ----------
    mean
        (d, 3) position, velocity, acceleration: m, m/s, m/s².
    factor
        (d, 3, 3) factor S of each covariance S Sᵀ.
    """

    mean: FloatArray
    factor: FloatArray


def start_current(axes: int, highest: float, speed: float = 1e3) -> CurrentState:
    """Make the state of a filter that has seen nothing.

    Parameters
    ----------
    axes
        How many.
    highest
        Greatest acceleration, m/s²; its standard deviation at the start.
    speed
        Standard deviation of the velocity at the start, m/s.
    """
    sigma = np.diag([1e7, speed, highest])
    return CurrentState(np.zeros((axes, _STATES)), np.repeat(sigma[None], axes, axis=0))


def filter_current(
    model: Singer,
    highest: float,
    values: ArrayLike,
    variance: ArrayLike,
    state: CurrentState | None = None,
) -> tuple[CurrentState, FloatArray, FloatArray]:
    """Filter samples at equal steps; each step predicts, then updates.

    Parameters
    ----------
    model
        `surefix.models.singer.singer` over the step.
    highest
        Greatest acceleration a_max, m/s², above 0.
    values
        (n, d) positions in m; NaN is missing.
    variance
        m², of the observations; broadcast to the values.
    state
        From `start_current` or an earlier call; not modified. None to begin.

    Returns
    -------
    state, mean, covariance
        The state after the series; (n, d, 3) states and (n, d, 3, 3) covariances.

    Raises
    ------
    OptionsError
        ``highest`` is not positive.
    """
    if not 0.0 < highest < math.inf:
        raise OptionsError(f"highest acceleration {highest}", "a positive number of m/s²")
    z = np.ascontiguousarray(values, dtype=np.float64)
    n, axes = z.shape
    R = np.array(np.broadcast_to(np.asarray(variance, dtype=np.float64), z.shape))
    before = start_current(axes, highest) if state is None else state
    after = CurrentState(before.mean.copy(), before.factor.copy())
    mean = np.empty((n, axes, _STATES))
    factor = np.empty((n, axes, _STATES, _STATES))
    lower = np.linalg.cholesky(model.noise).astype(np.float64)
    root = math.sqrt(2.0 * model.alpha) * lower
    forward = model.transition.copy()
    forward[:, 2] += model.mean_input
    _run(model.transition, forward, root, highest, z, R, after, mean, factor)
    return after, mean, np.asarray(factor @ factor.swapaxes(-1, -2))


@kernel
def _run(
    transition: FloatArray,
    forward: FloatArray,
    root: FloatArray,
    highest: float,
    z: FloatArray,
    R: FloatArray,
    state: CurrentState,
    mean: FloatArray,
    factor: FloatArray,
) -> None:
    """``forward`` carries the mean, ``transition`` the covariance; ``root`` is √(2α) chol Q."""
    A = np.empty((3, 6))
    gain = np.empty(3)
    for i in range(z.shape[1]):
        m, S = state.mean[i], state.factor[i]
        for k in range(z.shape[0]):
            sigma = math.sqrt(rayleigh_variance(m[2], highest))
            for row in range(3):
                for column in range(3):
                    A[row, column] = 0.0
                    A[row, 3 + column] = sigma * root[row, column]
                    for l in range(3):
                        A[row, column] += transition[row, l] * S[l, column]
            triangularize(A, 3, 6)
            m[0] += forward[0, 1] * m[1] + forward[0, 2] * m[2]
            m[1] += forward[1, 2] * m[2]
            m[2] *= forward[2, 2]
            S[:, :] = A[:, :3]
            if not np.isnan(z[k, i]):
                absorb(m, S, S[0].copy(), gain, z[k, i] - m[0], R[k, i])
            mean[k, i] = m
            factor[k, i] = S
