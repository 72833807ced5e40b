"""Paper 002: the M-estimation Kalman filter for the motion of a towed synthetic-aperture sonar."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from surefix.errors import OptionsError
from surefix.experiment import Experiment, Progress, Table, check_least, gather
from surefix.metrics import mean_bounds
from surefix.models.towed import STATES, towed_model
from surefix.papers.towed_figures import figures
from surefix.papers.towed_methods import (
    AGAIN_S,
    Estimate,
    estimate,
    estimate_several,
    measured_rmse,
    nees,
    position_rmse,
    state_rmse,
    stretches,
)
from surefix.simulate.towed import TowedSurvey, simulate
from surefix.types import FloatArray

__all__ = ["TowedOptions", "run"]

_SOURCE: Final = (
    "Zhu, Huang and Zhang, Synthetic aperture sonar movement estimation using the robust Kalman "
    "filter, J. Xidian University 34(3), 2007 (paper 002)"
)
_TITLE: Final = "Position, heading, speed and current of a towed sonar from GPS, compass and log"
_UNITS: Final = ("m", "m", "m/s", "m/s", "°", "m/s")
_BOTH: Final = "with RTS: of the oracle's with RTS"
_SHARES: Final = (0.0, 0.05, 0.1, 0.2)

KF, PRINTED, W2, BOTH = "KF", "M eqs 19", "M iterated, W₂", "M iterated, W₁ W₂"
W1, IGG3, GATED, STUDENT = "M iterated, W₁", "IGG3 eqs 19", "IGG3 innovation", "Student-t iterated"
ORACLE, RTS = "oracle", " + RTS"
SEVERAL = "multi-hypothesis" + RTS

_MAIN: Final = (KF, PRINTED, W2, BOTH, STUDENT, IGG3, GATED, ORACLE)
_SMOOTHED: Final = (PRINTED, ORACLE)
_SHARED: Final = (KF, PRINTED, W2, BOTH, STUDENT, GATED)
_STATE_SIDE: Final = (KF, PRINTED, W2, BOTH, W1, GATED, ORACLE)


@dataclass(frozen=True, kw_only=True)
class TowedOptions:
    """What the experiment is drawn from; the paper prints none of these figures.

    Parameters
    ----------
    seed, runs
        Seed of everything, and number of surveys.
    minutes, interval_s
        Duration of a survey, at least 9 min, and nominal step of its epochs, s.
    latitude_deg, longitude_deg
        Where it begins; not within half a degree of a pole.
    contamination, spread
        Share ε of each sensor's values that are bad, and how many times wider they spread.
    k0
        Constant of Huber's loss, standard deviations.
    gust_mps
        Step of the current where the state is what goes wrong, m/s.
    """

    seed: int = 1
    runs: int = 20
    minutes: float = 20.0
    interval_s: float = 1.0
    latitude_deg: float = 36.0
    longitude_deg: float = 121.0
    contamination: float = 0.1
    spread: float = 20.0
    k0: float = 1.5
    gust_mps: float = 1.0

    def __post_init__(self) -> None:
        check_least(self, seed=0, runs=1)
        for name, low, high in (
            ("minutes", 9.0, 1e4),
            ("interval_s", 0.2, 30.0),
            ("latitude_deg", -89.5, 89.5),
            ("longitude_deg", -360.0, 360.0),
            ("contamination", 0.0, 1.0),
            ("spread", 1.0, 1e6),
            ("k0", 0.1, 100.0),
            ("gust_mps", 0.0, 100.0),
        ):
            given = getattr(self, name)
            if not low <= given <= high:
                raise OptionsError(f"{name} = {given}", f"{low:g} … {high:g}")


def run(options: TowedOptions, progress: Progress | None = None) -> Experiment:
    """Run the experiment: the paper's comparison, then what it leaves open.

    Parameters
    ----------
    options
        Scenario, seed and number of runs.
    progress
        Told the number of finished runs.
    """
    done = []
    first: tuple[TowedSurvey, dict[str, Estimate]] | None = None
    for i in range(options.runs):
        seed = int(np.random.SeedSequence([options.seed, i]).generate_state(1)[0])
        survey = _survey(options, seed)
        estimates = _estimates(survey, options.k0)
        first = first or (survey, estimates)
        figures_of_merit = {
            "rmse": {"measured": measured_rmse(survey)}
            | {name: state_rmse(e) for name, e in estimates.items()},
            "ratio": _ratios(estimates),
            "position_m": {name: stretches(survey, e) for name, e in estimates.items()},
            "nees": {name: nees(e) for name, e in estimates.items()},
            **_contaminated(options, seed),
            "state_side_m": _state_side(options, seed),
        }
        done.append(figures_of_merit)
        if progress:
            progress(i + 1)
    assert first is not None
    tables = _tables(options, done)
    return Experiment(
        paper="towed",
        title=_TITLE,
        source=_SOURCE,
        seed=options.seed,
        runs=options.runs,
        tables=tables,
        figures=figures(*first, tables[4:6]),
        findings=_findings(options, {table.key: table for table in tables}),
    )


def _survey(options: TowedOptions, seed: int, **changed: Any) -> TowedSurvey:
    given = {
        "minutes": options.minutes,
        "interval_s": options.interval_s,
        "latitude_deg": options.latitude_deg,
        "longitude_deg": options.longitude_deg,
        "contamination": options.contamination,
        "spread": options.spread,
    }
    return simulate(seed, **(given | changed))


def _estimates(survey: TowedSurvey, k0: float) -> dict[str, Estimate]:
    found = {name: estimate(survey, name, k0) for name in _MAIN}
    for name in _SMOOTHED:
        found[name + RTS] = estimate(survey, name, k0, smooth=True)
    return found | {SEVERAL: estimate_several(survey)}


def _ratios(estimates: dict[str, Estimate]) -> dict[str, FloatArray]:
    """RMSE over that of the oracle of the same kind: filter or smoother."""
    out = {}
    for name, found in estimates.items():
        best = ORACLE + (RTS if name.endswith(RTS) else "")
        if name != best:
            out[name] = state_rmse(found) / state_rmse(estimates[best])
    return out


def _contaminated(options: TowedOptions, seed: int) -> dict[str, dict[str, list[float]]]:
    """RMSE of position at the surface and of heading over the oracle's, for each share ε."""
    names = (*_SHARED, SEVERAL)
    place: dict[str, list[float]] = {name: [] for name in names}
    heading: dict[str, list[float]] = {name: [] for name in names}
    for share in _SHARES:
        survey = _survey(options, seed, contamination=share)
        filtered, smoothed = (estimate(survey, ORACLE, smooth=smooth) for smooth in (False, True))
        up = survey.surfaced
        for name in names:
            ours = name == SEVERAL
            best = smoothed if ours else filtered
            found = estimate_several(survey) if ours else estimate(survey, name, options.k0)
            place[name].append(position_rmse(found, up) / position_rmse(best, up))
            heading[name].append(state_rmse(found)[4] / state_rmse(best)[4])
    return {"position_ratio": place, "heading_ratio": heading}


def _state_side(options: TowedOptions, seed: int) -> dict[str, list[float]]:
    """Position RMSE at the surface where the motion, not the sensor, is what goes wrong."""
    kicked = {
        "minutes": 9.0,
        "stretch_s": 600.0,
        "sigma_position_m": 0.5,
        "state_contamination": 0.05,
        "model": towed_model(position=0.25),
    }
    surveys = (
        _survey(options, seed, gust_mps=options.gust_mps, contamination=0.0),
        _survey(options, seed, gust_mps=options.gust_mps),
        _survey(options, seed, contamination=0.0, **kicked),
        _survey(options, seed, **kicked),
    )
    found = {
        name: [position_rmse(estimate(s, name, options.k0), s.surfaced) for s in surveys]
        for name in _STATE_SIDE
    }
    found[ORACLE + RTS] = [
        position_rmse(estimate(s, ORACLE, smooth=True), s.surfaced) for s in surveys
    ]
    return found | {SEVERAL: [position_rmse(estimate_several(s), s.surfaced) for s in surveys]}


def _tables(options: TowedOptions, done: list[dict[str, Any]]) -> tuple[Table, ...]:
    bad = f"{100 * options.contamination:g} % bad"
    states = tuple(f"{name} {unit}" for name, unit in zip(STATES, _UNITS, strict=True))
    shares = tuple(f"ε {100 * share:g} %" for share in _SHARES)
    low, high = mean_bounds(6, options.runs)
    shown: tuple[tuple[str, str, tuple[str, ...], dict[str, Any]], ...] = (
        ("rmse", "RMSE of the states", states, {"note": "measured: GPS at the surface only"}),
        (
            "ratio",
            "RMSE as a multiple of the oracle's",
            STATES,
            {"digits": 2, "note": _BOTH},
        ),
        (
            "position_m",
            "Position RMSE",
            ("surface", f"first {AGAIN_S:g} s up again", "below"),
            {"unit": "m", "digits": 2},
        ),
        (
            "nees",
            "NEES",
            ("states (6)", "position (2)", "current (2)", "heading, speed (2)"),
            {
                "digits": 2,
                "note": "honest: the number in brackets; 6 of one epoch of all runs "
                f"within {low:.2f} … {high:.2f}",
            },
        ),
        (
            "position_ratio",
            "Position RMSE at the surface, multiple of the oracle's",
            shares,
            {"digits": 2, "note": _BOTH},
        ),
        (
            "heading_ratio",
            "Heading RMSE, multiple of the oracle's",
            shares,
            {"digits": 2, "note": _BOTH},
        ),
        (
            "state_side_m",
            "Position RMSE at the surface when the motion goes wrong",
            tuple(f"{what}, {share}" for what in ("gust", "kicks") for share in ("0 % bad", bad)),
            {
                "unit": "m",
                "digits": 2,
                "note": f"gust {options.gust_mps:g} m/s; kicks: fixes of 0.5 m, motion of 0.5 m "
                "per √s that is ten times as much in 5 % of the seconds",
            },
        ),
    )
    return tuple(
        gather(key, title, columns, [each[key] for each in done], **more)
        for key, title, columns, more in shown
    )


def _findings(options: TowedOptions, tables: dict[str, Table]) -> tuple[str, ...]:
    def at(key: str, row: str, column: int) -> float:
        table = tables[key]
        return float(table.mean[table.rows.index(row), column])

    states, place, kicks = "rmse", "position_m", "state_side_m"
    return (
        f"With {100 * options.contamination:g} % bad values the M-filter of eqs 19 keeps heading "
        f"to {at(states, PRINTED, 4):.2f}° and speed to {at(states, PRINTED, 5):.3f} m/s; the "
        f"Kalman filter {at(states, KF, 4):.2f}° and {at(states, KF, 5):.3f} m/s, the oracle "
        f"{at(states, ORACLE, 4):.2f}° and {at(states, ORACLE, 5):.3f} m/s.",
        f"Position at the surface: Kalman {at(place, KF, 0):.2f} m, eqs 19 "
        f"{at(place, PRINTED, 0):.2f} m, oracle {at(place, ORACLE, 0):.2f} m.",
        f"Up again after a dive the prediction is vague: iterated to the minimum of eq. 15 the "
        f"filter is {at(place, W2, 1):.1f} m off, after the one sweep of eqs 19 "
        f"{at(place, PRINTED, 1):.1f} m.",
        f"A loss that rejects, in eqs 19: {at(place, IGG3, 0):.0f} m at the surface, because "
        "residuals over R alone reject every fix after a dive.",
        f"W₁ acts where the motion is as uncertain as the fix: with kicks and good fixes it takes "
        f"the iterated filter from {at(kicks, W2, 2):.2f} m to {at(kicks, BOTH, 2):.2f} m; with "
        f"bad fixes among them, from {at(kicks, W2, 3):.2f} m to {at(kicks, BOTH, 3):.2f} m.",
        f"Several hypotheses, offline, keep heading and speed within "
        f"{at('ratio', SEVERAL, 4):.3f} and {at('ratio', SEVERAL, 5):.3f} times the smoothed "
        f"oracle's errors, and the position at the surface within "
        f"{at(place, SEVERAL, 0) / at(place, ORACLE + RTS, 0):.3f} times.",
        f"Smoothed offline, the position below is {at(place, PRINTED + RTS, 2):.2f} m off "
        f"instead of {at(place, PRINTED, 2):.2f} m.",
    )
