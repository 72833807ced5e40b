"""Every decision on a short series of linear sights, enumerated in plain NumPy."""

from itertools import product

import numpy as np
from scipy.special import logsumexp
from scipy.stats import cauchy, norm

ALIKE = 0.7


def enumerate_decisions(time, z, sigma, prior, q, start):
    """Mean, covariance and log-likelihood after sights of the position of one axis.

    Parameters
    ----------
    time, z
        (n,) and (n, c).
    sigma, prior, q
        Noise, a `SightPrior` that allows no restart, and the spectral density.
    start
        Mean (2,) and covariance (2, 2).
    """
    n, c = z.shape
    logs, means, covariances = [], [], []
    for taken in product((True, False), repeat=n * c):
        log, m, P = _account(time, z, sigma, prior, q, start, np.reshape(taken, (n, c)))
        logs.append(log)
        means.append(m)
        covariances.append(P)
    total = logsumexp(logs)
    w = np.exp(np.array(logs) - total)
    mean = w @ np.array(means)
    gap = np.array(means) - mean
    covariance = np.einsum("i,ijk->jk", w, np.array(covariances))
    return mean, covariance + np.einsum("i,ij,ik->jk", w, gap, gap), total


def _account(time, z, sigma, prior, q, start, taken):
    m, P = start[0].copy(), start[1].copy()
    channels = z.shape[1]
    faulty, slip = np.zeros(channels, bool), np.zeros(channels)
    log = 0.0
    for k in range(len(time)):
        if k:
            dt = time[k] - time[k - 1]
            F = np.array([[1.0, dt], [0.0, 1.0]])
            m, P = F @ m, F @ P @ F.T + q * np.array([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]])
        for c in range(channels):
            nu, S = z[k, c] - m[0], P[0, 0] + sigma**2
            out = prior.again[c] if faulty[c] else prior.wrong[c]
            if taken[k, c]:
                log += np.log1p(-out) + norm.logpdf(nu, scale=np.sqrt(S))
                gain = P[:, 0] / S
                m, P = m + gain * nu, P - np.outer(gain, P[0])
                continue
            wild = cauchy.logpdf(nu, scale=np.hypot(prior.spread[c], np.sqrt(S)))
            if faulty[c]:
                alike = norm.logpdf(nu - slip[c], scale=np.sqrt(S + sigma**2))
                wild = np.logaddexp(np.log(1.0 - ALIKE) + wild, np.log(ALIKE) + alike)
            log += np.log(out) + wild
        faulty, slip = ~taken[k], z[k] - m[0]
    return log, m, P
