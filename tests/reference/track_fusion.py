"""Fusion of correlated estimates by generalised least squares, and the joint error of filters.

The twins of `surefix.fusion`: everything as one large linear system, nothing recursive.
"""

import numpy as np


def stacked(joint):
    """(N, N, n, n) blocks as one (N·n, N·n) matrix."""
    N, _, n, _ = joint.shape
    return np.block([[joint[i, j] for j in range(N)] for i in range(N)]).reshape(N * n, N * n)


def best_linear(means, joint):
    """Minimise the variance of an unbiased combination: ``(EᵀC⁻¹E)⁻¹ EᵀC⁻¹ x``."""
    N, n = means.shape
    C, E = stacked(joint), np.tile(np.eye(n), (N, 1))
    P = np.linalg.inv(E.T @ np.linalg.solve(C, E))
    return P @ E.T @ np.linalg.solve(C, means.ravel()), P


def two_sources(x1, x2, P1, P2, P12):
    """Bar-Shalom and Campo's formula."""
    gain = (P1 - P12) @ np.linalg.inv(P1 + P2 - P12 - P12.T)
    return x1 + gain @ (x2 - x1), P1 - gain @ (P1 - P12).T


def combination(means, joint, weights):
    """A weighted mean and its covariance by one matrix: ``W x`` and ``W C Wᵀ``."""
    n = means.shape[1]
    W = np.hstack([w * np.eye(n) for w in weights])
    return W @ means.ravel(), W @ stacked(joint) @ W.T


def joint_of_filters(P0, Q, H, R, steps):
    """Joint covariance of N local Kalman filters, errors written out in all noises.

    Every filter starts from one guess of covariance P0, is driven by the same noise Q, and sees
    ``z_i = H_i x + v_i``, v of covariance R_i, at each step. The state does not move otherwise.
    """
    N, n = len(H), len(P0)
    sizes = [n, *([n] * steps), *([len(r) for r in R] * steps)]
    noise = np.zeros((sum(sizes), sum(sizes)))
    begin = np.concatenate(([0], np.cumsum(sizes)))
    for b, c in zip(begin, [P0, *([Q] * steps), *(list(R) * steps)], strict=False):
        noise[b : b + len(c), b : b + len(c)] = c
    rows = [np.zeros((n, sum(sizes))) for _ in range(N)]
    P = [P0.copy() for _ in range(N)]
    for i in range(N):
        rows[i][:, :n] = np.eye(n)
    for k in range(steps):
        for i in range(N):
            at = begin[1 + k]
            rows[i][:, at : at + n] -= np.eye(n)
            P[i] = P[i] + Q
            K = P[i] @ H[i].T @ np.linalg.inv(H[i] @ P[i] @ H[i].T + R[i])
            rows[i] = rows[i] - K @ H[i] @ rows[i]
            at = begin[1 + steps + k * N + i]
            rows[i][:, at : at + len(R[i])] += K
            P[i] = P[i] - K @ H[i] @ P[i]
    return np.array([[a @ noise @ b.T for b in rows] for a in rows]), np.array(P)
