"""The Rauch–Tung–Striebel smoother as in the textbooks, in plain NumPy.

Särkkä 2013, *Bayesian Filtering and Smoothing*, theorem 8.2.
"""

import numpy as np


def smooth(means, covariances, F, Q):
    """Smooth filtered means (N, n) and covariances (N, n, n).

    F and Q (N, n, n) lead to step k from k − 1, as in `reference.kalman.run`. Returns smoothed
    means (N, n) and covariances (N, n, n).
    """
    means, covariances = means.copy(), covariances.copy()
    for k in range(len(means) - 2, -1, -1):
        predicted = F[k + 1] @ means[k]
        spread = F[k + 1] @ covariances[k] @ F[k + 1].T + Q[k + 1]
        gain = np.linalg.solve(spread, F[k + 1] @ covariances[k]).T
        means[k] = means[k] + gain @ (means[k + 1] - predicted)
        covariances[k] = covariances[k] + gain @ (covariances[k + 1] - spread) @ gain.T
    return means, covariances
