"""Fusion in textbook form: entropies by eigenvalues, weights by search, no inverse of a sum."""

import numpy as np

__all__ = ["entropy", "fused_by_gain", "fused_by_scale", "intersected"]


def entropy(P):
    """Entropy of a normal distribution: that of each principal axis, added up."""
    return float(sum(0.5 * np.log(2.0 * np.pi * np.e * v) for v in np.linalg.eigvalsh(P)))


def fused_by_gain(means, priors, posteriors):
    """Weights and mean of paper 001: what each filter learnt, as a share of what all did."""
    gains = [entropy(a) - entropy(b) for a, b in zip(priors, posteriors, strict=True)]
    weights = [g / sum(gains) for g in gains]
    mean = sum(w * m for w, m in zip(weights, means, strict=True))
    return np.array(weights), mean


def intersected(means, covariances, steps=2001):
    """Covariance intersection of two sources: the ω of a fine grid with the least trace."""
    best = None
    for omega in np.linspace(0.0, 1.0, steps):
        A = omega * np.linalg.inv(covariances[0]) + (1.0 - omega) * np.linalg.inv(covariances[1])
        P = np.linalg.inv(A)
        if best is None or np.trace(P) < np.trace(best[1]):
            y = omega * np.linalg.solve(covariances[0], means[0])
            y = y + (1.0 - omega) * np.linalg.solve(covariances[1], means[1])
            best = P @ y, P, omega
    return best


def fused_by_scale(values, scales):
    """Weighted mean by recursion: each source updates the mean of those before, as in a filter."""
    mean, variance = values[0], scales[0] ** 2
    for value, scale in zip(values[1:], scales[1:], strict=True):
        gain = variance / (variance + scale**2)
        mean = mean + gain * (value - mean)
        variance = (1.0 - gain) * variance
    return mean, variance
