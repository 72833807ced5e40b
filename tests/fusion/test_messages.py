"""Which messages a receiver has: against a plain loop, lost and overtaken ones included."""

import numpy as np
import pytest

from surefix.fusion.messages import newest_arrived, newest_common, travel_time


def by_loop(valid, arrival, now, limit=np.inf):
    """Newest index per source, −1 for none."""
    best = []
    for i in range(len(valid)):
        came = [
            (valid[i, k], k)
            for k in range(valid.shape[1])
            if arrival[i, k] <= now and valid[i, k] <= limit
        ]
        best.append(max(came)[1] if came else -1)
    return best


def drawn(seed):
    rng = np.random.default_rng(seed)
    valid = np.sort(rng.uniform(0.0, 50.0, (3, 30)), axis=1)
    arrival = valid + rng.uniform(0.0, 6.0, (2, 3, 30))
    arrival[rng.random(arrival.shape) < 0.3] = np.inf
    valid[2, 20:] = np.nan
    return valid, arrival, np.sort(rng.uniform(0.0, 60.0, 25))


@pytest.mark.parametrize("seed", range(5))
def test_newest_is_that_of_a_loop(seed):
    valid, arrival, now = drawn(seed)
    found = newest_arrived(valid, arrival, now)
    for run in range(2):
        for t, instant in enumerate(now):
            assert found[run, :, t].tolist() == by_loop(valid, arrival[run], instant)


@pytest.mark.parametrize("seed", range(5))
def test_common_instant_is_that_of_a_loop(seed):
    valid, arrival, now = drawn(seed)
    found = newest_common(valid, arrival, now)
    for run in range(2):
        for t, instant in enumerate(now):
            newest = by_loop(valid, arrival[run], instant)
            if min(newest) < 0:
                assert found[run, :, t].tolist() == [-1, -1, -1]
                continue
            common = min(valid[i, k] for i, k in enumerate(newest))
            expected = by_loop(valid, arrival[run], instant, common)
            assert found[run, :, t].tolist() == expected


def test_overtaken_message_changes_nothing():
    valid = np.array([[1.0, 2.0]])
    now = np.array([2.5, 5.0])
    assert newest_arrived(valid, np.array([[4.0, 2.2]]), now).tolist() == [[1, 1]]


def test_nothing_arrived_is_said():
    valid = np.array([[1.0], [np.nan]])
    lost = np.array([[np.inf], [np.nan]])
    assert newest_arrived(valid, lost, np.array([9.0])).tolist() == [[-1], [-1]]


def test_sound_takes_its_time():
    assert travel_time(np.array([1500.0, 300.0])).tolist() == [1.0, 0.2]
