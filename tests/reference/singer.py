"""Singer's model by matrix exponentials: Van Loan's discretisation.

Van Loan 1978, *Computing integrals involving the matrix exponential*.
"""

import numpy as np
from scipy.linalg import expm


def singer(alpha, dt):
    """Transition (3, 3), input of the mean (3,), noise (3, 3) for a spectral density of 1."""
    A = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, -alpha]])
    noise = np.zeros((3, 3))
    noise[2, 2] = 1.0
    block = expm(np.block([[-A, noise], [np.zeros((3, 3)), A.T]]) * dt)
    transition = block[3:, 3:].T
    with_input = expm(np.block([[A, np.array([[0.0], [0.0], [alpha]])], [np.zeros((1, 4))]]) * dt)
    return transition, with_input[:3, 3], transition @ block[:3, 3:]


def current_statistical(z, R, alpha, dt, highest, mean, covariance):
    """The mean-adaptive filter of one axis in covariance form; NaN is missing.

    Returns states (n, 3) and covariances (n, 3, 3).
    """
    F, _, Q = singer(alpha, dt)
    accelerate = np.array([[1.0, dt, dt * dt / 2.0], [0.0, 1.0, dt], [0.0, 0.0, 1.0]])
    m, P, means, covariances = np.array(mean, float), np.array(covariance, float), [], []
    for observed in z:
        variance = (4.0 - np.pi) / np.pi * max(highest - abs(m[2]), 0.0) ** 2
        m, P = accelerate @ m, F @ P @ F.T + 2.0 * alpha * variance * Q
        if not np.isnan(observed):
            S = P[0, 0] + R
            K = P[:, 0] / S
            m = m + K * (observed - m[0])
            P = np.linalg.inv(np.linalg.inv(P) + np.diag([1.0 / R, 0.0, 0.0]))
        means.append(m)
        covariances.append(P)
    return np.array(means), np.array(covariances)
