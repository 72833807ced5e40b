"""The Kalman filter as in the textbooks, in plain NumPy: the twin of the square-root kernels.

Covariance form with Joseph's update (Bar-Shalom, Li & Kirubarajan 2001, section 5.2). No attention
is paid to speed, and none to conditioning beyond Joseph's.
"""

import numpy as np


def predict(m, P, F, Q):
    """State (n,) and covariance (n, n) one step on: Fm, FPF' + Q."""
    return F @ m, F @ P @ F.T + Q


def update(m, P, z, H, R):
    """Use the observations (d,) that are not NaN.

    Returns m, P, the innovation (d,), its covariance S (d, d) and the log-likelihood of the
    observed part. NaN rows of z leave NaN in the innovation and do nothing else.
    """
    innovation = z - H @ m
    S = H @ P @ H.T + R
    seen = ~np.isnan(z)
    if not seen.any():
        return m, P, innovation, S, 0.0
    h, r, v, s = H[seen], R[np.ix_(seen, seen)], innovation[seen], S[np.ix_(seen, seen)]
    K = np.linalg.solve(s, h @ P).T
    rest = np.eye(m.size) - K @ h
    likelihood = -0.5 * (
        v @ np.linalg.solve(s, v) + np.linalg.slogdet(s)[1] + v.size * np.log(2 * np.pi)
    )
    return m + K @ v, rest @ P @ rest.T + K @ r @ K.T, innovation, S, likelihood


def run(m, P, z, H, R, F, Q):
    """Filter observations z (N, d); each step predicts with F (N, n, n), Q (N, n, n), then updates.

    H (d, n) and R (N, d, d). Returns filtered and predicted means (N, n) and covariances (N, n, n),
    innovations (N, d), their covariances (N, d, d) and the total log-likelihood.
    """
    steps, total = [], 0.0
    for k in range(len(z)):
        before = predict(m, P, F[k], Q[k])
        m, P, innovation, S, likelihood = update(*before, z[k], H, R[k])
        steps.append((m, P, *before, innovation, S))
        total += likelihood
    return (*(np.stack(column) for column in zip(*steps, strict=True)), total)


def batch(m, P, z, H, R, F, Q):
    """Estimate all states at once by weighted least squares: the oracle of filter and smoother.

    Arguments as `run`. Solves the normal equations of prior, motion and observations (Q and R
    positive definite) and returns smoothed means (N, n) and covariances (N, n, n).
    """
    count, n = len(z), m.size
    information = np.zeros((count * n, count * n))
    vector = np.zeros(count * n)

    def add(rows, target, covariance, at):
        weight = np.linalg.inv(covariance)
        columns = np.concatenate([np.arange(k * n, (k + 1) * n) for k in at])
        information[np.ix_(columns, columns)] += rows.T @ weight @ rows
        vector[columns] += rows.T @ weight @ target

    first_mean, first_covariance = predict(m, P, F[0], Q[0])
    add(np.eye(n), first_mean, first_covariance, [0])
    for k in range(count):
        if k:
            add(np.hstack((-F[k], np.eye(n))), np.zeros(n), Q[k], [k - 1, k])
        seen = ~np.isnan(z[k])
        if seen.any():
            add(H[seen], z[k][seen], R[k][np.ix_(seen, seen)], [k])
    covariance = np.linalg.inv(information)
    blocks = covariance.reshape(count, n, count, n)
    mean = (covariance @ vector).reshape(count, n)
    return mean, np.stack([blocks[k, :, k, :] for k in range(count)])
