"""From the trail of hypotheses back to decisions: what was used, and where the track jumped."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from surefix.filters.hypotheses import (
    COMMIT,
    CONTINUE,
    MANOEUVRE,
    OPEN,
    POOR,
    POOR_WEIGHT,
    RESTART,
    RESTARTS,
    VELOCITY_OUT,
    VELOCITY_POOR,
    WALK,
    Trail,
)
from surefix.filters.records import Motion
from surefix.jit import inner, kernel
from surefix.types import BoolArray, FloatArray, IntArray

__all__ = ["DRAGGED", "Decisions", "decide", "follow", "runs", "undecided"]


DRAGGED = 3
"""Of a fix in a drag; in common with a run it has that its fixes are wrong together."""


class Decisions(NamedTuple):
    """What one account of the past says of each of n epochs.

    Parameters
    ----------
    fixed
        (n, 2·axes) weight of the component: 1 where it belongs to the track, less where it is poor,
        0 where it does not.
    jump
        (n,) bit mask of the axes whose position jumps before this epoch, and above them of those
        whose highest rate does.
    run
        (n,) 1 where the fix belongs to a run with a common offset, `DRAGGED` where it is in a drag.
    """

    fixed: FloatArray
    jump: IntArray
    run: IntArray


def undecided(motion: Motion, n: int) -> Decisions:
    """Make an empty record."""
    return Decisions(np.ones((n, 2 * motion.axes)), np.zeros(n, np.int64), np.zeros(n, np.int64))


@inner
def _used(code: int, axis: int, running: bool) -> float:
    """Weight of an axis of the position."""
    if running or (code >> axis) & 1:
        return 0.0
    return POOR_WEIGHT if code & POOR else 1.0


@inner
def _moved(code: int) -> float:
    """Weight of the velocity."""
    if code & VELOCITY_OUT:
        return 0.0
    return POOR_WEIGHT if code & VELOCITY_POOR else 1.0


@inner
def _write(decisions: Decisions, k: int, code: int, axes: int, running: bool) -> None:
    for a in range(axes):
        decisions.fixed[k, a] = _used(code, a, running)
        decisions.fixed[k, axes + a] = _moved(code)


@inner
def _untold(decisions: Decisions, first: int, every: int) -> bool:
    """Whether the run that reaches back beyond ``first`` was told as a run, not as a jump."""
    for k in range(first - 1, -1, -1):
        if decisions.run[k]:
            return True
        if decisions.jump[k] & every:
            return False
    return True


@inner
def _touched(motion: Motion, seen: BoolArray, code: int, a: int) -> bool:
    """Whether anything of an axis was used at an epoch, be it in a run."""
    placed = seen[a] and not (code >> a) & 1
    return placed or (seen[motion.axes + a] and not code & VELOCITY_OUT)


@kernel
def decide(
    motion: Motion,
    seen: BoolArray,
    trail: Trail,
    head: int,
    first: int,
    decisions: Decisions,
) -> int:
    """Write what the likeliest hypothesis of epoch ``head`` says of the epochs from ``first`` on.

    A jump that is dated back further than ``first`` is put there. A track that began anew did so at
    the first fix that was left out, or, if that is before ``first``, at the one that it began with.
    A manoeuvre is put after the last observation used before it. ``seen`` (n, 2·axes) tells what
    was observed.

    Returns
    -------
    changed
        The first epoch of which it says something else than ``decisions`` did, or ``head``.
    """
    slot = trail.best[head]
    committed = False
    changed = head
    every = (1 << motion.axes) - 1
    both = 1 | 1 << motion.axes
    turned = np.full(motion.axes, -1)  # the earliest epoch before which a rate may have changed
    anew = np.full(motion.axes, -1)  # the fix of a restart …
    lost = np.full(motion.axes, -1)  # … and the earliest one left out before it
    for k in range(head, first - 1, -1):
        code = trail.code[trail.first[k] + slot]
        for a in range(motion.axes):
            if turned[a] >= 0 and _touched(motion, seen[k], code, a):
                decisions.jump[turned[a]] |= 1 << motion.axes + a
                changed = min(changed, turned[a])
                turned[a] = -1
            elif turned[a] >= 0:
                turned[a] = k
            if lost[a] < 0 or not seen[k, a]:
                continue
            if (code >> a) & 1 or code & (OPEN | CONTINUE):
                lost[a] = k
            else:
                decisions.jump[lost[a]] |= both << a
                changed = min(changed, lost[a])
                lost[a] = -1
        if code & COMMIT:
            committed = True
        running = code & (OPEN | CONTINUE) != 0
        jump = 0
        if committed and (code & OPEN or (k == first and _untold(decisions, first, every))):
            jump = every
        inside = running and not committed
        same = decisions.jump[k] == jump
        for a in range(motion.axes):
            same = same and decisions.fixed[k, a] == _used(code, a, inside)
            same = same and decisions.fixed[k, motion.axes + a] == _moved(code)
        if not same:
            changed = k
        _write(decisions, k, code, motion.axes, inside)
        decisions.jump[k] = jump
        decisions.run[k] = DRAGGED if code & WALK else 1 if inside else 0
        if code & OPEN:
            committed = False
        for a in range(motion.axes):
            if code & MANOEUVRE and _touched(motion, seen[k], code, a):
                turned[a] = k
            if code & (RESTART << a):
                anew[a] = lost[a] = k
        slot = trail.parent[trail.first[k] + slot]
    for a in range(motion.axes):
        if turned[a] >= 0:
            decisions.jump[turned[a]] |= 1 << motion.axes + a
            changed = min(changed, turned[a])
        if lost[a] >= 0:
            at = anew[a] if first > 0 else lost[a]
            decisions.jump[at] |= both << a
            changed = min(changed, at)
    return changed


@kernel
def follow(motion: Motion, trail: Trail, head: int, slot: int, decisions: Decisions) -> int:
    """Write decisions from ``head`` on as long as the likeliest hypothesis descends from ``slot``.

    What dates something back ends it: a jump, a manoeuvre, or a track that began anew.

    Returns
    -------
    until
        The first epoch at which the past is seen otherwise, or the end.
    """
    n = len(trail.best)
    for k in range(head, n):
        best = trail.best[k]
        code, parent = trail.code[trail.first[k] + best], trail.parent[trail.first[k] + best]
        if k > 0 and (parent != slot or code & (COMMIT | MANOEUVRE | RESTARTS)):
            return k
        running = code & (OPEN | CONTINUE) != 0
        _write(decisions, k, code, motion.axes, running)
        decisions.jump[k] = 0
        decisions.run[k] = DRAGGED if code & WALK else 1 if running else 0
        slot = best
    return n


@kernel
def runs(run: IntArray, used: FloatArray) -> tuple[IntArray, IntArray]:
    """Count the fixes of the run that each fix belongs to, and number the runs.

    Parameters
    ----------
    run
        (n,) 1 where the fix belongs to a run.
    used
        (n, m) 1 where a component of the position was used, 0 where not, NaN where not observed;
        a fix that was used ends a run.

    Returns
    -------
    length, number
        (n,) 0 and −1 where the fix belongs to none.
    """
    n = run.shape[0]
    length = np.zeros(n, np.int64)
    number = np.full(n, -1)
    found = 0
    first = last = -1
    count = 0
    for k in range(n + 1):
        ends = k == n
        if k < n and not run[k]:
            for c in range(used.shape[1]):
                ends = ends or used[k, c] > 0.0
        if ends and count > 0:
            for j in range(first, last + 1):
                if run[j]:
                    length[j] = count
                    number[j] = found
            found += 1
            count = 0
        elif k < n and run[k]:
            if count == 0:
                first = k
            last = k
            count += 1
    return length, number
