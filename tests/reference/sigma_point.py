"""The unscented Kalman filter as in the textbooks, in plain NumPy: the twin of the array form.

Weights of the central point and full covariances (Särkkä 2013, Bayesian Filtering and Smoothing,
algorithm 5.12). One state at a time, one point at a time.
"""

import numpy as np


def points_and_weights(m, P, alpha, beta, kappa):
    n = m.size
    scale = alpha**2 * (n + kappa)
    L = np.linalg.cholesky(P)
    points = [m, *(m + np.sqrt(scale) * L[:, i] for i in range(n))]
    points += [m - np.sqrt(scale) * L[:, i] for i in range(n)]
    mean = np.full(2 * n + 1, 0.5 / scale)
    mean[0] = 1.0 - n / scale
    spread = mean.copy()
    spread[0] += 1.0 - alpha**2 + beta
    return points, mean, spread


def transform(m, P, function, alpha=1.0, beta=2.0, kappa=0.0):
    """Mean, covariance and cross-covariance (n, m) of a function of a Gaussian."""
    points, mean_weight, spread_weight = points_and_weights(m, P, alpha, beta, kappa)
    images = [function(point) for point in points]
    mean = sum(w * y for w, y in zip(mean_weight, images, strict=True))
    S = sum(w * np.outer(y - mean, y - mean) for w, y in zip(spread_weight, images, strict=True))
    C = sum(
        w * np.outer(x - m, y - mean) for w, x, y in zip(spread_weight, points, images, strict=True)
    )
    return mean, S, C


def predict(m, P, f, Q, **spread):
    mean, S, _ = transform(m, P, f, **spread)
    return mean, S + Q


def update(m, P, z, h, R, **spread):
    """Use the observations that are not NaN."""
    mean, S, C = transform(m, P, h, **spread)
    seen = ~np.isnan(z)
    if not seen.any():
        return m, P
    S = (S + R)[np.ix_(seen, seen)]
    K = C[:, seen] @ np.linalg.inv(S)
    return m + K @ (z - mean)[seen], P - K @ S @ K.T
