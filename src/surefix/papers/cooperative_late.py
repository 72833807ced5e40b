"""Paper 001, section 3: masters report at their own periods, late, out of order, or not at all.

The slave fuses at its own period. Compared are waiting for everybody, the timely update of the
paper with and without propagation to a common time, and the replay of late observations.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial, reduce
from typing import NamedTuple

import numpy as np

from surefix.filters.kalman import Gaussian
from surefix.filters.sigma_point import predict, update
from surefix.fusion.covariance_intersection import covariance_intersection
from surefix.fusion.information_gain import fuse_by_gain, gain_weights
from surefix.fusion.messages import newest_arrived, newest_common, travel_time
from surefix.fusion.reorder import History, Message, absorb, start
from surefix.fusion.track import Estimate, bar_shalom_campo, inverse_covariance, weighted_mean
from surefix.models.ranging import range_to
from surefix.papers.cooperative_tracks import Tracks, observe, variances
from surefix.simulate.cooperative import START_SIGMA, Cooperation, Formation, path
from surefix.types import BoolArray, FloatArray, IntArray

__all__ = [
    "LATE",
    "Channel",
    "State",
    "arrivals",
    "fused_late",
    "replayed",
    "same_bits",
]

LATE = (
    "in order, as printed",
    "in order, propagated",
    "timely, as printed",
    "timely, gain weights",
    "timely, inverse covariance",
    "timely, covariance intersection",
    "timely, Bar-Shalom–Campo",
    "replay of observations",
)


@dataclass(frozen=True, kw_only=True)
class Channel:
    """What the water does to messages.

    Parameters
    ----------
    delay_s
        Length of a packet and processing, s, beside the travel of sound.
    loss
        Share of messages lost.
    disorder_s
        A further delay, uniform up to this, s: more than a period puts messages out of order.
    sound
        False for messages that arrive at once.
    """

    delay_s: float = 0.0
    loss: float = 0.0
    disorder_s: float = 0.0
    sound: bool = True


def arrivals(channel: Channel, world: Cooperation, seeds: list[list[int]]) -> FloatArray:
    """When the message about each observation arrives, (runs, N, K) s; infinite where never.

    The masters start together: the messages of the first epoch are known at once.
    """
    sent = np.where(np.isfinite(world.observed[..., 0]), world.time, np.inf)
    for run, seed in enumerate(seeds):
        rng = np.random.default_rng(seed)
        extra = channel.delay_s + channel.disorder_s * rng.uniform(size=sent.shape[1:])
        lost = rng.uniform(size=sent.shape[1:]) < channel.loss
        extra[:, 0], lost[:, 0] = 0.0, False
        sent[run] = np.where(lost, np.inf, sent[run] + extra)
    if channel.sound:
        way = travel_time(range_to(world.truth[:, None], world.master))
        sent[..., 1:] += way[..., 1:]
    return sent


def fused_late(
    formation: Formation,
    world: Cooperation,
    tracks: Tracks,
    process: float,
    arrival: FloatArray,
    now: FloatArray,
) -> dict[str, Estimate]:
    """Fuse what has arrived at the instants ``now``, (runs, T, …), by each way but the replay."""
    valid = np.where(np.isfinite(world.observed[0, :, :, 0]), world.time, np.nan)
    timely = newest_arrived(valid, arrival, now)
    waiting = newest_common(valid, arrival, now)
    found = {}
    for name, index in (("in order", waiting), ("timely", timely)):
        got = _received(formation.case, world, tracks, process, index, now)
        weight = gain_weights(got.gain)
        found[f"{name}, as printed"] = weighted_mean(got.stale, got.covariance, weight, got.joint)
        found[f"{name}, propagated"] = fuse_by_gain(got.mean, got.covariance, got.gain, got.joint)[
            0
        ]
    found["timely, gain weights"] = found.pop("timely, propagated")
    found["timely, inverse covariance"] = inverse_covariance(got.mean, got.covariance)
    found["timely, covariance intersection"] = covariance_intersection(got.mean, got.covariance)[0]
    found["timely, Bar-Shalom–Campo"] = bar_shalom_campo(got.mean, got.covariance, got.joint)
    return found


class _Received(NamedTuple):
    """Posteriors at the receiver: as sent and propagated, (runs, T, N, …)."""

    stale: FloatArray
    mean: FloatArray
    covariance: FloatArray
    joint: FloatArray
    gain: FloatArray


def _received(
    case: int,
    world: Cooperation,
    tracks: Tracks,
    process: float,
    index: IntArray,
    now: FloatArray,
) -> _Received:
    """Posteriors of the given epochs, propagated to ``now`` along the slave's path."""
    epoch = index.swapaxes(1, 2)  # (runs, T, N)
    run = np.arange(len(epoch))[:, None, None]
    source = np.arange(epoch.shape[-1])
    stale = tracks.mean[run, epoch, source]
    age = now[:, None] - world.time[epoch]
    mean = stale + path(case, now)[:, None, :] - world.path[run, epoch]
    covariance = tracks.posterior[run, epoch, source] + process * age[..., None, None] * np.eye(3)
    joint = np.empty((*epoch.shape, epoch.shape[-1], 3, 3))
    for i in source:
        joint[..., i, i, :, :] = covariance[..., i, :, :]
        for j in range(i):
            cross = _cross(world.time, tracks, process, epoch, (int(i), j))
            newest = world.time[np.maximum(epoch[..., i], epoch[..., j])]
            cross = cross + process * (now - newest)[..., None, None] * np.eye(3)
            joint[..., i, j, :, :], joint[..., j, i, :, :] = cross, cross.mT
    return _Received(stale, mean, covariance, joint, tracks.gain[run, epoch, source])


def _cross(
    time: FloatArray, tracks: Tracks, process: float, epoch: IntArray, pair: tuple[int, int]
) -> FloatArray:
    """Cross-covariance of two posteriors of different epochs at the later of the two.

    From the older epoch on, the older posterior is only predicted while the other filter goes on:
    ``P_ij ← (P_ij + QΔt) Aⱼᵀ`` at each of its updates.
    """
    i, j = pair
    run = np.arange(len(epoch))[:, None]
    oldest, newest = np.minimum(epoch[..., i], epoch[..., j]), epoch[..., [i, j]].max(axis=-1)
    second = (epoch[..., j] >= epoch[..., i])[..., None, None]  # which of the two goes on
    cross = tracks.joint[run, oldest, i, j]
    cross = np.where(second, cross, cross.mT)
    leader = np.where(second[..., 0, 0], j, i)
    for lag in range(1, int((newest - oldest).max(initial=0)) + 1):
        at = np.minimum(oldest + lag, newest)
        dt = (time[at] - time[at - 1])[..., None, None]
        prior, posterior = tracks.prior[run, at, leader], tracks.posterior[run, at, leader]
        kept = np.linalg.solve(prior, posterior)  # Aᵀ
        gone_on = (cross + process * dt * np.eye(3)) @ kept
        cross = np.where((oldest + lag <= newest)[..., None, None], gone_on, cross)
    return np.asarray(np.where(second, cross, cross.mT))


class State(NamedTuple):
    """The receiver's own filter: s, and the slave's position."""

    time: float
    x: Gaussian


_History = History[State, int]


def _ahead(case: int, process: float, state: State, time: float) -> State:
    """Predict to a time along the slave's path."""
    begin, end = path(case, np.array([state.time, time]))
    Q = process * (time - state.time) * np.eye(3)
    return State(time, predict(state.x, lambda points: points + (end - begin), Q))


def _step(
    formation: Formation,
    world: Cooperation,
    process: float,
    run: int,
    state: State,
    message: Message[int],
) -> State:
    """Use the observation of one master at the message's epoch."""
    i, k = message.source, message.content
    ahead = _ahead(formation.case, process, state, message.time)
    place, turn = world.master[run, i, k], world.attitude[run, i, k]
    R = variances(formation, ahead.x.mean[None], world.master[run, :, k])[i]
    x, _ = update(
        ahead.x,
        world.observed[run, i, k],
        lambda points: observe(formation, points, place, turn),
        np.diag(R),
    )
    return State(message.time, x)


def replayed(
    formation: Formation,
    world: Cooperation,
    process: float,
    arrival: FloatArray,
    now: FloatArray,
) -> Estimate:
    """Filter the observations themselves, replaying whenever a late one arrives, (runs, T, …)."""
    means, covariances = [], []
    for run in range(len(world.truth)):
        step = partial(_step, formation, world, process, run)
        history: _History = start(_begin(world, run))
        begin = -np.inf
        for t in now:
            due = (arrival[run] > begin) & (arrival[run] <= t)
            history, _ = absorb(history, _messages(world, due, arrival[run]), step, keep_s=30.0)
            x = _ahead(formation.case, process, history.state, float(t)).x
            means.append(x.mean)
            covariances.append(x.covariance)
            begin = t
    shape = (len(world.truth), len(now))
    return Estimate(np.array(means).reshape(*shape, 3), np.array(covariances).reshape(*shape, 3, 3))


def same_bits(
    formation: Formation, world: Cooperation, process: float, arrival: FloatArray, run: int
) -> bool:
    """Tell whether the replay ends in the very bits of the filter that got all in order."""
    step = partial(_step, formation, world, process, run)
    came = _messages(world, np.isfinite(arrival[run]), arrival[run])
    history: _History = start(_begin(world, run))
    for message in came:
        history, _ = absorb(history, [message], step)
    in_order = reduce(step, sorted(came, key=lambda message: message.place), _begin(world, run))
    one, other = history.state.x, in_order.x
    return bool((one.mean == other.mean).all() and (one.factor == other.factor).all())


def _begin(world: Cooperation, run: int) -> State:
    return State(float(world.time[0]), Gaussian(world.guess[run], START_SIGMA * np.eye(3)))


def _messages(world: Cooperation, due: BoolArray, arrival: FloatArray) -> list[Message[int]]:
    """Messages of one run in the order in which they arrive."""
    source, epoch = np.nonzero(due)
    order = np.argsort(arrival[source, epoch], kind="stable")
    return [
        Message(float(world.time[k]), int(i), int(k))
        for i, k in zip(source[order], epoch[order], strict=True)
    ]
