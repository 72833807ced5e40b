"""Where a track can begin: hypotheses on the spheres about the anchors of the first ranges.

One range says how far, not where. The hypotheses are spread evenly over the circle (2 axes) or the
sphere (3 axes) about the anchor of every range of the first epoch, each wide enough to touch its
neighbours: together they are a prior that is nearly flat where the target can be. All sights of the
epoch then decide between them, both mirror images of a planar array and a first range that is wrong
among them.
"""

from __future__ import annotations

import math

import numpy as np

from surefix.errors import OptionsError
from surefix.filters.sight_records import MOST_SIGHTS, SightBank, SightModel, Sights, empty_bank
from surefix.models.sights import RANGE
from surefix.types import FloatArray

__all__ = ["begin_around", "begin_at", "first_epoch"]

_WIDE = 1.3  # standard deviation of a start, in distances to its neighbour


def begin_at(
    model: SightModel,
    position: FloatArray,
    sigma: FloatArray,
    speed: float,
    most: int = MOST_SIGHTS,
) -> SightBank:
    """Begin with one known position.

    Parameters
    ----------
    model
        What moves.
    position, sigma
        (d,) m.
    speed
        Standard deviation of the velocity, m/s.
    most
        Hypotheses to be kept.
    """
    bank = empty_bank(model.axes, len(model.kind), most)
    _put(bank, np.reshape(position, (1, -1)), np.reshape(sigma, (1, -1)), speed)
    return bank


def first_epoch(model: SightModel, sights: Sights) -> int:
    """First epoch with a range that was not rejected beforehand; n where there is none."""
    usable = np.isfinite(sights.z) & (sights.fixed != 0.0) & (model.kind == RANGE)
    return int(np.argmax(usable.any(axis=1))) if usable.any() else len(sights.time)


def begin_around(
    model: SightModel, sights: Sights, speed: float, most: int = MOST_SIGHTS
) -> SightBank:
    """Begin around the anchors of the ranges of the first epoch.

    Parameters
    ----------
    model, sights
        What moves, and observations whose first epoch has a range.
    speed
        Standard deviation of the velocity, m/s.
    most
        Hypotheses to be kept.

    Raises
    ------
    OptionsError
        The first epoch has no range.
    """
    seen = np.flatnonzero((model.kind == RANGE) & np.isfinite(sights.z[0]))
    if not len(seen):
        raise OptionsError(
            "no range in the first epoch", "at least one", "say where the track begins"
        )
    direction, apart = _directions(model.axes, most)
    turn = seen[np.arange(len(direction)) % len(seen)]
    radius = np.maximum(sights.z[0, turn], 1e-3)
    place = sights.anchor[0, turn] + radius[:, None] * direction
    sigma = np.repeat(_WIDE * apart * radius[:, None], model.axes, axis=1)
    inside = ((place >= model.within[:, 0]) & (place <= model.within[:, 1])).all(axis=1)
    if inside.any():
        place, sigma = place[inside], sigma[inside]
    bank = empty_bank(model.axes, len(model.kind), most)
    _put(bank, place[:most], sigma[:most], speed)
    return bank


def _directions(axes: int, count: int) -> tuple[FloatArray, float]:
    """Unit vectors spread evenly, and the angle between neighbours, rad."""
    if axes == 1:
        return np.array([[-1.0], [1.0]]), 0.2
    i = np.arange(count) + 0.5
    if axes == 2:
        angle = 2.0 * np.pi * i / count
        return np.column_stack([np.cos(angle), np.sin(angle)]), 2.0 * math.pi / count
    up = 1.0 - 2.0 * i / count
    turn = np.pi * (1.0 + math.sqrt(5.0)) * i
    flat = np.sqrt(1.0 - up * up)
    spiral = np.column_stack([flat * np.cos(turn), flat * np.sin(turn), up])
    return np.asarray(spiral), math.sqrt(4.0 * math.pi / count)


def _put(bank: SightBank, place: FloatArray, sigma: FloatArray, speed: float) -> None:
    count, d = place.shape
    bank.number[0] = count
    bank.weight[:count] = -math.log(count)
    bank.mean[:count, :d] = place
    for a in range(d):
        bank.covariance[:count, a, a] = np.square(sigma[:, a])
        bank.covariance[:count, d + a, d + a] = speed * speed
