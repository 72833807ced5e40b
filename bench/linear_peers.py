"""Other libraries on a linear model: each function gives a run over the first epochs of a problem.

A run gives means (N, n) and covariances (N, n, n) after each update, as ours does.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from problems import Linear

Run = Callable[[], tuple[np.ndarray, np.ndarray]]


def statsmodels(problem: Linear) -> Run:
    """Statsmodels' compiled filter, exact at every epoch (tolerance 0), one component at a time."""
    from statsmodels.tsa.statespace.kalman_filter import FILTER_UNIVARIATE, KalmanFilter

    n, m = len(problem.mean), problem.z.shape[1]
    model = KalmanFilter(m, n, filter_method=FILTER_UNIVARIATE, tolerance=0.0)
    model.bind(np.ascontiguousarray(problem.z))
    model["design"], model["obs_cov"] = problem.H, problem.R
    model["transition"], model["state_cov"] = problem.F, problem.Q
    model["selection"] = np.eye(n)
    model.initialize_known(*_first(problem))

    def run() -> tuple[np.ndarray, np.ndarray]:
        found = model.filter()
        return found.filtered_state.T, np.moveaxis(found.filtered_state_cov, 2, 0)

    return run


def filterpy(problem: Linear) -> Run:
    """FilterPy, a loop of predict and update."""
    made = _filterpy_of(problem)

    def run() -> tuple[np.ndarray, np.ndarray]:
        f = made()
        out = []
        for z in problem.z:
            f.predict()
            f.update(z)
            out.append((f.x.copy(), f.P.copy()))
        return _stacked(out)

    return run


def gated_filterpy(problem: Linear) -> Run:
    """FilterPy behind a gate: an observation beyond the χ² quantile of 99.7 % is left out."""
    from scipy.stats import chi2

    made, limit = _filterpy_of(problem), chi2.ppf(0.9973, problem.z.shape[1])

    def run() -> tuple[np.ndarray, np.ndarray]:
        f = made()
        out = []
        for z in problem.z:
            f.predict()
            e = z - f.H @ f.x
            if e @ np.linalg.solve(f.H @ f.P @ f.H.T + f.R, e) < limit:
                f.update(z)
            out.append((f.x.copy(), f.P.copy()))
        return _stacked(out)

    return run


def stonesoup(problem: Linear) -> Run:
    """Stone Soup, predictor and updater."""
    from datetime import datetime, timedelta

    from stonesoup.models.measurement.linear import LinearGaussian
    from stonesoup.models.transition.linear import LinearGaussianTimeInvariantTransitionModel
    from stonesoup.predictor.kalman import KalmanPredictor
    from stonesoup.types.detection import Detection
    from stonesoup.types.hypothesis import SingleHypothesis
    from stonesoup.types.state import GaussianState
    from stonesoup.updater.kalman import KalmanUpdater

    n, m = len(problem.mean), problem.z.shape[1]
    motion = LinearGaussianTimeInvariantTransitionModel(
        transition_matrix=problem.F, covariance_matrix=problem.Q
    )
    sensor = LinearGaussian(n, tuple(range(m)), problem.R)
    predictor, updater = KalmanPredictor(motion), KalmanUpdater(sensor)
    begin = datetime(2026, 1, 1)

    def run() -> tuple[np.ndarray, np.ndarray]:
        state = GaussianState(problem.mean[:, None], problem.covariance, timestamp=begin)
        out = []
        for k, z in enumerate(problem.z):
            now = begin + timedelta(seconds=0.5 * (k + 1))
            seen = Detection(z[:, None], timestamp=now, measurement_model=sensor)
            predicted = predictor.predict(state, timestamp=now)
            state = updater.update(SingleHypothesis(predicted, seen))
            out.append((np.ravel(state.state_vector).astype(float), np.array(state.covar)))
        return _stacked(out)

    return run


def kalman_py(problem: Linear) -> Run:
    """kalman-py on JAX, compiled and warm."""
    _double()
    from kalman_py import KalmanFilter

    given = (problem.F, problem.H, problem.Q, problem.R, problem.mean, problem.covariance)
    model = KalmanFilter(*given)

    def run() -> tuple[np.ndarray, np.ndarray]:
        found = model.filter(problem.z, backend="jax")
        return np.asarray(found.means), np.asarray(found.covs)

    return run


def dynamax(problem: Linear) -> Run:
    """Dynamax, compiled and warm."""
    jax, params = _dynamax_of(problem)
    from dynamax.linear_gaussian_ssm.inference import lgssm_filter

    compiled = jax.jit(lambda z: lgssm_filter(params, z)[1:3])

    def run() -> tuple[np.ndarray, np.ndarray]:
        mean, covariance = compiled(problem.z)
        return np.asarray(mean), np.asarray(covariance)

    return run


def fast_kalman(problem: Linear) -> Run:
    """fast-kalman, its loop in C++; it gives covariances only step by step."""
    import kalman

    n, m = len(problem.mean), problem.z.shape[1]
    given = {"F": problem.F, "Q": problem.Q, "H": problem.H, "R": problem.R}
    flat = {name: np.ravel(each).tolist() for name, each in given.items()}
    first = {"x": problem.mean.tolist(), "P": np.ravel(problem.covariance).tolist()}

    def run() -> tuple[np.ndarray, np.ndarray]:
        f = kalman.LinearKalmanFilter(n, m, **first, **flat)
        out = []
        for z in problem.z:
            f.update(z)
            out.append((np.array(f.x), np.array(f.P).reshape(n, n)))
        return _stacked(out)

    return run


def opencv(problem: Linear) -> Run:
    """OpenCV's filter, predict and correct."""
    import cv2

    n, m = len(problem.mean), problem.z.shape[1]

    def run() -> tuple[np.ndarray, np.ndarray]:
        f = cv2.KalmanFilter(n, m, 0, cv2.CV_64F)
        f.transitionMatrix, f.processNoiseCov = problem.F, problem.Q
        f.measurementMatrix, f.measurementNoiseCov = problem.H, problem.R
        f.statePost, f.errorCovPost = problem.mean[:, None].copy(), problem.covariance.copy()
        out = []
        for z in problem.z:
            f.predict()
            f.correct(z[:, None])
            out.append((f.statePost[:, 0].copy(), f.errorCovPost.copy()))
        return _stacked(out)

    return run


def dynamax_tracks(problem: Linear, z: np.ndarray) -> Run:
    """Dynamax's filter under ``vmap`` over tracks z (T, N, m), compiled and warm."""
    jax, params = _dynamax_of(problem)
    from dynamax.linear_gaussian_ssm.inference import lgssm_filter

    compiled = jax.jit(jax.vmap(lambda each: lgssm_filter(params, each)[1:3]))

    def run() -> tuple[np.ndarray, np.ndarray]:
        mean, covariance = compiled(z)
        return np.asarray(mean), np.asarray(covariance)

    return run


def simdkalman_tracks(problem: Linear, z: np.ndarray) -> Run:
    """simdkalman over tracks z (T, N, m)."""
    import simdkalman as module

    model = module.KalmanFilter(problem.F, problem.Q, problem.H, problem.R)
    mean, covariance = _first(problem)

    def run() -> tuple[np.ndarray, np.ndarray]:
        found = model.compute(
            z,
            0,
            initial_value=mean,
            initial_covariance=covariance,
            smoothed=False,
            filtered=True,
            observations=False,
        )
        return found.filtered.states.mean, found.filtered.states.cov

    return run


def _first(problem: Linear) -> tuple[np.ndarray, np.ndarray]:
    """State predicted to the first epoch."""
    F, P = problem.F, problem.covariance
    return F @ problem.mean, F @ P @ F.T + problem.Q


def _stacked(out: list[tuple[np.ndarray, np.ndarray]]) -> tuple[np.ndarray, np.ndarray]:
    mean, covariance = zip(*out, strict=True)
    return np.stack(mean), np.stack(covariance)


def _filterpy_of(problem: Linear) -> Callable[[], object]:
    from filterpy.kalman import KalmanFilter

    n, m = len(problem.mean), problem.z.shape[1]

    def made() -> object:
        f = KalmanFilter(dim_x=n, dim_z=m)
        f.x, f.P = problem.mean.copy(), problem.covariance.copy()
        f.F, f.Q, f.H, f.R = problem.F, problem.Q, problem.H, problem.R
        return f

    return made


def _double() -> None:
    import jax

    jax.config.update("jax_enable_x64", True)


def _dynamax_of(problem: Linear) -> tuple[object, object]:
    _double()
    import jax
    from dynamax.linear_gaussian_ssm.inference import (
        ParamsLGSSM,
        ParamsLGSSMDynamics,
        ParamsLGSSMEmissions,
        ParamsLGSSMInitial,
    )

    n, m = len(problem.mean), problem.z.shape[1]
    mean, covariance = _first(problem)
    params = ParamsLGSSM(
        ParamsLGSSMInitial(mean, covariance),
        ParamsLGSSMDynamics(problem.F, np.zeros(n), np.zeros((n, 0)), problem.Q),
        ParamsLGSSMEmissions(problem.H, np.zeros(m), np.zeros((m, 0)), problem.R),
    )
    return jax, params
