"""Simulated series for the tests of the filters: truth from the very model, seeded."""

from typing import NamedTuple

import numpy as np

from reference import kalman
from surefix.filters.records import Epochs, Motion, Recovery
from surefix.filters.track import by_axis, by_block, start
from surefix.models.motion import noise_factor, transition
from surefix.robust.loss import LOSSES, loss_named

NAMES = {2: "cv", 3: "ca"}
NEVER = Recovery(np.inf, 10.0)
PLAIN = loss_named("kalman")
ROBUST = sorted(set(LOSSES) - {"kalman"})


class World(NamedTuple):
    """A truth (n, states), what was observed of it, and a state the filter may honestly begin in.

    The truth at the first epoch is drawn from that state, so NEES is right from the beginning.
    """

    truth: np.ndarray
    epochs: Epochs
    motion: Motion
    state: object


def motion_of(order=2, axes=2, q=0.05, *, blocks=True, period=0.0):
    """Motion with groups by block (horizontal, vertical) or one per component."""
    group = by_block(((2,), (0, 1), (0, 1, 2))[axes - 1]) if blocks else by_axis(axes)
    density = np.broadcast_to(np.asarray(q, float), (axes,)).copy()
    return Motion(order, axes, density, group, int(group.max()) + 1, period)


def epochs_of(time, z, sigma, motion):
    """Epochs with nothing decided beforehand; sigma (m,) or (n, m)."""
    n = len(time)
    variance = np.broadcast_to(np.asarray(sigma, float) ** 2, z.shape).copy()
    fixed = np.full((n, motion.groups), np.nan)
    return Epochs(np.asarray(time, float), z, variance, fixed, np.zeros(n, np.int64))


def times(rng, n, *, step=1.0, irregular=True):
    """Times, by steps of 0.2 to 3 times the usual one, now and then the same time again."""
    if not irregular:
        return step * np.arange(n)
    steps = step * rng.uniform(0.2, 3.0, n)
    steps[rng.random(n) < 0.05] = 0.0
    return np.cumsum(steps)


def world(
    seed,
    n=100,
    *,
    order=2,
    axes=2,
    q=0.05,
    position=0.5,
    velocity=None,
    missing=0.0,
    step=1.0,
    irregular=True,
    blocks=True,
):
    """Draw a truth from the motion model and observe it; a share of the components is missing."""
    rng = np.random.default_rng(seed)
    motion = motion_of(order, axes, q, blocks=blocks)
    time = times(rng, n, step=step, irregular=irregular)
    states = order * axes
    S = np.diag(np.repeat([3.0, 1.0, 0.2][:order], axes))
    S[states - 1, 0] = 0.3
    before = start(motion, NEVER)._replace(time=time[0], mean=rng.normal(size=states), factor=S)
    truth = np.empty((n, states))
    x = before.mean + S @ rng.normal(size=states)
    for k in range(n):
        dt = time[k] - time[max(k - 1, 0)]
        x = transition(NAMES[order], axes, dt) @ x
        x = x + noise_factor(NAMES[order], axes, dt, motion.density) @ rng.normal(size=states)
        truth[k] = x
    sigma = np.repeat([position, 1.0 if velocity is None else velocity], axes)
    z = truth[:, : 2 * axes] + sigma * rng.normal(size=(n, 2 * axes))
    if velocity is None:
        z[:, axes:] = np.nan
    z[rng.random(z.shape) < missing] = np.nan
    return World(truth, epochs_of(time, z, sigma, motion), motion, before)


def matrices(motion, time, before):
    """F, Q (n, states, states) into each epoch, the first from the time ``before``."""
    steps = np.diff(time, prepend=before)
    name = NAMES[motion.order]
    F = np.stack([transition(name, motion.axes, dt) for dt in steps])
    G = np.stack([noise_factor(name, motion.axes, dt, motion.density) for dt in steps])
    return F, G @ G.transpose(0, 2, 1)


def twin(made):
    """The textbook filter on a world: what `reference.kalman.run` returns, and F and Q."""
    F, Q = matrices(made.motion, made.epochs.time, made.state.time)
    H = np.eye(2 * made.motion.axes, made.truth.shape[1])
    R = np.stack([np.diag(row) for row in made.epochs.variance])
    P = made.state.factor @ made.state.factor.T
    return kalman.run(made.state.mean, P, made.epochs.z, H, R, F, Q), F, Q


def covariances(filtered):
    """S Sᵀ of every epoch."""
    return filtered.factor @ filtered.factor.transpose(0, 2, 1)


def straight(seed, n=200, *, axes=2, position=0.5, velocity=None, step=1.0, speed=2.0, q=0.02):
    """A nearly straight run from nowhere: truth (n, axes), epochs and motion."""
    rng = np.random.default_rng(seed)
    motion = motion_of(2, axes, q)
    time = step * np.arange(n)
    turn = rng.uniform(0.0, 2.0 * np.pi)
    course = np.array([np.cos(turn), np.sin(turn), 0.1])[:axes] * speed
    truth = course * time[:, None] + rng.normal(size=axes) * 10.0
    z = np.full((n, 2 * axes), np.nan)
    z[:, :axes] = truth + position * rng.normal(size=(n, axes))
    if velocity is not None:
        z[:, axes:] = course + velocity * rng.normal(size=(n, axes))
    sigma = np.repeat([position, velocity or 1.0], axes)
    return truth, epochs_of(time, z, sigma, motion), motion
