"""Replay of late messages: the bits of the filter in order, whatever the order of arrival."""

from functools import reduce

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from surefix.filters.sigma_point import Gaussian, predict, update
from surefix.fusion.reorder import Fate, Message, absorb, start
from surefix.models.ranging import range_to

PLATFORMS = np.array([[0.0, 0.0, 0.0], [100.0, 0.0, 0.0], [0.0, 100.0, 20.0]])


def step(state, message):
    """A real filter: predict to the message's time, use its range."""
    time, x = state
    x = predict(x, lambda points: points + 0.5, 0.1 * (message.time - time) * np.eye(3))
    platform = PLATFORMS[message.source]
    x, _ = update(x, [message.content], lambda p: range_to(p, platform)[..., None], [[1.0]])
    return message.time, x


def drawn(seed, count=40):
    rng = np.random.default_rng(seed)
    times = np.sort(rng.choice(np.arange(1, 30), count) / 2.0)
    pairs = {(t, int(i)) for t, i in zip(times, rng.integers(0, 3, count), strict=True)}
    return [Message(float(t), i, float(rng.normal(60.0, 5.0))) for t, i in sorted(pairs)]


def begin():
    return 0.0, Gaussian(np.array([30.0, 40.0, 10.0]), 5.0 * np.eye(3))


def same_bits(one, other):
    return (
        one[0] == other[0]
        and one[1].mean.tobytes() == other[1].mean.tobytes()
        and one[1].factor.tobytes() == other[1].factor.tobytes()
    )


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("size", [1, 5])
def test_replay_is_the_filter_in_order_bit_for_bit(seed, size):
    messages = drawn(seed)
    expected = reduce(step, messages, begin())
    shuffled = [messages[i] for i in np.random.default_rng(seed + 100).permutation(len(messages))]
    history = start(begin())
    for first in range(0, len(shuffled), size):
        history, fates = absorb(history, shuffled[first : first + size], step)
        assert set(fates) == {Fate.USED}
    assert same_bits(history.state, expected)
    assert list(history.messages) == messages


@given(st.permutations(range(8)), st.lists(st.integers(1, 4), min_size=1, max_size=8))
@settings(max_examples=60, deadline=None)
def test_any_order_in_any_parts_gives_the_same(order, sizes):
    history = start("")
    messages = [Message(float(k // 2), k % 2, str(k)) for k in range(8)]
    left = [messages[k] for k in order]
    while left:
        count = sizes[len(left) % len(sizes)]
        history, _ = absorb(history, left[:count], lambda state, m: state + m.content)
        left = left[count:]
    assert history.state == "01234567"


def test_only_what_follows_is_done_again():
    done = []

    def noted(state, message):
        done.append(message.time)
        return state

    history, _ = absorb(start(0), [Message(t, 0, None) for t in (1.0, 2.0, 4.0)], noted)
    done.clear()
    absorb(history, [Message(3.0, 0, None)], noted)
    assert done == [3.0, 4.0]


def test_repeated_undated_and_late_messages_leave_the_state_as_it_was():
    count = lambda state, message: state + 1  # noqa: E731
    history, _ = absorb(start(0), [Message(float(t), 0, t) for t in range(10)], count, keep_s=3.0)
    assert [message.time for message in history.messages] == [6.0, 7.0, 8.0, 9.0]
    odd = [Message(8.0, 0, 99), Message(np.nan, 0, 1), Message(5.0, 0, 1), Message(5.5, 0, 1)]
    again, fates = absorb(history, odd, count, keep_s=3.0)
    assert fates == (Fate.REPEATED, Fate.UNDATED, Fate.TOO_LATE, Fate.USED)
    assert again.state == history.state + 1
    assert len(history.messages) == 4


def test_history_before_is_untouched():
    before, _ = absorb(start(0.0), [Message(2.0, 0, 2.0)], lambda s, m: s + m.content)
    after, _ = absorb(before, [Message(1.0, 0, 5.0)], lambda s, m: s + m.content)
    assert (before.state, after.state) == (2.0, 7.0)
    assert len(before.messages) == 1
