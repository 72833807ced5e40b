"""Robust Kalman filters as in the papers, in plain NumPy, each component or block on its own.

Observations are ``z = Hx + v`` with independent v; a weight divides the variance, R̄ = R/w.
"""

import numpy as np

from reference import kalman, robust_weights


def igg3_update(m, P, z, H, R, k0, k1):
    """One robust update with a weight per component (paper 000, eqs 14–19).

    Weights come from the innovations over the roots of the diagonal of HPH' + R, all before the
    update. Returns m, P and the weights (d,), NaN where z is.
    """
    v = (z - H @ m) / np.sqrt(np.diag(H @ P @ H.T + R))
    w = np.where(np.isnan(z), np.nan, robust_weights.igg3_printed(np.nan_to_num(v), k0, k1))
    usable = np.where(w > 0.0, z, np.nan)
    inflated = robust_weights.bifactor(R, np.where(w > 0.0, w, 1.0))
    m, P = kalman.update(m, P, usable, H, inflated)[:2]
    return m, P, w


def igg3_run(m, P, z, H, R, F, Q, k0, k1):
    """Filter a series with `igg3_update`; means (N, n), covariances (N, n, n), weights (N, d)."""
    steps = []
    for k in range(len(z)):
        m, P, w = igg3_update(*kalman.predict(m, P, F[k], Q[k]), z[k], H, R[k], k0, k1)
        steps.append((m, P, w))
    return tuple(np.stack(column) for column in zip(*steps, strict=True))


def student_t_update(m, P, z, H, R, degrees, sweeps=5):
    """One update with Student-t noise by variational Bayes (Agamennoni, Nieto & Nebot 2012).

    The state given the weight λ and λ given the state take turns: λ = (ν + d)/(ν + E), where E is
    the expectation of (z − Hx)'R⁻¹(z − Hx). λ begins at its expectation given the prediction alone.
    Returns m, P and λ, with which a last update is made.
    """
    innovation = z - H @ m
    square = innovation @ np.linalg.solve(H @ P @ H.T + R, innovation)
    weight = robust_weights.student_t(square, degrees, z.size)
    for _ in range(sweeps):
        mean, spread = kalman.update(m, P, z, H, R / weight)[:2]
        residual = z - H @ mean
        expected = residual @ np.linalg.solve(R, residual)
        expected += np.trace(np.linalg.solve(R, H @ spread @ H.T))
        weight = robust_weights.student_t(expected, degrees, z.size)
    mean, spread = kalman.update(m, P, z, H, R / weight)[:2]
    return mean, spread, weight
