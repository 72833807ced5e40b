"""The multi-hypothesis filter against every account of a short series, enumerated."""

import numpy as np
import pytest

from filters.worlds import motion_of
from reference.hypotheses import enumerate_accounts
from surefix.filters.hypotheses import (
    COMMIT,
    CONTINUE,
    DROP,
    OPEN,
    POOR,
    Found,
    Prior,
    no_hypotheses,
)
from surefix.filters.multi_hypothesis import filter_hypotheses
from surefix.filters.records import Epochs
from surefix.models.motion import noise_factor, transition

MOST = 4096
FAR, ALIKE = 10.0, 0.01
NAMES = {2: "cv", 3: "ca"}


def prior_of(axes, **changes):
    """Every account has its chance."""
    made = Prior(0.2, 0.23, 0.15, 0.17, 0.19, 4.0, 0.05, 0.2, 0.7, np.repeat([8.0, 2.0], axes), 2.0)
    return made._replace(small=0.4)._replace(**changes)


def series(
    seed, n, *, axes=1, order=2, velocity=None, run=(), sensors=(0,), missing=0.0, period=0.0
):
    """A few fixes with gross errors, and a run of the first sensor, or of both, with an offset."""
    rng = np.random.default_rng(seed)
    motion = motion_of(order, axes, rng.uniform(0.05, 0.5, axes), blocks=False, period=period)
    time = np.cumsum(rng.uniform(0.3, 2.0, n)) + 100.0
    time[n // 2] = time[n // 2 - 1]
    x = rng.normal(size=order * axes)
    z = np.full((n, 2 * axes), np.nan)
    sensor = np.resize(sensors, n)
    off = rng.choice([-1, 1], axes) * rng.uniform(15.0, 40.0, axes)
    for k in range(n):
        dt = time[k] - time[max(k - 1, 0)]
        x = transition(NAMES[order], axes, dt) @ x
        x = x + noise_factor(NAMES[order], axes, dt, motion.density) @ rng.normal(size=len(x))
        z[k, :axes] = x[:axes] + rng.normal(size=axes)
        if velocity is not None and rng.random() < 0.7:
            z[k, axes:] = x[axes : 2 * axes] + velocity * rng.normal(size=axes)
            z[k, axes:] += (rng.random() < 0.4) * 10.0 * velocity
        if k in run:
            z[k, :axes] += off
        elif rng.random() < 0.3:
            z[k, rng.integers(axes)] += rng.normal() * 20.0
    lost = rng.random(z.shape) < missing
    lost[0, :axes] = False
    z[lost] = np.nan
    if period > 0.0:
        z[:, 0] %= period
    variance = np.ones_like(z)
    variance[:, axes:] = (velocity or 1.0) ** 2
    fixed = np.full(z.shape, np.nan)
    return motion, Epochs(time, z, variance, fixed, np.zeros(n, np.int64), sensor)


def rows(epochs, first, until):
    return Epochs(*(field[first:until] for field in epochs))


def compared(motion, prior, epochs, first, **rules):
    """Both filters; the first fix is judged by a prior of its own."""
    start = no_hypotheses(motion, MOST)
    bank, one, _ = filter_hypotheses(motion, first, rows(epochs, 0, 1), start, traced=False)
    bank, two, _ = filter_hypotheses(motion, prior, rows(epochs, 1, None), bank, traced=False)
    found = Found(*(np.concatenate(pair) for pair in zip(one, two, strict=True)))
    return bank, found, enumerate_accounts(motion, prior, epochs, first=first, **rules)


def agrees(motion, prior, epochs, first):
    bank, found, twin = compared(motion, prior, epochs, first, far=FAR, alike=ALIKE)
    accounts = twin[-1].accounts
    assert bank.number[0] == len(accounts)
    for k, mixture in enumerate(twin):
        off = found.mean[k] - mixture.mean
        if motion.period > 0.0:
            off[0] -= motion.period * np.rint(off[0] / motion.period)
        np.testing.assert_allclose(off, 0.0, atol=1e-6)
        np.testing.assert_allclose(found.sigma[k], mixture.sigma, rtol=1e-6, atol=1e-7)
        assert found.evidence[k] == pytest.approx(mixture.evidence, abs=1e-8)
    weights = np.sort([account.weight for account in accounts])
    np.testing.assert_allclose(np.sort(bank.weight[: len(accounts)]), weights, atol=1e-7)
    return {word for account in accounts for word in " ".join(account.said).split()}


CASES = {
    "one axis": ({"axes": 1}, 6),
    "aided": ({"axes": 1, "velocity": 0.2}, 5),
    "two axes": ({"axes": 2}, 5),
    "a run": ({"axes": 1, "run": range(2, 6)}, 6),
    "a run of two axes": ({"axes": 2, "run": range(2, 6)}, 6),
    "a run of one of two sensors": ({"axes": 1, "run": (2, 4, 6), "sensors": (0, 1)}, 7),
    "a jump of two sensors": ({"run": range(4, 8), "sensors": (0, 0, 0, 0, 0, 0, 0, 1)}, 8),
    "acceleration": ({"axes": 1, "order": 3, "run": (2, 3)}, 5),
    "aided acceleration": ({"axes": 1, "order": 3, "velocity": 0.3}, 4),
    "missing": ({"axes": 2, "velocity": 0.3, "missing": 0.3}, 5),
    "three axes": ({"axes": 3}, 4),
    "lost": ({"axes": 2, "run": range(2, 4)}, 6),
    "an angle": ({"axes": 1, "period": 60.0, "run": (2, 3)}, 6),
}
SAID = {
    "a run": {"open", "continue", "drop", "lasting", "isolated", "belongs"},
    "a jump of two sensors": {"commit"},
    "aided": {"moves", "slips", "poor"},
    "three axes": {"offx", "offy", "offz", "offxy"},
    "lost": {"anew"},
    "one axis": {"turns"},
}


@pytest.mark.parametrize("name", CASES)
def test_it_is_the_enumeration(name):
    """Accounts, weights, evidence, mean and sigma, with the same rules of what is dropped."""
    how, n = CASES[name]
    said = set()
    for seed in range(6):
        motion, epochs = series(seed, n, **how)
        prior = prior_of(motion.axes)
        longest = {"a jump of two sensors": 100.0, "lost": 1.5}.get(name, prior.longest)
        prior = prior._replace(longest=longest)
        said |= agrees(motion, prior, epochs, prior._replace(isolated=1e-9, partial=1e-9))
    assert said >= SAID.get(name, set())


@pytest.mark.parametrize("how", [{"axes": 1}, {"axes": 2}, {"axes": 1, "velocity": 0.3}])
def test_what_is_dropped_and_merged_is_next_to_nothing(how):
    """Against all accounts, even of the first fix."""
    for seed in range(8):
        motion, epochs = series(seed, 4, **how)
        prior = prior_of(motion.axes)
        bank, found, twin = compared(motion, prior, epochs, prior)
        whole = bank.number[0] == len(twin[-1].accounts)
        for k, mixture in enumerate(twin):
            scale = 1e-8 if whole else 0.05
            error = np.abs(found.mean[k] - mixture.mean) / mixture.sigma
            assert error.max() < scale
            assert np.abs(np.log(found.sigma[k] / mixture.sigma)).max() < scale
            assert found.evidence[k] == pytest.approx(mixture.evidence, abs=scale)


def word(code):
    """What a code says, in the words of the twin."""
    names = {COMMIT: "commit", OPEN: "open", CONTINUE: "continue", DROP: "drop", POOR: "poor"}
    return next((name for bit, name in names.items() if code & bit), "belongs")


@pytest.mark.parametrize("seed", range(6))
def test_the_trail_of_the_best_is_its_account(seed):
    motion, epochs = series(seed, 7, run=range(4, 7))
    prior = prior_of(1, poor=0.02, longest=100.0)
    _, _, trail = filter_hypotheses(motion, prior, epochs, no_hypotheses(motion))
    twin = enumerate_accounts(motion, prior, epochs, FAR, ALIKE)
    said = max(twin[-1].accounts, key=lambda account: account.weight).said
    slot, back = trail.best[-1], []
    for k in range(len(said) - 1, -1, -1):
        code = trail.code[trail.first[k] + slot]
        back.append("isolated" if code & 1 else word(code))
        slot = trail.parent[trail.first[k] + slot]
    assert tuple(back[::-1]) == said
