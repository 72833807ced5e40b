"""Other libraries' unscented filters on ranges and bearings from three platforms."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from problems import Sighted

Run = Callable[[], tuple[np.ndarray, np.ndarray]]


def filterpy(problem: Sighted) -> Run:
    """FilterPy's, with scaled points."""
    from filterpy.kalman import MerweScaledSigmaPoints, UnscentedKalmanFilter

    def h(x: np.ndarray) -> np.ndarray:
        off = x[:2] - problem.platforms
        ranges, bearings = np.hypot(off[:, 0], off[:, 1]), np.arctan2(off[:, 0], off[:, 1])
        return np.stack((ranges, bearings), axis=1).ravel()

    def run() -> tuple[np.ndarray, np.ndarray]:
        points = MerweScaledSigmaPoints(4, alpha=1.0, beta=2.0, kappa=0.0)
        f = UnscentedKalmanFilter(4, 6, 0.5, h, lambda x, _: problem.F @ x, points)
        f.x, f.P, f.Q, f.R = problem.mean, problem.covariance, problem.Q, problem.R
        out = []
        for z in problem.z:
            f.predict()
            # as printed the points are drawn anew from the prediction, noise included
            f.sigmas_f = points.sigma_points(f.x, f.P)
            f.update(z)
            out.append((f.x.copy(), f.P.copy()))
        mean, covariance = zip(*out, strict=True)
        return np.stack(mean), np.stack(covariance)

    return run


def kalman_py(problem: Sighted) -> Run:
    """kalman-py's on JAX, compiled and warm."""
    import jax
    import jax.numpy as jnp

    jax.config.update("jax_enable_x64", True)
    from kalman_py import UnscentedKalmanFilter

    F, platforms = jnp.asarray(problem.F), jnp.asarray(problem.platforms)

    def h(x: jax.Array) -> jax.Array:
        off = x[:2] - platforms
        ranges, bearings = jnp.hypot(off[:, 0], off[:, 1]), jnp.arctan2(off[:, 0], off[:, 1])
        return jnp.stack((ranges, bearings), axis=1).ravel()

    given = (problem.Q, problem.R, problem.mean, problem.covariance)
    model = UnscentedKalmanFilter(lambda x, _: F @ x, h, *given)

    def run() -> tuple[np.ndarray, np.ndarray]:
        found = model.filter(problem.z, 0.5, backend="jax")
        return np.asarray(found.means), np.asarray(found.covs)

    return run


def fast_kalman(problem: Sighted) -> Run:
    """fast-kalman's, whose models are Python functions."""
    import kalman

    given = {"Q": problem.Q, "R": problem.R, "P": problem.covariance}
    flat = {name: np.ravel(each).tolist() for name, each in given.items()}
    points = {"alpha": 1.0, "beta": 2.0, "kappa": 0.0}

    def h(x: list[float]) -> list[float]:
        off = np.asarray(x)[:2] - problem.platforms
        ranges, bearings = np.hypot(off[:, 0], off[:, 1]), np.arctan2(off[:, 0], off[:, 1])
        return np.stack((ranges, bearings), axis=1).ravel().tolist()

    def f(x: list[float]) -> list[float]:
        return (problem.F @ np.asarray(x)).tolist()

    def run() -> tuple[np.ndarray, np.ndarray]:
        made = kalman.UnscentedKalmanFilter(4, 6, x=problem.mean.tolist(), **flat, **points)
        out = []
        for z in problem.z:
            made.predict(f)
            made.correct(z.tolist(), h)
            out.append((np.array(made.x), np.array(made.P).reshape(4, 4)))
        mean, covariance = zip(*out, strict=True)
        return np.stack(mean), np.stack(covariance)

    return run
