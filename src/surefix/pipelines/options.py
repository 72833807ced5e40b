"""Options of `surefix clean`: one frozen record, validated once."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from types import MappingProxyType
from typing import Any, Literal, get_args

from surefix.errors import OptionsError
from surefix.filters.deciding import AHEAD, THRESHOLDS, Decider
from surefix.models.motion import MODELS
from surefix.robust.loss import LOSSES, Loss, loss_named

__all__ = ["METHODS", "MULTI_HYPOTHESIS", "CleanOptions", "Latency", "Mode", "options_from"]

Mode = Literal["realtime", "lagged", "offline"]
Latency = Literal["report", "remove", "ignore"]

MULTI_HYPOTHESIS = "multi-hypothesis"
_CIPRA_ROMERA = "cipra-romera"
METHODS = (MULTI_HYPOTHESIS, *LOSSES, _CIPRA_ROMERA, *THRESHOLDS)
"""Names of the estimators: several hypotheses, one with a robust loss, or a cleaner before it."""


_RECOVERY = 30.0  # intervals of unbroken rejection after which a sensor is believed again
_RUN = 39.5  # … longest run of wrong observations that several hypotheses survive


@dataclass(frozen=True, kw_only=True)
class CleanOptions:
    """How a log is cleaned. Every figure left at None is taken from the data and reported.

    Parameters
    ----------
    mode
        ``realtime``: each fix is judged and estimated from the past alone. ``lagged``: from the
        past and ``lag_s`` seconds of future. ``offline``: from the whole log.
    method
        The estimator, one of ``METHODS``: several hypotheses, one with a robust loss, or one with a
        cleaner that decides before it. 53H and Hampel look ahead: not in real time.
    model
        Motion model: ``cv`` constant velocity, ``ca`` constant acceleration, ``auto`` the likelier
        of the two (``cv`` if ``process`` is given, for their units differ).
    k0, k1
        Constants of the loss, standard deviations (Student-t: k0 is ν); k0 is the threshold of a
        cleaner.
    false_alarm
        Share of good fixes that ``gate`` may reject.
    lag_s
        Seconds of future in the lagged mode; default 20 intervals between fixes.
    recovery_s
        Seconds of unbroken rejection after which a track believes its sensor again; default 30
        intervals between fixes; no loss locks out for longer. Runs of errors may be followed
        sooner where only fixes support the track. With several hypotheses it is the longest run of
        wrong fixes that is survived, default 39.5 intervals.
    sigma_position, sigma_height, sigma_velocity
        Noise of the fixes: horizontal m, vertical m, velocity m/s.
    sensor_sigma
        Noise of single sensors, by name: of the positions of a sensor that has some, else of its
        depths or velocities. Wins over the three above.
    sensor_delay_s
        How much too late a sensor's times are, s, by name; subtracted.
    lever_arm
        Where antennas are, by name of a sensor or of an input: forward, starboard and up from the
        reference point, m. Positions are those of the reference point then. It takes headings.
    sigma_heading_deg, sigma_attitude_deg
        Standard deviation of the heading that carries lever arms and turns velocities, and of the
        roll and pitch that carry lever arms, deg.
    process
        Root of the process noise density: m/s^1.5 (cv) or m/s^2.5 (ca).
    every_s
        Also give the track at regular times, s apart.
    reorder_s
        Rows up to this many seconds out of order are put in their place.
    latency
        What is done about fixes that are late against a velocity: ``report`` says so, ``remove``
        also takes the delay off their times (not in real time), ``ignore`` does not look.
    drags
        Look for fixes that wander off slowly beside velocities or another sensor. These must have
        no bias and their times must be right: else good fixes are taken for a drag.
    settle_rows
        In real time: rows that frame, noise figures and height offsets are settled on before the
        first result, at least 10. Scalar series are settled on as many values, but no more than
        2,000.
    held
        Count a position that is polled again only once.
    """

    mode: Mode = "offline"
    method: str = MULTI_HYPOTHESIS
    model: str = "auto"
    k0: float | None = None
    k1: float | None = None
    false_alarm: float = 0.0027
    lag_s: float | None = None
    recovery_s: float | None = None
    sigma_position: float | None = None
    sigma_height: float | None = None
    sigma_velocity: float | None = None
    sensor_sigma: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))
    sensor_delay_s: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))
    lever_arm: Mapping[str, Sequence[float]] = field(default_factory=lambda: MappingProxyType({}))
    sigma_heading_deg: float = 1.0
    sigma_attitude_deg: float = 0.5
    process: float | None = None
    every_s: float | None = None
    reorder_s: float = 10.0
    latency: Latency = "report"
    drags: bool = False
    settle_rows: int = 20_000
    held: bool = True

    def __post_init__(self) -> None:
        _one_of("mode", self.mode, get_args(Mode))
        _one_of("method", self.method, METHODS)
        _one_of("model", self.model, (*MODELS, "auto"))
        _one_of("latency", self.latency, get_args(Latency))
        if self.latency == "remove" and self.mode == "realtime":
            raise OptionsError(
                "latency remove in mode realtime",
                "mode lagged or offline, which see the log before it is cleaned",
                "take the delay from surefix info and give it as --sensor-delay NAME=SECONDS",
            )
        for name in _POSITIVE:
            _positive(name, getattr(self, name))
        for name in ("sensor_sigma", "sensor_delay_s"):
            if not isinstance(getattr(self, name), Mapping):
                raise OptionsError(f"{name} = {getattr(self, name)!r}", "figures by sensor name")
        for sensor, value in self.sensor_sigma.items():
            _positive(f"sigma of sensor {sensor!r}", value)
        for sensor, value in self.sensor_delay_s.items():
            _number(f"delay of sensor {sensor!r}", value)
        if not isinstance(self.lever_arm, Mapping):
            raise OptionsError(
                f"lever_arm = {self.lever_arm!r}", "[forward, starboard, up] by name"
            )
        for sensor, arm in self.lever_arm.items():
            if not isinstance(arm, list | tuple) or len(arm) != 3:
                raise OptionsError(
                    f"lever arm {arm!r} of {sensor!r}", "[forward, starboard, up], m"
                )
            for value in arm:
                _number(f"lever arm of {sensor!r}", value)
        for name in ("k0", "k1"):
            if getattr(self, name) is not None:
                _number(name, getattr(self, name))
        if self.lag_s is not None and self.mode != "lagged":
            raise OptionsError(f"a lag in mode {self.mode}", "mode lagged")
        if self.method in ("kalman", "gate", MULTI_HYPOTHESIS) and (self.k0, self.k1) != (
            None,
            None,
        ):
            raise OptionsError(f"k0 or k1 with method {self.method}", "a method that has them")
        if self.k1 is not None and self.method in (_CIPRA_ROMERA, *THRESHOLDS):
            raise OptionsError(f"k1 with method {self.method}", "k0 alone")
        if self.method in THRESHOLDS:
            _positive("k0", self.k0)
        if AHEAD.get(self.method, 0) > 0 and self.mode == "realtime":
            raise OptionsError(
                f"method {self.method}, which looks ahead, in mode realtime",
                "mode lagged or offline",
                "method median decides from the past",
            )
        if not 0.0 < _number("false_alarm", self.false_alarm) < 1.0:
            raise OptionsError(f"false_alarm = {self.false_alarm}", "a share between 0 and 1")
        if _number("reorder_s", self.reorder_s) < 0.0:
            raise OptionsError(f"reorder_s = {self.reorder_s}", "seconds, zero or more")
        if _number("settle_rows", self.settle_rows) < 10 or self.settle_rows % 1:
            raise OptionsError(f"settle_rows = {self.settle_rows}", "a whole number from 10 on")
        for name in ("held", "drags"):
            if not isinstance(getattr(self, name), bool):
                raise OptionsError(f"{name} = {getattr(self, name)!r}", "true or false")
        self.loss  # noqa: B018  # refuses constants that do not fit the method

    def __reduce__(self) -> tuple[object, ...]:
        """Let processes exchange options: their mappings travel as plain ones."""
        given = {f.name: getattr(self, f.name) for f in fields(self)}
        plain = {name: dict(v) if isinstance(v, Mapping) else v for name, v in given.items()}
        return options_from, (plain,)

    @property
    def loss(self) -> Loss:
        """The robust loss these options ask for; none for a cleaner or several hypotheses."""
        if self.several or self.decider is not None:
            return loss_named("kalman")
        if self.method == _CIPRA_ROMERA:
            return loss_named("huber", k0=self.k0)._replace(by_noise=1)
        return loss_named(self.method, k0=self.k0, k1=self.k1, false_alarm=self.false_alarm)

    @property
    def for_series(self) -> CleanOptions:
        """The same for a scalar series: it goes by IGG3 where positions have several hypotheses."""
        return replace(self, method="igg3") if self.several else self

    @property
    def several(self) -> bool:
        """Whether several hypotheses are kept."""
        return self.method == MULTI_HYPOTHESIS

    def patience(self, interval: float) -> float:
        """Seconds of wrong observations, ``interval`` apart, that are survived at most."""
        usual = _RUN if self.several else _RECOVERY
        return float(self.recovery_s or usual * interval)

    @property
    def decider(self) -> Decider | None:
        """The cleaner that decides before the filter; None for the other methods."""
        usual = THRESHOLDS.get(self.method)
        if usual is None:
            return None
        return Decider(self.method, usual if self.k0 is None else float(self.k0))

    @property
    def by_axis(self) -> bool:
        """Whether each axis of a fix is judged by itself, and not the horizontal ones together."""
        return self.method not in LOSSES

    @property
    def models(self) -> tuple[str, ...]:
        """The motion models to choose from."""
        if self.model != "auto":
            return (self.model,)
        return ("cv",) if self.process is not None else tuple(MODELS)


_POSITIVE = (
    "lag_s",
    "recovery_s",
    "sigma_position",
    "sigma_height",
    "sigma_velocity",
    "sigma_heading_deg",
    "sigma_attitude_deg",
    "process",
    "every_s",
)


def _one_of(name: str, value: object, known: Iterable[str]) -> None:
    if not isinstance(value, str) or value not in known:
        raise OptionsError(f"{name} {value!r}", "one of " + ", ".join(known))


def _positive(name: str, value: object) -> None:
    if value is not None and _number(name, value) <= 0.0:
        raise OptionsError(f"{name} = {value}", "a finite number above zero")


def _number(name: str, value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise OptionsError(f"{name} = {value!r}", "a finite number")
    return float(value)


def options_from(table: Mapping[str, Any]) -> CleanOptions:
    """Make options from a mapping of names, such as a table of a TOML file.

    Raises
    ------
    OptionsError
        An unknown name (the message lists the known ones) or an impossible value.
    """
    known = {f.name for f in fields(CleanOptions)}
    unknown = sorted(set(table) - known)
    if unknown:
        raise OptionsError(f"option {unknown[0]!r}", "one of " + ", ".join(sorted(known)))
    return CleanOptions(**table)
