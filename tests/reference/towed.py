"""The towed body in textbook form: matrix exponentials, Van Loan's integral, dense eqs 19.

Covariance form throughout, symmetric square roots, states ``[φ, λ, v_N, v_E, θ, v]`` in rad, m/s
with covariances in metres. Nothing is shared with the library but the equations of paper 002.
"""

import numpy as np
from scipy.linalg import expm, sqrtm

A_EARTH, F_EARTH = 6378137.0, 1.0 / 298.257223563
H = np.array([[1, 0, 0, 0, 0, 0], [0, 1, 0, 0, 0, 0], [0, 0, 0, 0, 1, 0], [0, 0, 0, 0, 0, 1.0]])


def dynamics(heading, speed, beta):
    """A of eq. 4."""
    s, c = np.sin(heading), np.cos(heading)
    return np.array(
        [
            [0, 0, 1, 0, -speed * s, c],
            [0, 0, 0, 1, speed * c, s],
            [0, 0, -beta, 0, 0, 0],
            [0, 0, 0, -beta, 0, 0],
            [0, 0, 0, 0, 0, 0],
            [0, 0, 0, 0, 0, 0],
        ]
    )


def discretise(A, density, dt):
    """Φ and Q of ``x' = A x + w`` over dt by Van Loan's block exponential."""
    n = len(A)
    block = np.block([[-A, density], [np.zeros((n, n)), A.T]]) * dt
    E = expm(block)
    F = E[n:, n:].T
    return F, F @ E[:n, n:]


def densities(correlation_s, current, position, heading_deg, speed):
    """Spectral densities of eq. 3's W for a current of that standard deviation."""
    q = 2.0 * current**2 / correlation_s
    return np.diag([position, position, q, q, np.radians(heading_deg) ** 2, speed**2])


def huber(v, k):
    """ψ(v)/v."""
    return np.where(np.abs(v) <= k, 1.0, k / np.maximum(np.abs(v), k))


def eqs_19(m, P, residual, H, R, k):
    """Eqs 18 and 19c–g at the prediction, where the residual of the state is 0 and W₁ = I.

    The roots are symmetric. NaN rows are left out. Returns m, P and W₂.
    """
    seen = ~np.isnan(residual)
    w = np.full(residual.size, np.nan)
    if not seen.any():
        return m, P, w
    H, R, e = H[seen], R[np.ix_(seen, seen)], residual[seen]
    root_P, root_R = sqrtm(P).real, sqrtm(R).real
    w[seen] = huber(np.linalg.inv(root_R) @ e, k)
    middle = root_P @ np.eye(len(P)) @ root_P
    s = H @ middle @ H.T + root_R @ np.diag(1.0 / w[seen]) @ root_R
    K = middle @ H.T @ np.linalg.inv(s)
    return m + K @ e, (np.eye(len(P)) - K @ H) @ middle, w


def iteration(P, residual, H, R, w_state, w):
    """One sweep of eq. 17 by its normal equations, in whitened states of Cholesky's root.

    Returns the step from the prediction.
    """
    a, b = np.linalg.inv(np.linalg.cholesky(P)), np.linalg.inv(np.linalg.cholesky(R))
    normal = a.T @ np.diag(w_state) @ a + H.T @ b.T @ np.diag(w) @ b @ H
    return np.linalg.solve(normal, H.T @ b.T @ np.diag(w) @ b @ residual)


def objective(step, P, residual, H, R, k_state, k):
    """Eq. 15 with Huber's ρ, and its gradient (eq. 16 with the sign turned)."""
    a, b = np.linalg.inv(np.linalg.cholesky(P)), np.linalg.inv(np.linalg.cholesky(R))
    parts = ((a, a @ step, k_state), (-b @ H, b @ (residual - H @ step), k))
    value, slope = 0.0, np.zeros(len(P))
    for rows, r, c in parts:
        value += np.where(np.abs(r) <= c, 0.5 * r**2, c * np.abs(r) - 0.5 * c**2).sum()
        slope += rows.T @ np.clip(r, -c, c)
    return value, slope


def metres(latitude):
    """Metres north per radian of latitude and east per radian of longitude."""
    e2 = F_EARTH * (2.0 - F_EARTH)
    w = np.sqrt(1.0 - e2 * np.sin(latitude) ** 2)
    return A_EARTH * (1.0 - e2) / w**3, A_EARTH / w * np.cos(latitude)


def go(x, north, east):
    """Move latitude and longitude by metres, with the scale halfway."""
    half = x[0] + 0.5 * north / metres(x[0])[0]
    up = north / metres(half)[0]
    return np.array([x[0] + up, x[1] + east / metres(x[0] + 0.5 * up)[1]])


def short_way(angle):
    return np.angle(np.exp(1j * angle))


def predict(x, P, dt, rates, beta, density):
    """Eqs 9a and 9b about heading and speed halfway; returns x, P, Φ and Q."""
    heading, speed = x[4] + 0.5 * rates[0] * dt, x[5] + 0.5 * rates[1] * dt
    F, Q = discretise(dynamics(heading, speed, beta), density, dt)
    along = speed * dt
    carried = F[0, 2] * x[2:4]
    after = np.concatenate((x[:2], F[2:4, 2:4] @ x[2:4], x[4:] + rates * dt))
    north, east = carried + along * np.array([np.cos(heading), np.sin(heading)])
    after[:2] = go(x, north, east)
    return after, F @ P @ F.T + Q, F, Q


def difference(x, y):
    """State y less state x, positions in metres."""
    scale = metres(0.5 * (x[0] + y[0]))
    out = y - x
    out[0], out[1] = out[0] * scale[0], short_way(out[1]) * scale[1]
    return out


def run(x, P, time, z, sigma, rates, beta, density, k):
    """Filter a log with eqs 19 as printed; means (N, 6) and covariances (N, 6, 6)."""
    steps = []
    for i in range(len(time)):
        if i:
            x, P = predict(x, P, time[i] - time[i - 1], rates[i], beta, density)[:2]
        local = z[i] - H @ x
        scale = metres(0.5 * (x[0] + z[i, 0]))
        local[:2] = local[0] * scale[0], short_way(local[1]) * scale[1]
        local[2] = short_way(local[2])
        step, P, _ = eqs_19(np.zeros(6), P, local, H, np.diag(sigma**2), k)
        x = np.concatenate((go(x, step[0], step[1]), x[2:] + step[2:]))
        steps.append((x, P))
    return tuple(np.stack(column) for column in zip(*steps, strict=True))


def smooth(means, covariances, time, rates, beta, density):
    """Rauch, Tung and Striebel's recursion, P_s = P + G (P_s' − P') Gᵀ."""
    xs, Ps = [means[-1]], [covariances[-1]]
    for i in range(len(time) - 2, -1, -1):
        x, P = means[i], covariances[i]
        dt = time[i + 1] - time[i]
        ahead, predicted, F, _ = predict(x, P, dt, rates[i + 1], beta, density)
        G = P @ F.T @ np.linalg.inv(predicted)
        step = G @ difference(ahead, xs[-1])
        xs.append(np.concatenate((go(x, step[0], step[1]), x[2:] + step[2:])))
        Ps.append(P + G @ (Ps[-1] - predicted) @ G.T)
    return np.stack(xs[::-1]), np.stack(Ps[::-1])
