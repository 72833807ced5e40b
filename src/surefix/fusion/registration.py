"""Registration: the systematic errors of radars, from targets they see together.

A radar measures ``m = polar(x) + b + noise`` with constant errors b of range, azimuth and
elevation. Two ways to find b:

`reference_bias`, in real time
    Against a better position of the target (satellite navigation, a registered radar) the
    difference in the radar's own coordinates is b plus noise, and its running median is b, whatever
    a minority of wild measurements says (paper 004 registers with its real-time median).
`register`, without a reference
    Several radars that see the target at the same times contradict each other by their errors
    alone. With J the Jacobian of radar i and x̂ the target's position by all of them,

        p_i(m − b) − x̂ = J_i δb_i − Σ_j W_j J_j δb_j / Σ_j W_j + noise,

    is solved by Gauss–Newton with the unknown positions eliminated. Epochs of a large misfit are
    down-weighted, because a wild measurement of either radar spoils them.

How well b can be told apart depends on the geometry: radars at one place only show the difference
of their errors. A weak prior keeps the solution bounded, and the covariance says what is known.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import chdtri

from surefix.cleaning.running_median import running_median
from surefix.errors import OptionsError
from surefix.models.radar import Site, polar_difference, polar_jacobian, to_cartesian, to_polar
from surefix.robust.loss import Loss, loss_named, weights
from surefix.types import FloatArray

__all__ = ["Registration", "RunningBias", "reference_bias", "register"]

_MAD = 1.4826022185056018  # σ of a normal distribution over its median absolute deviation
_SWEEPS = 50
_SETTLED = 1e-4  # change of an error, in its standard deviations, at which the solution stands


class RunningBias(NamedTuple):
    """Systematic errors as known after each measurement.

    Parameters
    ----------
    bias
        (n, 3) range m, azimuth rad, elevation rad; NaN before the first measurement.
    sigma
        (n, 3) standard deviation of each: that of the median of the noise.
    """

    bias: FloatArray
    sigma: FloatArray


class Registration(NamedTuple):
    """Systematic errors of s radars.

    Parameters
    ----------
    bias
        (s, 3) range m, azimuth rad, elevation rad: subtract them from the measurements.
    covariance
        (3s, 3s) of all of them.
    scale
        Robust size of the misfits over what the stated noise lets expect; 1 if it is honest. The
        covariance contains it.
    weight
        (n,) weight of each epoch; NaN where fewer than two radars measured.
    """

    bias: FloatArray
    covariance: FloatArray
    scale: float
    weight: FloatArray


def reference_bias(measured: ArrayLike, position: ArrayLike, at: Site, window: int) -> RunningBias:
    """Median systematic error of one radar in the last measurements, by a reference.

    Parameters
    ----------
    measured
        (n, 3) range m, azimuth rad, elevation rad; NaN is missing.
    position
        (n, 3) m, where the target was by the reference; NaN is missing.
    at
        The radar.
    window
        Measurements in the median, at least 1. At equal times of n radars, O(log window) each.
    """
    off = polar_difference(measured, to_polar(position, at))
    bias = running_median(off, window, centred=False)
    spread = _MAD * running_median(np.abs(off - bias), window, centred=False)
    seen = np.cumsum(np.isfinite(off), axis=0)
    count = seen - np.concatenate([np.zeros_like(seen[:window]), seen])[: len(seen)]
    sigma = spread * np.sqrt(0.5 * math.pi / np.maximum(count, 1))
    return RunningBias(bias, sigma)


def register(
    measured: Sequence[ArrayLike],
    sites: Sequence[Site],
    sigma: ArrayLike,
    *,
    loss: Loss | None = None,
    prior: ArrayLike = (1000.0, 0.05, 0.05),
) -> Registration:
    """Systematic errors of all radars from common targets, by robust least squares.

    Parameters
    ----------
    measured
        One (n, 3) of each radar, at the same n times: range m, azimuth rad, elevation rad. Rows
        with a NaN are missing. Several targets are rows like any other.
    sites
        The radars, at least two.
    sigma
        (s, 3) or (3,) standard deviations of the noise: m, rad, rad.
    loss
        Weight of an epoch by its misfit (`surefix.robust.loss.loss_named`); IGG3 by default, and
        ``loss_named("kalman")`` for plain least squares.
    prior
        (3,) standard deviations of the systematic errors before anything is measured.

    Raises
    ------
    OptionsError
        Fewer than two radars, or not as many series as sites.
    """
    z = np.array([np.asarray(each, dtype=np.float64) for each in measured])
    radars = len(sites)
    if radars < 2 or len(z) != radars:
        raise OptionsError(f"{len(z)} series of {radars} radars", "a series of each of two or more")
    noise = np.broadcast_to(np.asarray(sigma, dtype=np.float64), (radars, 3))
    loss = loss or loss_named("igg3")
    known = np.isfinite(z).all(axis=-1)
    use = known.sum(axis=0) >= 2
    seen = known[:, use]
    z = np.where(seen[..., None], z[:, use], 1.0)
    prior_information = np.diag(np.tile(np.asarray(prior, dtype=np.float64) ** -2.0, radars))
    bias, scale, weight = np.zeros((radars, 3)), 1.0, np.ones(int(use.sum()))
    covariance = np.linalg.inv(prior_information)
    for _ in range(_SWEEPS if weight.size else 0):
        N, g, misfit, degrees = _normal(z - bias[:, None], seen, sites, noise)
        scale = math.sqrt(float(np.median(misfit / chdtri(degrees, 0.5))))
        weight = weights(_normalised(misfit / scale**2, degrees), 1, loss)
        information = np.einsum("k,kij->ij", weight, N) / scale**2 + prior_information
        covariance = np.linalg.inv(information)
        gradient = np.einsum("k,ki->i", weight, g) / scale**2 - prior_information @ bias.ravel()
        change = covariance @ gradient
        bias += change.reshape(bias.shape)
        if np.all(np.abs(change) <= _SETTLED * np.sqrt(np.diag(covariance))):
            break
    told = np.full(len(use), np.nan)
    told[use] = weight
    return Registration(bias, np.asarray(covariance, dtype=np.float64), scale, told)


def _normal(
    z: FloatArray, seen: np.ndarray, sites: Sequence[Site], noise: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Normal matrix (n, 3s, 3s), gradient (n, 3s), misfit (n,) and degrees of freedom of epochs.

    The errors of the radars are known up to the target's position, which is eliminated.
    """
    radars, n = len(sites), z.shape[1]
    J = np.stack([polar_jacobian(each, at) for each, at in zip(z, sites, strict=True)])
    p = np.stack([to_cartesian(each, at) for each, at in zip(z, sites, strict=True)])
    # information of each position, and of the errors as seen through it: JᵀWJ = diag σ⁻²
    inverse = np.linalg.inv(J)
    own = noise**-2.0
    W = np.einsum("sk,skai,sa,skaj->skij", seen, inverse, own, inverse)
    centre_covariance = np.linalg.inv(W.sum(axis=0))
    centre = np.einsum("kij,skjl,skl->ki", centre_covariance, W, p)
    off = p - centre
    WJ = W @ J
    N = -np.einsum("skai,kab,tkbj->ksitj", WJ, centre_covariance, WJ)
    for s in range(radars):
        N[:, s, :, s] += seen[s][:, None, None] * np.diag(own[s])
    gradient = np.einsum("skai,ska->ksi", WJ, off)
    misfit = np.einsum("ski,skij,skj->k", off, W, off)
    degrees = 3.0 * (seen.sum(axis=0) - 1.0)
    size = 3 * radars
    return N.reshape(n, size, size), gradient.reshape(n, size), misfit, degrees


def _normalised(misfit: FloatArray, degrees: FloatArray) -> FloatArray:
    """χ² values as squares of a standard normal (Wilson and Hilferty); 0 below the middle."""
    share = 2.0 / (9.0 * degrees)
    off = (np.cbrt(misfit / degrees) - (1.0 - share)) / np.sqrt(share)
    return np.asarray(np.maximum(off, 0.0) ** 2)
