"""Registration by one great least-squares problem: the positions of the target are unknowns too."""

import numpy as np


def polar(x, origin):
    """Range, azimuth clockwise from north, elevation of one position seen from a level site."""
    east, north, up = x - origin
    distance = np.sqrt(east**2 + north**2 + up**2)
    return np.array([distance, np.arctan2(east, north), np.arcsin(up / distance)])


def derivative(x, origin):
    """Of `polar` by the position, by central differences of a metre."""
    steps = np.eye(3)
    columns = [(polar(x + h, origin) - polar(x - h, origin)) / 2.0 for h in steps]
    return np.column_stack(columns)


def joint_least_squares(z, origins, sigma, prior, start):
    """Errors (s, 3) and their covariance (3s, 3s); z (s, n, 3), start (n, 3) near the positions."""
    radars, n = z.shape[:2]
    x, bias = start.copy(), np.zeros((radars, 3))
    unknowns = 3 * (n + radars)
    for _ in range(8):
        rows, right = [], []
        for s in range(radars):
            for k in range(n):
                row = np.zeros((3, unknowns))
                row[:, 3 * k : 3 * k + 3] = derivative(x[k], origins[s])
                row[:, 3 * (n + s) : 3 * (n + s) + 3] = np.eye(3)
                off = z[s, k] - polar(x[k], origins[s]) - bias[s]
                off[1] = (off[1] + np.pi) % (2.0 * np.pi) - np.pi
                rows.append(row / sigma[s][:, None])
                right.append(off / sigma[s])
        for s in range(radars):
            row = np.zeros((3, unknowns))
            row[:, 3 * (n + s) : 3 * (n + s) + 3] = np.diag(1.0 / prior)
            rows.append(row)
            right.append(-bias[s] / prior)
        A = np.vstack(rows)
        scale = np.sqrt(np.sum(A * A, axis=0))
        change = np.linalg.lstsq(A / scale, np.concatenate(right), rcond=None)[0] / scale
        x += change[: 3 * n].reshape(n, 3)
        bias += change[3 * n :].reshape(radars, 3)
        if np.abs(change).max() < 1e-6:
            break
    covariance = np.linalg.inv((A / scale).T @ (A / scale)) / np.outer(scale, scale)
    return bias, covariance[3 * n :, 3 * n :]
