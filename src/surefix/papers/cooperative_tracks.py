"""Paper 001: what each master's filter makes of its observations, and what fusion makes of those.

All runs of a formation are filtered at once: arrays are (runs, epochs, masters, …).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from surefix.filters.kalman import Gaussian
from surefix.filters.sigma_point import predict, update
from surefix.fusion.covariance_intersection import covariance_intersection
from surefix.fusion.information_gain import fuse_by_gain, information_gain
from surefix.fusion.track import (
    Estimate,
    bar_shalom_campo,
    inverse_covariance,
    joint_predict,
    joint_update,
    weighted_mean,
)
from surefix.fusion.tracklets import Tracklet, tracklet, use_tracklets
from surefix.geo.rotation import attitude_along, body_to_earth
from surefix.models.auv import position_rate
from surefix.models.ranging import (
    locate,
    range_to,
    range_variance,
    relative_position,
    squared_range,
)
from surefix.robust.loss import Loss
from surefix.simulate.cooperative import START_SIGMA, Cooperation, Formation, simulate, stack
from surefix.types import FloatArray

__all__ = [
    "CENTRAL",
    "FUSIONS",
    "GAIN",
    "TRACKLETS",
    "Sailed",
    "Tracks",
    "central_track",
    "displacements",
    "local_tracks",
    "observe",
    "observed_positions",
    "sail",
    "summed_tracklets",
    "variances",
]

GAIN = "gain weights"
CENTRAL = "centralised filter"
TRACKLETS = "tracklets"
FUSIONS = (
    "mean of observations",
    "mean of estimates",
    GAIN,
    f"{GAIN}, fed back",
    "inverse covariance",
    "covariance intersection",
    "Bar-Shalom–Campo",
    TRACKLETS,
    CENTRAL,
)

_NO_WEIGHT = 1e-12


class Tracks(NamedTuple):
    """Local filters of all masters.

    Parameters
    ----------
    mean
        (runs, K, N, 3) m.
    prior, posterior
        (runs, K, N, 3, 3) m² before and after the observation of each epoch.
    joint
        (runs, K, N, N, 3, 3) m² covariance of the errors of all masters after it.
    gain
        (runs, K, N) nats.
    """

    mean: FloatArray
    prior: FloatArray
    posterior: FloatArray
    joint: FloatArray
    gain: FloatArray


class Sailed(NamedTuple):
    """Runs of one formation: what was drawn, the local filters, every fusion by its name."""

    world: Cooperation
    tracks: Tracks
    fused: dict[str, Estimate]


def observe(
    formation: Formation, points: FloatArray, master: FloatArray, attitude: FloatArray
) -> FloatArray:
    """What masters at (…, 3) observe of a slave at (…, 3): (…, m) in the unit of the reading."""
    if formation.reading == "range":
        return squared_range(points, master)[..., None]
    if formation.reading == "components":
        return np.square(points - master)
    return relative_position(points, master, attitude)


def variances(formation: Formation, slave: FloatArray, master: FloatArray) -> FloatArray:
    """Variances of the observations, (…, N, m), of a slave believed at (…, 1, 3)."""
    R = formation.squared_variance
    if formation.reading == "range":
        return np.full((*np.broadcast_shapes(slave.shape, master.shape)[:-1], 1), R)
    if formation.reading == "components":
        return np.full(np.broadcast_shapes(slave.shape, master.shape), R)
    factors = np.array(formation.quality or [[1.0, 1.0, 1.0]] * formation.masters)
    return np.asarray(range_variance(R, range_to(slave, master))[..., None] * np.square(factors))


def displacements(path: FloatArray, time: FloatArray) -> FloatArray:
    """How far the slave moves before each epoch, (…, K, 3) m, by its own attitude and speed.

    ``T · S(φ, θ, ψ) [u 0 0]ᵀ``: the slave keeps its bow along its path.
    """
    step = np.diff(path, axis=-2, prepend=path[..., :1, :])
    duration = np.diff(time, prepend=time[0] - 1.0)[:, None]
    speed = np.sqrt(np.square(step).sum(axis=-1, keepdims=True)) / duration
    surge = np.concatenate((speed, np.zeros((*speed.shape[:-1], 2))), axis=-1)
    return np.asarray(duration * position_rate(attitude_along(step), surge))


def local_tracks(
    formation: Formation,
    world: Cooperation,
    process: float,
    *,
    loss: Loss | None = None,
    feedback: bool = False,
) -> Tracks:
    """Filter every master's observations by itself.

    Parameters
    ----------
    formation, world
        What is sailed, and its runs stacked.
    process
        Variance per second, m²/s per axis, that the filters expect.
    loss
        Threshold weighting of gross errors.
    feedback
        After each epoch every master continues from the fusion by gain weights and its covariance.
    """
    runs, K, N = len(world.truth), len(world.time), formation.masters
    step = np.diff(world.time, prepend=world.time[0])
    moved = displacements(world.path, world.time)
    x = Gaussian(
        np.repeat(world.guess[:, None, :], N, axis=1),
        np.broadcast_to(START_SIGMA * np.eye(3), (runs, N, 3, 3)),
    )
    joint = np.broadcast_to(START_SIGMA**2 * np.eye(3), (runs, N, N, 3, 3))
    out: list[tuple[FloatArray, ...]] = []
    for k in range(K):
        Q = process * step[k] * np.eye(3)
        shift = moved[:, k, None, None, :]
        x = predict(x, lambda points, by=shift: points + by, Q)  # type: ignore[misc]
        joint, prior = joint_predict(joint, Q), x.factor @ x.factor.mT
        R = variances(formation, x.mean, world.master[:, :, k])
        place, turn = world.master[:, :, k, None, :], world.attitude[:, :, k, None, :]
        x, _ = update(
            x,
            world.observed[:, :, k],
            lambda points, p=place, a=turn: observe(formation, points, p, a),  # type: ignore[misc]
            R[..., None] * np.eye(R.shape[-1]),
            loss=loss,
        )
        posterior = x.factor @ x.factor.mT
        joint = joint_update(joint, prior, posterior)
        gain = information_gain(prior, posterior)
        out.append((x.mean, prior, posterior, joint, gain))
        if feedback:
            x, joint = _fed_back(x.mean, posterior, joint, gain)
    return Tracks(*(np.stack(column, axis=1) for column in zip(*out, strict=True)))


def _fed_back(
    mean: FloatArray, posterior: FloatArray, joint: FloatArray, gain: FloatArray
) -> tuple[Gaussian, FloatArray]:
    fused, _ = fuse_by_gain(mean, posterior, gain, joint)
    alike = np.broadcast_to(fused.covariance[:, None, None], joint.shape)
    factor = np.broadcast_to(np.linalg.cholesky(fused.covariance)[:, None], posterior.shape)
    return Gaussian(np.broadcast_to(fused.mean[:, None], mean.shape), factor), alike


def central_track(
    formation: Formation,
    world: Cooperation,
    process: float,
    *,
    loss: Loss | None = None,
    weight: FloatArray | None = None,
) -> Estimate:
    """One filter that gets the observations of all masters at once, (runs, K, …): the standard.

    Parameters
    ----------
    formation, world, process, loss
        As for `local_tracks`.
    weight
        (runs, masters, K) of each observation, decided beforehand: its variance is divided by it.
        None for all 1.
    """
    runs, K = len(world.truth), len(world.time)
    step = np.diff(world.time, prepend=world.time[0])
    moved = displacements(world.path, world.time)
    x = Gaussian(world.guess, np.broadcast_to(START_SIGMA * np.eye(3), (runs, 3, 3)))
    out = []
    for k in range(K):
        shift = moved[:, k, None, :]
        x = predict(x, lambda p, by=shift: p + by, process * step[k] * np.eye(3))  # type: ignore[misc]
        place, turn = world.master[:, None, :, k], world.attitude[:, None, :, k]
        R = variances(formation, x.mean[:, None], world.master[:, :, k])
        if weight is not None:
            R = R / np.maximum(weight[:, :, k, None], _NO_WEIGHT)
        R = R.reshape(runs, -1)

        def all_of_them(
            points: FloatArray, place: FloatArray = place, turn: FloatArray = turn
        ) -> FloatArray:
            seen = observe(formation, points[..., None, :], place, turn)
            return seen.reshape(*seen.shape[:-2], -1)

        z = world.observed[:, :, k].reshape(runs, -1)
        x, _ = update(x, z, all_of_them, R[..., None] * np.eye(R.shape[-1]), loss=loss)
        out.append((x.mean, x.factor @ x.factor.mT))
    return Estimate(*(np.stack(column, axis=1) for column in zip(*out, strict=True)))


def summed_tracklets(world: Cooperation, tracks: Tracks, process: float) -> Estimate:
    """One filter that adds up what each master's observation added, (runs, K, …)."""
    moved = displacements(world.path, world.time)
    step = np.diff(world.time, prepend=world.time[0])
    before = np.concatenate(
        (
            np.broadcast_to(world.guess[:, None, None], tracks.mean[:, :1].shape),
            tracks.mean[:, :-1],
        ),
        axis=1,
    )
    prior = Estimate(before + moved[:, :, None], tracks.prior)
    added = tracklet(prior, Estimate(tracks.mean, tracks.posterior))
    x = Estimate(world.guess, START_SIGMA**2 * np.eye(3))
    out = []
    for k in range(len(world.time)):
        x = Estimate(x.mean + moved[:, k], x.covariance + process * step[k] * np.eye(3))
        x = use_tracklets(x, Tracklet(added.information[:, k], added.vector[:, k]))
        out.append(x)
    return Estimate(*(np.stack(column, axis=1) for column in zip(*out, strict=True)))


def observed_positions(world: Cooperation) -> FloatArray:
    """Where each master saw the slave, (runs, K, N, 3) m in earth axes; reading ``position``."""
    return locate(world.observed, world.master, world.attitude).swapaxes(1, 2)


def sail(
    formation: Formation, process: float, seeds: list[list[int]], *, loss: Loss | None = None
) -> Sailed:
    """Draw runs, filter them for every master, and fuse in every way.

    Parameters
    ----------
    formation, process, loss
        See `local_tracks`.
    seeds
        One per run.
    """
    world = stack([simulate(formation, seed) for seed in seeds])
    tracks = local_tracks(formation, world, process, loss=loss)
    back = local_tracks(formation, world, process, loss=loss, feedback=True)
    mean, posterior, joint = tracks.mean, tracks.posterior, tracks.joint
    found = {
        "mean of estimates": weighted_mean(mean, posterior, np.ones_like(tracks.gain), joint),
        GAIN: fuse_by_gain(mean, posterior, tracks.gain, joint)[0],
        f"{GAIN}, fed back": fuse_by_gain(back.mean, back.posterior, back.gain, back.joint)[0],
        "inverse covariance": inverse_covariance(mean, posterior),
        "covariance intersection": covariance_intersection(mean, posterior)[0],
        "Bar-Shalom–Campo": bar_shalom_campo(mean, posterior, joint),
        TRACKLETS: summed_tracklets(world, tracks, process),
        CENTRAL: central_track(formation, world, process, loss=loss),
    }
    if formation.reading == "position":
        found["mean of observations"] = _mean_of_observations(formation, world, tracks)
    return Sailed(world, tracks, {name: found[name] for name in FUSIONS if name in found})


def _mean_of_observations(formation: Formation, world: Cooperation, tracks: Tracks) -> Estimate:
    place = world.master.swapaxes(1, 2)
    R = variances(formation, tracks.mean, place)
    turn = body_to_earth(world.attitude).swapaxes(1, 2)
    covariance = (turn * R[..., None, :]) @ turn.mT
    N = formation.masters
    return Estimate(observed_positions(world).mean(axis=2), covariance.mean(axis=2) / N)
