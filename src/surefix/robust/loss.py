"""Robust losses as weights of a standardised residual.

One table: a loss is a code, two constants and the weight ``w(v) = ψ(v)/v`` it gives a residual of
``v`` standard deviations. The observation's variance is divided by the weight (``R̄ = R/w``), which
is what M-estimation of the state amounts to (paper 000, eqs 14, 17–19).

=========  ==============================  ===========================================
loss       w(v), v = |v|                    constants
=========  ==============================  ===========================================
none       1
gate       1 if v ≤ k₁ else 0              k₁ from the χ² quantile
huber      1 if v ≤ k₀ else k₀/v           k₀ 1 … 2
igg1       Huber up to k₁, then 0          k₀ 1 … 1.5, k₁ 3 … 4.5
igg3       k₀/v · (k₁−v)/(k₁−k₀)           as printed in paper 000, eq 19
igg3-yang  k₀/v · ((k₁−v)/(k₁−k₀))²        Yang, Manuscripta Geodaetica 19, 1994
student-t  (ν+m)/(ν+d²), iterated          degrees of freedom ν in place of k₀
=========  ==============================  ===========================================
"""

from __future__ import annotations

import math
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from surefix.errors import OptionsError
from surefix.jit import helper, kernel
from surefix.types import FloatArray

__all__ = ["LOSSES", "Loss", "LossCode", "block_scale", "loss_named", "weight", "weights"]


class LossCode(IntEnum):
    """Which weight function; kernels receive the number."""

    NONE = 0
    GATE = 1
    HUBER = 2
    IGG1 = 3
    IGG3 = 4
    IGG3_YANG = 5
    STUDENT_T = 6


class Loss(NamedTuple):
    """A robust loss with its constants.

    Parameters
    ----------
    code
        `LossCode`.
    k0
        Where down-weighting begins, in standard deviations; ν for Student-t.
    k1
        Where rejection begins, in standard deviations.
    scale2, scale3
        How much longer the Mahalanobis distance over two or three axes is than one standard
        deviation of one axis at the same tail probability: distances are divided by it, so that k₀
        and k₁ mean the same for a block of axes as for one.
    by_noise
        1: the track filter takes v over the root of the noise variance alone, as Cipra and Romera
        do (paper 002, eqs 19), and not of the innovation's. Groups are single components then.
    """

    code: int
    k0: float
    k1: float
    scale2: float
    scale3: float
    by_noise: int = 0


LOSSES: dict[str, LossCode] = {
    "kalman": LossCode.NONE,
    "gate": LossCode.GATE,
    "huber": LossCode.HUBER,
    "igg1": LossCode.IGG1,
    "igg3": LossCode.IGG3,
    "igg3-yang": LossCode.IGG3_YANG,
    "student-t": LossCode.STUDENT_T,
}
"""Methods of `surefix clean` and the loss each one is."""

_USUAL = 0.0027  # false alarms: 3 σ of a normal distribution
_QUANTILES = {  # of χ² with one to three degrees of freedom
    _USUAL: (8.999861956749697, 11.829007011943707, 14.15625250054093),
    1e-4: (15.136705226623397, 18.420680743952364, 21.10751346616021),
}
_DEFAULTS = {
    LossCode.NONE: (0.0, 0.0),
    LossCode.GATE: (0.0, 0.0),
    LossCode.HUBER: (1.5, 0.0),
    LossCode.IGG1: (1.5, 4.5),
    LossCode.IGG3: (1.5, 4.5),
    LossCode.IGG3_YANG: (1.5, 4.5),
    LossCode.STUDENT_T: (4.0, 0.0),
}


def block_scale(axes: int, tail: float) -> float:
    """Ratio of the χ quantile of a block of axes to that of one axis at a tail probability.

    >>> round(block_scale(1, 0.01), 3), round(block_scale(2, 0.01), 3)
    (1.0, 1.178)
    """
    return float((_quantile(axes, tail) / _quantile(1, tail)) ** 0.5)


def _quantile(axes: int, tail: float) -> float:
    """What χ² with so many degrees of freedom exceeds with probability ``tail``.

    Loading the function for it takes a quarter of a second; the usual tails do without.
    """
    if tail in _QUANTILES and axes <= 3:
        return _QUANTILES[tail][axes - 1]
    from scipy.special import chdtri

    return float(chdtri(axes, tail))


def loss_named(
    method: str, *, k0: float | None = None, k1: float | None = None, false_alarm: float = _USUAL
) -> Loss:
    """Make a loss from the name of a method and, where given, its constants.

    Parameters
    ----------
    method
        One of ``LOSSES``.
    k0, k1
        Constants that replace the defaults; unit: standard deviations (Student-t: k0 is ν).
    false_alarm
        Tail probability at which blocks of axes are made comparable, and, for ``gate``, the share
        of good fixes that the gate rejects.

    Raises
    ------
    OptionsError
        Unknown method, or constants out of order.
    """
    if method not in LOSSES:
        raise OptionsError(f"method {method!r}", "one of " + ", ".join(LOSSES))
    if not 0.0 < false_alarm < 1.0:
        raise OptionsError(f"false alarm rate {false_alarm}", "a probability between 0 and 1")
    code = LOSSES[method]
    low, high = _DEFAULTS[code]
    if code == LossCode.GATE:
        high = float(_quantile(1, false_alarm) ** 0.5)
    low, high = (low if k0 is None else k0), (high if k1 is None else k1)
    if not (math.isfinite(low) and math.isfinite(high)):
        raise OptionsError(f"k0 = {low}, k1 = {high}", "finite numbers of standard deviations")
    if low < 0.0 or (code == LossCode.STUDENT_T and low <= 0.0):
        raise OptionsError(f"k0 = {low}", "a positive number of standard deviations")
    if code in (LossCode.IGG1, LossCode.IGG3, LossCode.IGG3_YANG) and not low < high:
        raise OptionsError(f"k0 = {low}, k1 = {high}", "k0 < k1", "k0 1–1.5 and k1 3–4.5 are usual")
    return Loss(
        int(code), float(low), float(high), block_scale(2, false_alarm), block_scale(3, false_alarm)
    )


@helper
def weight(v: float, code: int, k0: float, k1: float) -> float:
    """Weight of a residual of ``v ≥ 0`` standard deviations (Student-t iterates; see filters).

    Parameters
    ----------
    v
        Distance from the prediction in standard deviations of the innovation.
    code, k0, k1
        From a `Loss`.
    """
    if code in (0, 6):
        return 1.0
    if code == 1:
        return 1.0 if v <= k1 else 0.0
    if v <= k0:
        return 1.0
    if code == 2:
        return k0 / v
    if v >= k1:
        return 0.0
    if code == 3:
        return k0 / v
    taper = (k1 - v) / (k1 - k0)
    if code == 5:
        taper *= taper
    return k0 / v * taper


@kernel
def weights(nis: FloatArray, size: int, loss: Loss) -> FloatArray:
    """Weights of a series of squared Mahalanobis distances over ``size`` axes; NaN stays NaN.

    Parameters
    ----------
    nis
        (n,) squared distances.
    size
        How many axes each distance runs over.
    loss
        Student-t: ``(ν + m)/(ν + d²)``.
    """
    out = np.empty(len(nis))
    scale = 1.0 if size == 1 else loss.scale2 if size == 2 else loss.scale3
    for k in range(len(nis)):
        if np.isnan(nis[k]):
            out[k] = np.nan
        elif loss.code == 6:
            out[k] = (loss.k0 + size) / (loss.k0 + nis[k])
        else:
            out[k] = weight(np.sqrt(nis[k]) / scale, loss.code, loss.k0, loss.k1)
    return out
