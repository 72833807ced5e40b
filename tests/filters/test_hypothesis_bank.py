"""Merging of hypotheses against every pair compared in turn."""

import numpy as np
import pytest

from filters.worlds import motion_of
from surefix.filters.hypotheses import no_hypotheses
from surefix.filters.hypothesis_bank import merge
from surefix.filters.hypothesis_scratch import rows_of, scratch_for
from surefix.filters.multi_hypothesis import filter_hypotheses

MOST = 24


def some_bank(rng, motion, count):
    """A few kinds of hypotheses that differ by very little, or in one thing by more."""
    bank, d = no_hypotheses(motion, MOST), motion.axes
    bank.number[0] = count
    bank.weight[:count] = np.sort(rng.normal(-3.0, 1.0, count))[::-1]
    root = np.array([0.5, 0.2, 0.1, 0.3])[: motion.order + 1]
    for k in range(MOST):  # the free rows hold what was there before
        bank.mean[k] = rng.normal(0.0, 0.04, bank.mean[k].shape) * root
        bank.covariance[k] = np.diag(root**2) * rng.uniform(0.98, 1.03)
        bank.mean[k, rng.integers(d), rng.integers(2)] += rng.choice([0.0, 0.0, 0.2])
        bank.covariance[k, rng.integers(d), 0, 0] *= rng.choice([1.0, 1.0, 1.0, 1.2])
        bank.run[k] = rng.choice([-1, -1, -1, 0])
        bank.opened[k] = 5.0
        bank.faulty[k] = rng.choice([0, 0, 0, 0, 1])
        bank.seen[k] = True
        if rng.random() < 0.2:
            bank.seen[k, d - 1] = False
            bank.covariance[k, d - 1, 0] = bank.covariance[k, d - 1, :, 0] = 0.0
    return bank


def alike(bank, i, j, order):
    """Whether two rows are one, said without haste."""
    same = (bank.run[i], bank.faulty[i]) == (bank.run[j], bank.faulty[j])
    if not (same and np.array_equal(bank.seen[i], bank.seen[j])):
        return False
    states = [0, 1, order] if bank.run[i] >= 0 else [0, 1]
    P, other = (np.diagonal(bank.covariance[k], axis1=1, axis2=2) for k in (i, j))
    known = P[:, :2] > 0.0
    ratio = other[:, :2][known] / P[:, :2][known]
    if np.any((ratio > 1.05) | (ratio < 0.95)):
        return False
    gap = (bank.mean[i] - bank.mean[j])[:, states]
    size = P[:, states]
    return np.sum(gap[size > 0.0] ** 2 / size[size > 0.0]) <= 0.01


@pytest.mark.parametrize("axes", [1, 2, 3])
@pytest.mark.parametrize("order", [2, 3])
def test_what_is_alike_becomes_one(axes: int, order: int) -> None:
    motion = motion_of(order, axes, blocks=False)
    merged = left = 0
    for seed in range(40):
        rng = np.random.default_rng(seed)
        bank = some_bank(rng, motion, int(rng.integers(2, MOST + 1)))
        count = int(bank.number[0])
        place = rows_of(MOST)
        rng.shuffle(place)
        weight, keep = np.exp(bank.weight[:count]), np.ones(count, np.bool_)
        for i in range(count):
            for j in range(i + 1, count) if keep[i] else ():
                if keep[j] and alike(bank, place[i], place[j], order):
                    keep[j] = False
                    weight[i] += weight[j]
        work = scratch_for(axes, MOST)
        merge(motion, bank, place, work)
        assert np.array_equal(work.keep[:count], keep)
        assert np.exp(bank.weight[:count][keep]) == pytest.approx(weight[keep], rel=1e-12)
        merged, left = merged + int((~keep).sum()), left + int(keep.sum())
    assert merged > 40
    assert left > 40


def test_all_hypotheses_there_can_be_are_compared() -> None:
    motion = motion_of(2, 2, blocks=False)
    bank = no_hypotheses(motion, MOST)
    bank.number[0] = MOST
    bank.seen[:] = True
    bank.covariance[:] = np.eye(3)
    bank.mean[:, 0, 0] = np.arange(MOST) // 2
    work = scratch_for(2, MOST)
    merge(motion, bank, rows_of(MOST), work)
    assert np.array_equal(work.keep, np.arange(MOST) % 2 == 0)
    assert np.allclose(bank.weight[::2], np.log(2.0))


def test_one_form_of_observations_is_compiled() -> None:
    """Columns side by side, backwards or every other row: all go the same way."""
    from surefix.filters.learning import supposed
    from surefix.filters.multi_hypothesis import _run
    from surefix.filters.records import Epochs

    motion = motion_of(2, 2, blocks=False)
    prior = supposed(2, 1.0, 1.0, 10.0, 40.0)
    rng = np.random.default_rng(4)
    z = rng.normal(0.0, 1.0, (60, 4))
    z[[20, 41], 0] += 40.0
    blank, none = np.full((60, 4), np.nan), np.zeros(60, np.int64)
    plain = Epochs(np.arange(60.0), z, np.ones((60, 4)), blank, none, none)
    turned = Epochs._make(np.asfortranarray(field) for field in plain)
    wide = Epochs._make(np.repeat(field, 2, axis=0)[::2] for field in plain)
    _, usual, _ = filter_hypotheses(motion, prior, plain, no_hypotheses(motion))
    for other in (turned, wide):
        _, found, _ = filter_hypotheses(motion, prior, other, no_hypotheses(motion))
        for one, two in zip(usual, found, strict=True):
            np.testing.assert_array_equal(one, two)
    for signature in getattr(_run, "signatures", ()):
        layouts = {kind.layout for kind in signature[2].types}
        assert layouts == {"C"}
