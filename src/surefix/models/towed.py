"""Motion of a towed body: six states, heading and speed through water that a current carries.

The state is ``[latitude, longitude, v_N, v_E, heading, speed]`` (paper 002, eq. 1): ``v_N, v_E``
are the current, a first-order Gauss–Markov process of standard deviation σ and inverse correlation
time β, correlated as ``σ² exp(−β|Δt|)`` (eq. 2); heading and speed walk at random about the rates
of the towing ship. The paper writes latitude and longitude as if they were metres. Here the mean
holds radians and **all matrices hold metres north and east**: position errors are metres, and
`moved` and `offset` go from metres to radians and back with the radii of the WGS-84 ellipsoid, so
the same matrices hold at any latitude.

Source: paper 002, eqs 1–8; covariance by integrating ``Φ(τ) Q_c Φ(τ)ᵀ`` (Van Loan, IEEE Trans.
Automatic Control 23, 1978, gives the same numerically).
"""

from __future__ import annotations

import math
from typing import NamedTuple, TypeVar

import numpy as np
from pyproj import Geod

from surefix.errors import OptionsError
from surefix.jit import helper
from surefix.types import FloatArray

__all__ = [
    "OBSERVED",
    "STATES",
    "TowedModel",
    "add_noise_factor",
    "control_input",
    "dynamics",
    "fill_transition",
    "moved",
    "noise_factor",
    "offset",
    "printed_transition",
    "radii",
    "towed_model",
    "transition",
]

Number = TypeVar("Number", float, FloatArray)

STATES = ("latitude", "longitude", "v_N", "v_E", "heading", "speed")
OBSERVED: FloatArray = np.eye(6)[[0, 1, 4, 5]]
"""H of eq. 8, (4, 6): latitude and longitude (as metres), heading, speed."""

_EARTH = Geod(ellps="WGS84")
_A, _E2 = float(_EARTH.a), float(_EARTH.es)


class TowedModel(NamedTuple):
    """What drives the motion; make it with `towed_model`.

    Parameters
    ----------
    beta
        Inverse correlation time β of the current, 1/s.
    current
        Its standard deviation σ, m/s.
    position, heading, speed
        Spectral densities of the white noises w₁ = w₂, w₅ and w₆: m²/s, rad²/s and m²/s³.
    """

    beta: float
    current: float
    position: float
    heading: float
    speed: float


def towed_model(
    *,
    correlation_s: float = 600.0,
    current_mps: float = 0.15,
    position: float = 1e-4,
    heading_deg: float = 0.1,
    speed_mps: float = 0.01,
) -> TowedModel:
    """Make a model from figures that one can judge.

    Parameters
    ----------
    correlation_s
        Correlation time 1/β of the current, s.
    current_mps
        Standard deviation of each component of the current, m/s.
    position
        Spectral density of what else moves the body, m²/s.
    heading_deg, speed_mps
        How far heading and speed walk in one second, degrees and m/s.

    Raises
    ------
    OptionsError
        A figure is negative or not finite, or the correlation time is 0.
    """
    given = (correlation_s, current_mps, position, heading_deg, speed_mps)
    if not all(math.isfinite(v) and v >= 0.0 for v in given) or correlation_s == 0.0:
        raise OptionsError(f"towed model {given}", "finite figures ≥ 0, correlation time > 0")
    q_heading = math.radians(heading_deg) ** 2
    return TowedModel(1.0 / correlation_s, current_mps, position, q_heading, speed_mps**2)


@helper
def radii(latitude: Number) -> tuple[Number, Number]:
    """Radii of curvature M of the meridian and N across it, m, at a latitude in rad (WGS-84)."""
    w2: Number = 1.0 - _E2 * np.sin(latitude) ** 2
    w: Number = np.sqrt(w2)
    return _A * (1.0 - _E2) / (w2 * w), _A / w


@helper
def moved(
    latitude: Number, longitude: Number, north: Number, east: Number
) -> tuple[Number, Number]:
    """Go some metres north and east: ``φ + n/M, λ + e/(N cos φ)`` with the radii halfway.

    Right to a millimetre for steps up to a kilometre and latitudes up to 80°; not at the poles,
    where north has no meaning.

    Parameters
    ----------
    latitude, longitude
        rad; scalars or (n,).
    north, east
        m.

    Returns
    -------
    latitude, longitude
        rad, the longitude in ±π.
    """
    meridian, _ = radii(latitude)
    meridian, _ = radii(latitude + 0.5 * north / meridian)
    upward: Number = north / meridian
    _, across = radii(latitude + 0.5 * upward)
    turned: Number = longitude + east / (across * np.cos(latitude + 0.5 * upward))
    wrapped: Number = turned - 2.0 * np.pi * np.floor(turned / (2.0 * np.pi) + 0.5)
    return latitude + upward, wrapped


@helper
def offset(
    latitude: Number, longitude: Number, to_latitude: Number, to_longitude: Number
) -> tuple[Number, Number]:
    """Metres north and east from one position to another, the short way round; undoes `moved`.

    Parameters
    ----------
    latitude, longitude, to_latitude, to_longitude
        rad; scalars or (n,).
    """
    half: Number = 0.5 * (latitude + to_latitude)
    meridian, across = radii(half)
    turn: Number = to_longitude - longitude
    short: Number = turn - 2.0 * np.pi * np.floor(turn / (2.0 * np.pi) + 0.5)
    return (to_latitude - latitude) * meridian, short * across * np.cos(half)


def dynamics(heading: float, speed: float, beta: float) -> FloatArray:
    """A of eq. 4, (6, 6), linearised at a heading in rad and a speed in m/s; β in 1/s."""
    A = np.zeros((6, 6))
    A[0, 2] = A[1, 3] = 1.0
    A[0, 4:] = -speed * math.sin(heading), math.cos(heading)
    A[1, 4:] = speed * math.cos(heading), math.sin(heading)
    A[2, 2] = A[3, 3] = -beta
    return A


def transition(heading: float, speed: float, beta: float, dt: float) -> FloatArray:
    """Transition Φ = exp(A Δt), (6, 6), exact; arguments as `dynamics`, Δt in s.

    >>> transition(0.0, 2.0, 0.01, 10.0)[0].round(3)
    array([ 1.   ,  0.   ,  9.516,  0.   , -0.   , 10.   ])
    """
    F = np.zeros((6, 6))
    fill_transition(F, heading, speed, beta, dt)
    return F


def printed_transition(heading: float, speed: float, beta: float, dt: float) -> FloatArray:
    """Φ to second order in Δt as printed, eq. 6: good while βΔt is small."""
    A = dynamics(heading, speed, beta) * dt
    return np.asarray(np.eye(6) + A + 0.5 * A @ A)


def control_input(heading: float, speed: float, dt: float) -> FloatArray:
    """Input ``U u`` of eq. 5, (6,): what makes ``Φ x + U u`` the motion itself at the estimate.

    ``[v̂ sin θ̂ · θ̂ Δt, −v̂ cos θ̂ · θ̂ Δt, 0, 0, 0, 0]``. The paper prints the second component
    without the minus; the expansion of ``v sin θ`` needs it.
    """
    turned = speed * heading * dt
    return np.array([turned * math.sin(heading), -turned * math.cos(heading), 0.0, 0.0, 0.0, 0.0])


def noise_factor(heading: float, speed: float, dt: float, model: TowedModel) -> FloatArray:
    """Factor G, (6, 10), of the process noise ``Q = G Gᵀ`` over Δt; exact for the linear model.

    Two columns per source: white position noise, the two current components, heading, speed.
    """
    G = np.zeros((6, 10))
    add_noise_factor(G, heading, speed, dt, model, 0)
    return G


@helper
def fill_transition(F: FloatArray, heading: float, speed: float, beta: float, dt: float) -> None:
    """Write Φ into ``F`` (6, 6); arguments as `transition`."""
    carried = -math.expm1(-beta * dt) / beta
    sine, cosine = math.sin(heading), math.cos(heading)
    F[:] = 0.0
    for i in range(6):
        F[i, i] = 1.0
    for i in range(2):
        F[i, 2 + i] = carried
        F[2 + i, 2 + i] = math.exp(-beta * dt)
    F[0, 4], F[0, 5] = -speed * dt * sine, dt * cosine
    F[1, 4], F[1, 5] = speed * dt * cosine, dt * sine


@helper
def add_noise_factor(
    A: FloatArray, heading: float, speed: float, dt: float, model: TowedModel, column: int
) -> None:
    """Write the factor of `noise_factor` into ``A[:, column:column + 10]``, which must be zero."""
    if dt <= 0.0:
        return
    b = model.beta * dt
    fade = -math.expm1(-b)
    if b < 0.02:
        tail = 7.0 / 60.0 - b * (1.0 / 24.0 - b * (31.0 / 2520.0))
        strayed = b**3 * (1.0 / 3.0 - b * (1.0 / 4.0 - b * tail))
    else:
        strayed = b - 2.0 * fade - 0.5 * math.expm1(-2.0 * b)
    held = model.current * math.sqrt(-math.expm1(-2.0 * b))
    dragged = held and (model.current * fade) ** 2 / (model.beta * held)
    spread = 2.0 * strayed * (model.current / model.beta) ** 2
    rest = math.sqrt(max(spread - dragged * dragged, 0.0))
    for i in range(2):
        A[i, column + i] = math.sqrt(model.position * dt)
        A[2 + i, column + 2 + 2 * i] = held
        A[i, column + 2 + 2 * i] = dragged
        A[i, column + 3 + 2 * i] = rest
    sine, cosine = math.sin(heading), math.cos(heading)
    for i in range(2):
        root = math.sqrt((model.heading if i == 0 else model.speed) * dt)
        north = -speed * sine if i == 0 else cosine
        east = speed * cosine if i == 0 else sine
        at = column + 6 + 2 * i
        A[4 + i, at] = root
        A[0, at], A[1, at] = 0.5 * root * dt * north, 0.5 * root * dt * east
        short = root * dt / math.sqrt(12.0)
        A[0, at + 1], A[1, at + 1] = short * north, short * east
