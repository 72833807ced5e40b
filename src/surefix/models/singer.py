"""Singer's motion model: an acceleration that forgets, and its "current statistical" form.

The acceleration is a first-order Markov process about a mean ā, with the correlation time 1/α and
the variance σ²; the state of an axis is [p, v, a]:

    ȧ = −α (a − ā) + w,   E w(t) w(t') = 2 α σ² δ(t − t').

Over a step T, exactly: ``x' = Φ x + U ā + w`` with ``Cov w = 2 α σ² Q``, where with
g(s) = [φ₁(s), φ₂(s), e^{−αs}], φ₂ = (1 − e^{−αs})/α, φ₁ = (αs − 1 + e^{−αs})/α²:

    Φ = [[1, T, φ₁(T)], [0, 1, φ₂(T)], [0, 0, e^{−αT}]],
    U = [T²/2 − φ₁(T), T − φ₂(T), 1 − e^{−αT}],
    Q = ∫₀ᵀ g gᵀ ds.

The closed forms of Q cancel to nothing as αT → 0; there power series take their place, so that the
limit α = 0 is the model of constant acceleration, Q its white-jerk noise, to the last digit.

In the current statistical model ā is the newest estimate of the acceleration, and σ² follows it by
a Rayleigh distribution between −a_max and a_max (`rayleigh_variance`).

Sources: Singer 1970, IEEE Trans. AES 6, 473–483; Zhou and Kumar 1984, *A current statistical model
and adaptive algorithm for estimating maneuvering targets*, J. Guidance 7, 596–602.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from surefix.errors import OptionsError
from surefix.jit import helper
from surefix.types import FloatArray

__all__ = ["Singer", "rayleigh_variance", "singer"]

_SERIES_BELOW: Final = 1.0  # αT up to which the power series are used
_TERMS: Final = 24


class Singer(NamedTuple):
    """One step of the model for one axis.

    Parameters
    ----------
    alpha
        1/s, inverse of the correlation time of the acceleration.
    transition
        (3, 3) Φ.
    mean_input
        (3,) U, through which the mean acceleration enters.
    noise
        (3, 3) Q for 2ασ² = 1, in powers of s.
    """

    alpha: float
    transition: FloatArray
    mean_input: FloatArray
    noise: FloatArray


def singer(alpha: float, dt: float) -> Singer:
    """Discretise the model over a step, exactly for any αT ≥ 0.

    Parameters
    ----------
    alpha
        1/s, at least 0: 1/60 for a slow turn, 1/20 for evasion, 1 for turbulence.
    dt
        Step in s, above 0.

    Raises
    ------
    OptionsError
        A negative α, or a step that is not positive.

    Examples
    --------
    >>> singer(0.0, 2.0).transition
    array([[1., 2., 2.],
           [0., 1., 2.],
           [0., 0., 1.]])
    >>> singer(0.5, 2.0).mean_input.round(4)
    array([0.5285, 0.7358, 0.6321])
    """
    if not (0.0 <= alpha < math.inf and 0.0 < dt < math.inf):
        raise OptionsError(f"alpha {alpha}, step {dt}", "alpha ≥ 0 and a step > 0")
    x = alpha * dt
    powers = dt ** np.array([2.0, 1.0, 0.0])
    if x < _SERIES_BELOW:
        response, noise = _series(x)
    else:
        response, noise = _closed(x)
    transition = np.array([[1.0, dt, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 0.0]])
    transition[:, 2] = response * powers
    # U = the response to a constant acceleration less the share that Φ already carries
    constant = np.array([0.5, 1.0, 1.0])
    mean_input = (constant - response) * powers if x >= _SERIES_BELOW else _rest(x) * powers
    return Singer(alpha, transition, mean_input, noise * np.outer(powers, powers) * dt)


@helper
def rayleigh_variance(mean: float, highest: float) -> float:
    """Variance σ² of the acceleration, given its mean: (4 − π)/π (a_max − |ā|)².

    Parameters
    ----------
    mean
        ā, m/s².
    highest
        a_max > 0, the greatest acceleration either way, m/s²; a mean beyond it has the variance 0.
    """
    room = max(highest - abs(mean), 0.0)
    return (4.0 - math.pi) / math.pi * room * room


def _series(x: float) -> tuple[FloatArray, FloatArray]:
    """g(T) and Q for T = 1, α = x, by power series: g_i = Σ (−x)ⁿ sⁿ⁺ᵏ/(n+k)!, k = 2, 1, 0."""
    coefficients = np.array(
        [[(-x) ** n / math.factorial(n + k) for n in range(_TERMS)] for k in (2, 1, 0)]
    )
    order = np.arange(_TERMS)
    noise = np.empty((3, 3))
    for i, k in enumerate((2, 1, 0)):
        for j, l in enumerate((2, 1, 0)):
            degree = order[:, None] + order + k + l + 1
            noise[i, j] = np.sum(np.outer(coefficients[i], coefficients[j]) / degree)
    return coefficients.sum(axis=1), 0.5 * (noise + noise.T)


def _rest(x: float) -> FloatArray:
    """U for T = 1, α = x, by power series: x Σ (−x)ⁿ/(n+k+1)!, k = 2, 1, 0."""
    return np.array(
        [x * sum((-x) ** n / math.factorial(n + k + 1) for n in range(_TERMS)) for k in (2, 1, 0)]
    )


def _closed(x: float) -> tuple[FloatArray, FloatArray]:
    """g(T) and Q for T = 1, α = x, in closed form (Singer 1970, eqs 12–13)."""
    e, e2 = math.exp(-x), math.exp(-2.0 * x)
    response = np.array([(x - 1.0 + e) / x**2, (1.0 - e) / x, e])
    q11 = (1.0 - e2 + 2.0 * x + 2.0 * x**3 / 3.0 - 2.0 * x**2 - 4.0 * x * e) / (2.0 * x**5)
    q12 = (e2 + 1.0 - 2.0 * e + 2.0 * x * e - 2.0 * x + x**2) / (2.0 * x**4)
    q13 = (1.0 - e2 - 2.0 * x * e) / (2.0 * x**3)
    q22 = (4.0 * e - 3.0 - e2 + 2.0 * x) / (2.0 * x**3)
    q23 = (e2 + 1.0 - 2.0 * e) / (2.0 * x**2)
    q33 = (1.0 - e2) / (2.0 * x)
    return response, np.array([[q11, q12, q13], [q12, q22, q23], [q13, q23, q33]])
