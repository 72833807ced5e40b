"""Fusion of the estimates that several filters made of one state.

The errors of such estimates are correlated: the filters share the process noise of the one target,
and often their start. Stacks of N sources carry the axis of the sources before those of the
state: means (…, N, n), covariances (…, N, n, n). The joint covariance of all errors is
(…, N, N, n, n): block (i, j) is the cross-covariance of sources i and j. Leading axes (…) are
epochs, runs, anything.

A source whose mean is NaN is missing; where all are, the result is NaN.

Source: Bar-Shalom and Campo, The effect of the common process noise on the two-sensor fused-track
covariance, IEEE Trans. AES 22, 1986; Sun and Deng, Multi-sensor optimal information fusion Kalman
filter, Automatica 40, 2004 (N sources).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from surefix.types import BoolArray, FloatArray

__all__ = [
    "Estimate",
    "bar_shalom_campo",
    "inverse_covariance",
    "joint_predict",
    "joint_update",
    "known_sources",
    "weighted_mean",
]

_NEGLIGIBLE = 1e-10  # eigenvalues of differences, relative to the largest: sources that are equal


class Estimate(NamedTuple):
    """A mean, (…, n), and its covariance, (…, n, n)."""

    mean: FloatArray
    covariance: FloatArray


def known_sources(mean: FloatArray, covariance: FloatArray) -> BoolArray:
    """Tell which sources, (…, N), have an estimate."""
    return np.asarray(np.isfinite(mean).all(axis=-1) & np.isfinite(covariance).all(axis=(-2, -1)))


def weighted_mean(
    mean: FloatArray,
    covariance: FloatArray,
    weight: FloatArray,
    joint: FloatArray | None = None,
) -> Estimate:
    """Fuse by one weight per source, ``x̂ = Σ wᵢ xᵢ``, with a covariance that is honest.

    With the joint covariance it is exact, ``Σᵢⱼ wᵢ wⱼ Pᵢⱼ``. Without, it is the bound ``Σ wᵢ Pᵢ``,
    which holds for any correlation (the square is convex) and is reached when all errors are equal.

    Parameters
    ----------
    mean, covariance
        (…, N, n) and (…, N, n, n).
    weight
        (…, N), not negative; scaled to the sum one over the sources that are there.
    joint
        (…, N, N, n, n), or None where it is not known.
    """
    known = known_sources(mean, covariance)
    share = np.where(known, weight, 0.0)
    total = share.sum(axis=-1, keepdims=True)
    share = share / np.where(total > 0.0, total, np.nan)
    fused = np.einsum("...i,...ia->...a", share, np.where(known[..., None], mean, 0.0))
    if joint is None:
        kept = np.where(known[..., None, None], covariance, 0.0)
        return Estimate(fused, np.einsum("...i,...iab->...ab", share, kept))
    pair = known[..., :, None] & known[..., None, :]
    blocks = np.where(pair[..., None, None], joint, 0.0)
    return Estimate(fused, np.einsum("...i,...j,...ijab->...ab", share, share, blocks))


def inverse_covariance(mean: FloatArray, covariance: FloatArray) -> Estimate:
    """Fuse as if the errors were independent: ``P⁻¹ = Σ Pᵢ⁻¹``, ``x̂ = P Σ Pᵢ⁻¹ xᵢ``.

    The mean is often near the best; the covariance is too small wherever the sources share noise.

    Parameters
    ----------
    mean, covariance
        (…, N, n) and (…, N, n, n), positive definite.
    """
    known = known_sources(mean, covariance)[..., None]
    n = mean.shape[-1]
    filled = np.where(known[..., None], covariance, np.eye(n))
    inverse = np.where(known[..., None], np.linalg.inv(filled), 0.0)
    vector = (inverse @ np.where(known, mean, 0.0)[..., None]).sum(axis=-3)
    none = np.asarray(~known.any(axis=-2))[..., None]
    total = np.where(none, np.eye(n), inverse.sum(axis=-3))
    fused = np.linalg.inv(total)
    return Estimate(
        np.where(none[..., 0], np.nan, (fused @ vector)[..., 0]), np.where(none, np.nan, fused)
    )


def bar_shalom_campo(mean: FloatArray, covariance: FloatArray, joint: FloatArray) -> Estimate:
    """Fuse with known cross-covariances: the best linear unbiased combination of the estimates.

    One source b is taken as it is and corrected by the differences ``dⱼ = xⱼ − x_b`` to all:
    ``x̂ = x_b + W d``, ``W = (P_bb − P_b·) Cov(d)⁺``, ``P = P_bb − W (P_bb − P_b·)ᵀ``. For two
    sources this is the formula of Bar-Shalom and Campo. Sources that are equal need no care.

    Parameters
    ----------
    mean, covariance
        (…, N, n) and (…, N, n, n).
    joint
        (…, N, N, n, n), its diagonal blocks being the covariances.
    """
    known = known_sources(mean, covariance)
    base = np.argmax(known, axis=-1)[..., None]
    N, n = mean.shape[-2:]
    own = np.take_along_axis(mean, base[..., None], axis=-2)
    row = np.take_along_axis(joint, base[..., None, None, None], axis=-4)  # C_b·, (…, 1, N, n, n)
    corner = np.take_along_axis(row, base[..., None, None, None], axis=-3)  # C_bb, (…, 1, 1, n, n)
    pair = (known[..., :, None] & known[..., None, :])[..., None, None]
    column = row.mT.swapaxes(-3, -4)  # C_·b
    apart = np.where(pair, joint - column - row + corner, 0.0)
    toward = np.where(known[..., None, None], corner[..., 0, :, :, :] - row[..., 0, :, :, :], 0.0)
    flat = (*mean.shape[:-2], N * n, N * n)
    spread = apart.swapaxes(-3, -2).reshape(flat)
    across = toward.swapaxes(-3, -2).reshape(*mean.shape[:-2], n, N * n)
    gain = across @ np.linalg.pinv(_finite(spread), rcond=_NEGLIGIBLE, hermitian=True)
    off = np.where(known[..., None], mean - own, 0.0).reshape(*mean.shape[:-2], N * n, 1)
    P = corner[..., 0, 0, :, :] - gain @ across.mT
    none = np.asarray(~known.any(axis=-1))[..., None]
    fused = own[..., 0, :] + (gain @ off)[..., 0]
    return Estimate(
        np.where(none, np.nan, fused), np.where(none[..., None], np.nan, 0.5 * (P + P.mT))
    )


def joint_predict(joint: FloatArray, Q: FloatArray, F: FloatArray | None = None) -> FloatArray:
    """Predict the joint covariance: ``P_ij ← F P_ij Fᵀ + Q``, the same noise for all sources.

    Parameters
    ----------
    joint
        (…, N, N, n, n).
    Q
        (n, n), or with leading axes that broadcast.
    F
        (n, n) transition; None for the identity.
    """
    return np.asarray((joint if F is None else F @ joint @ F.T) + Q)


def joint_update(joint: FloatArray, prior: FloatArray, posterior: FloatArray) -> FloatArray:
    """Update the joint covariance after each source has updated with its own observation.

    ``P_ij ← Aᵢ P_ij Aⱼᵀ`` with ``Aᵢ = Pᵢ⁺ (Pᵢ⁻)⁻¹``, which equals ``I − Kᵢ Hᵢ`` for the gain of any
    filter of the Kalman family; the diagonal blocks are the posteriors. A source without an
    observation has ``P⁺ = P⁻``.

    Parameters
    ----------
    joint
        (…, N, N, n, n), predicted.
    prior, posterior
        (…, N, n, n) covariances of each source before and after.
    """
    kept = np.linalg.solve(prior, posterior).mT
    out = kept[..., :, None, :, :] @ joint @ kept.mT[..., None, :, :, :]
    i = np.arange(prior.shape[-3])
    out[..., i, i, :, :] = posterior
    return np.asarray(out)


def _finite(matrix: FloatArray) -> FloatArray:
    return np.where(np.isfinite(matrix), matrix, 0.0)
