"""Covariance intersection: fusion that is safe whatever the correlation of the sources.

``P⁻¹ = Σ ωᵢ Pᵢ⁻¹``, ``x̂ = P Σ ωᵢ Pᵢ⁻¹ xᵢ`` with ``ωᵢ ≥ 0``, ``Σ ωᵢ = 1``: for consistent sources
the result is consistent for any ω and any cross-covariances. ω is chosen to make the trace or the
determinant of P least; both are convex in ω, and all problems of a stack are solved at once by a
primal-dual interior-point method.

Source: Julier and Uhlmann, A non-divergent estimation algorithm in the presence of unknown
correlations, Proc. ACC 1997; Boyd and Vandenberghe, Convex Optimization, 2004, section 11.7.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from surefix.errors import OptionsError
from surefix.fusion.track import Estimate, known_sources
from surefix.types import FloatArray

__all__ = ["Criterion", "covariance_intersection"]

Criterion = Literal["trace", "determinant"]

_ITERATIONS = 60
_GAP = 1e-11  # relative to the criterion
_KEEP = 0.95  # of the way to the boundary


def covariance_intersection(
    mean: FloatArray, covariance: FloatArray, criterion: Criterion = "trace"
) -> tuple[Estimate, FloatArray]:
    """Fuse estimates of unknown correlation.

    Parameters
    ----------
    mean, covariance
        (…, N, n) and (…, N, n, n), positive definite; a source with NaN is missing.
    criterion
        What is made least: ``trace`` (the sum of the variances) or ``determinant`` (the volume).

    Returns
    -------
    estimate, weights
        The fused estimate, NaN where no source is there, and ω (…, N).

    Raises
    ------
    OptionsError
        No such criterion.

    Examples
    --------
    >>> P = np.array([np.diag([1.0, 4.0]), np.diag([4.0, 1.0])])
    >>> fused, omega = covariance_intersection(np.zeros((2, 2)), P)
    >>> omega.round(6).tolist(), fused.covariance.round(6).tolist()
    ([0.5, 0.5], [[1.6, 0.0], [0.0, 1.6]])
    """
    if criterion not in ("trace", "determinant"):
        raise OptionsError(f"criterion {criterion!r}", "trace or determinant")
    known = known_sources(mean, covariance)
    n = mean.shape[-1]
    there = known[..., None, None]
    M = np.where(there, np.linalg.inv(np.where(there, covariance, np.eye(n))), 0.0)
    none = np.asarray(~known.any(axis=-1))[..., None]
    M = np.where(none[..., None, None], np.eye(n), M)
    omega = np.where(known, _weights(M, criterion), 0.0)
    omega = omega / np.where(none, np.nan, omega.sum(axis=-1, keepdims=True))
    P = np.linalg.inv(np.einsum("...i,...iab->...ab", np.where(none, 1.0 / n, omega), M))
    P = np.where(none[..., None], np.nan, P)
    vector = np.einsum("...i,...iab,...ib->...a", omega, M, np.where(known[..., None], mean, 0.0))
    return Estimate((P @ vector[..., None])[..., 0], P), omega


def _weights(M: FloatArray, criterion: Criterion) -> FloatArray:
    """Minimise over the simplex: Newton steps on ``∇f + ν1 − s = 0``, ``ω s = μ``, ``Σω = 1``."""
    N = M.shape[-3]
    omega = np.full(M.shape[:-2], 1.0 / N)
    start = np.linalg.inv(M.mean(axis=-3))
    M = M * np.trace(start, axis1=-2, axis2=-1)[..., None, None, None]  # now tr P = 1 at the start
    g, H = _slopes(M, omega, criterion)
    slack = np.broadcast_to(np.abs(g).mean(axis=-1, keepdims=True), omega.shape).copy()
    nu = -g.mean(axis=-1, keepdims=True)
    system = np.ones((*omega.shape[:-1], N + 1, N + 1))
    system[..., N, N] = 0.0
    for _ in range(_ITERATIONS):
        gap = (omega * slack).mean(axis=-1, keepdims=True)
        pull = 0.1 * np.maximum(gap, _GAP)  # those that are done wait for the others
        dual = g + nu - slack
        system[..., :N, :N] = H
        i = np.arange(N)
        system[..., i, i] += slack / omega
        right = np.concatenate((-dual - slack + pull / omega, np.zeros_like(nu)), axis=-1)
        step = np.linalg.solve(system, right[..., None])[..., 0]
        d_omega = step[..., :N]
        d_slack = pull / omega - slack - slack / omega * d_omega
        reach = np.minimum(_reach(omega, d_omega), _reach(slack, d_slack))
        omega = omega + reach * d_omega
        slack, nu = slack + reach * d_slack, nu + reach * step[..., N:]
        g, H = _slopes(M, omega, criterion)
        if gap.max(initial=0.0) < _GAP:
            break
        system[..., i, i] = 0.0
    return omega


def _slopes(
    M: FloatArray, omega: FloatArray, criterion: Criterion
) -> tuple[FloatArray, FloatArray]:
    """Gradient (…, N) and Hessian (…, N, N) of ``ln |P| / n`` or of ``tr P``."""
    P = np.linalg.inv(np.einsum("...i,...iab->...ab", omega, M))
    PM = P[..., None, :, :] @ M
    if criterion == "determinant":
        n = P.shape[-1]
        g = -np.trace(PM, axis1=-2, axis2=-1) / n
        return g, np.einsum("...iab,...jba->...ij", PM, PM) / n
    PMP = PM @ P[..., None, :, :]
    g = -np.trace(PMP, axis1=-2, axis2=-1)
    return g, 2.0 * np.einsum("...iab,...jba->...ij", PM, PMP)


def _reach(at: FloatArray, step: FloatArray) -> FloatArray:
    """Largest step, at most 1, that leaves all components positive, (…, 1)."""
    limit = np.where(step < 0.0, -_KEEP * at / np.where(step < 0.0, step, -1.0), 1.0)
    return np.asarray(np.minimum(1.0, limit.min(axis=-1, keepdims=True)))
