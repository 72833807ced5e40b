"""The steps of `surefix.filters.kalman` over a whole series of a linear model with a fixed step.

For models that `surefix.filters.track` does not know: any F, Q and H, correlated observations.
"""

from __future__ import annotations

from typing import NamedTuple, get_args

import numpy as np
from numpy.typing import ArrayLike

from surefix.errors import OptionsError
from surefix.filters.kalman import Gaussian, Innovation, Spread, _factor, _update
from surefix.jit import kernel
from surefix.linalg import triangularize
from surefix.robust.loss import Loss, loss_named
from surefix.types import FloatArray, IntArray

__all__ = ["LinearTrack", "filter_linear"]


class LinearTrack(NamedTuple):
    """What the filter found at each of N epochs.

    Parameters
    ----------
    mean, covariance
        (N, n) and (N, n, n) after the update.
    residual
        (N, m) ``z − H x⁻``; NaN where not observed.
    nis
        (N, m) squared innovations over their variance.
    weight
        (N, m) weight the loss gave; NaN where not observed.
    """

    mean: FloatArray
    covariance: FloatArray
    residual: FloatArray
    nis: FloatArray
    weight: FloatArray


def filter_linear(
    x: Gaussian,
    z: ArrayLike,
    F: ArrayLike,
    Q: ArrayLike,
    H: ArrayLike,
    R: ArrayLike,
    loss: Loss | None = None,
    spread: Spread = "innovation",
) -> LinearTrack:
    """Predict and update at every epoch, weighing each component by itself.

    The same as calling `surefix.filters.kalman.predict` and `surefix.filters.kalman.update` in
    turn, at the speed of compiled code.

    Parameters
    ----------
    x
        State of size n one step before the first epoch.
    z
        (N, m) observations; NaN is missing.
    F, Q, H
        (n, n), (n, n) and (m, n).
    R
        (m, m), or (N, m, m) for one each epoch.
    loss, spread
        As for `surefix.filters.kalman.update`.

    Raises
    ------
    OptionsError
        Q or R is no covariance, the shapes do not agree, or the loss is Student-t.
    """
    seen = np.array(z, dtype=np.float64)
    n = len(x.mean)
    if seen.ndim != 2:
        raise OptionsError(f"z of shape {seen.shape}", "(N, m)")
    N, m = seen.shape
    loss = loss or loss_named("kalman")
    if loss.code == 6:
        raise OptionsError("loss 'student-t'", "a loss of the innovation", "use huber or igg3")
    if spread not in get_args(Spread):
        raise OptionsError(f"spread {spread!r}", "one of " + ", ".join(get_args(Spread)))
    rows, step = (np.array(A, dtype=np.float64) for A in (H, F))
    if rows.shape != (m, n) or step.shape != (n, n):
        raise OptionsError(f"H {rows.shape}, F {step.shape}", f"({m}, {n}) and ({n}, {n})")
    noise = np.asarray(R, dtype=np.float64)
    if noise.shape not in {(m, m), (N, m, m)}:
        raise OptionsError(f"R of shape {noise.shape}", f"({m}, {m}) or ({N}, {m}, {m})")
    _check(noise)
    mean, factor = np.empty((N, n)), np.empty((N, n, n))
    found = Innovation(*(np.full((N, m), np.nan) for _ in Innovation._fields))
    start = Gaussian(x.mean.copy(), np.ascontiguousarray(x.factor, dtype=np.float64).copy())
    every = np.ascontiguousarray(np.broadcast_to(noise, (N, m, m)))
    G = np.ascontiguousarray(_factor(Q, n, "Q"))
    group = np.arange(m, dtype=np.int64)
    _run(start, seen, step, G, rows, every, group, loss, spread == "noise", mean, factor, found)
    covariance = factor @ np.swapaxes(factor, 1, 2)
    return LinearTrack(mean, covariance, found.residual, found.nis, found.weight)


def _check(R: FloatArray) -> None:
    """Refuse noise that is not finite, symmetric and positive definite at every epoch."""
    known = bool(np.isfinite(R).all())
    alike = known and np.allclose(R, np.swapaxes(R, -1, -2), rtol=1e-9, atol=0.0)
    if not alike or np.linalg.eigvalsh(R).min(initial=1.0) <= 0.0:
        raise OptionsError("R", "finite, symmetric, positive definite covariances")


@kernel
def _run(
    x: Gaussian,
    z: FloatArray,
    F: FloatArray,
    G: FloatArray,
    H: FloatArray,
    R: FloatArray,
    group: IntArray,
    loss: Loss,
    by_noise: bool,
    mean: FloatArray,
    factor: FloatArray,
    found: Innovation,
) -> None:
    """Advance ``x`` in place through the series and note what every epoch gave."""
    n = F.shape[0]
    A = np.empty((n, 2 * n))
    for k in range(z.shape[0]):
        A[:, :n] = F @ x.factor
        A[:, n:] = G
        triangularize(A, n, 2 * n)
        x.factor[:, :] = A[:, :n]
        x.mean[:] = F @ x.mean
        found.residual[k] = z[k] - H @ x.mean
        row = Innovation(found.residual[k], found.nis[k], found.sigma[k], found.weight[k])
        _update(x, row, H, R[k], group, loss, by_noise)
        mean[k] = x.mean
        factor[k] = x.factor
