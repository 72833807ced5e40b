"""Figures of merit of results whose quality is known beforehand."""

from dataclasses import replace

import numpy as np
import pytest

from surefix.comparison.merit import judge, judge_oracle
from surefix.comparison.oracle import oracle
from surefix.comparison.run import clean_trial
from surefix.simulate.contamination import World, draw
from surefix.types import Reason, Verdict

WORLD = World(epochs=300, sigma_m=0.7, interval_s=0.5)


def result(name, **verdicts):
    """A trial, its oracle offline, and a result made of truth, verdicts put in by hand."""
    trial = draw(name, WORLD, 6)
    cleaned = clean_trial(trial, "kalman", "offline")
    n = len(trial.time)
    judged = cleaned.verdicts._replace(
        verdict=np.full(n, int(Verdict.USED)),
        reason=np.full(n, int(Reason.AGREES)),
        weight=np.ones(n),
        detail=np.full(n, np.nan),
    )
    return trial, oracle(trial, "offline"), replace(cleaned, verdicts=judged)


def placed(cleaned, position, sigma):
    return replace(cleaned, track=cleaned.track._replace(position=position, sigma_position=sigma))


def test_ratio_and_nees_follow_the_errors():
    trial, best, cleaned = result("clean")
    error = best.position - trial.position
    for factor in (1.0, 2.5):
        made = placed(cleaned, trial.position + factor * error, 2.0 * factor * best.sigma)
        merit, size = judge(trial, made, best, "offline")
        assert merit.rmse_ratio == pytest.approx(factor)
        assert merit.nees == pytest.approx(judge_oracle(trial, best, "offline").merit.nees / 4.0)
        np.testing.assert_allclose(size, factor * np.linalg.norm(error, axis=1))
    assert judge_oracle(trial, best, "offline").merit.rmse_ratio == 1.0


def test_a_track_with_a_hole_has_no_ratio():
    trial, best, cleaned = result("clean")
    position = best.position.copy()
    position[100, 1] = np.nan
    merit = judge(trial, placed(cleaned, position, best.sigma), best, "offline").merit
    assert np.isnan(merit.rmse_ratio)
    assert np.isnan(merit.nees)


@pytest.mark.parametrize(("row", "counts"), [(5, False), (150, True)])
def test_real_time_is_not_judged_before_it_can_know(row, counts):
    trial, best, cleaned = result("clean")
    position = best.position.copy()
    position[row] += 100.0
    merit = judge(trial, placed(cleaned, position, best.sigma), best, "realtime").merit
    assert (merit.rmse_ratio > 1.0) == counts
    assert judge(trial, placed(cleaned, position, best.sigma), best, "lagged").merit.rmse_ratio > 1


def test_rejections_are_counted_by_what_the_fixes_were():
    trial, best, cleaned = result("isolated-20")
    judged = cleaned.verdicts
    gross, good = np.flatnonzero(trial.bad_fix.all(axis=1)), np.flatnonzero(~trial.bad_fix[:, 0])
    judged.verdict[gross[:45]] = Verdict.REJECTED
    judged.verdict[good[:6]] = Verdict.REJECTED
    merit = judge(trial, cleaned, best, "offline").merit
    assert merit.rejected_gross_pct == pytest.approx(100.0 * 45 / 60)
    assert merit.rejected_good_pct == pytest.approx(100.0 * 6 / 240)


@pytest.mark.parametrize("verdict", [Verdict.REJECTED, Verdict.DOWNWEIGHTED])
@pytest.mark.parametrize(("mask", "share"), [(lambda bad: bad, 100.0), (lambda bad: 7 - bad, 0.0)])
def test_an_axis_is_rejected_where_it_is_the_wrong_one(verdict, mask, share):
    trial, best, cleaned = result("one-axis")
    bad = trial.bad_fix.any(axis=1)
    judged = cleaned.verdicts
    judged.verdict[bad], judged.reason[bad], judged.weight[bad] = verdict, Reason.AXIS_OFF, 0.0
    judged.detail[bad] = mask((trial.bad_fix << np.arange(3)).sum(axis=1))[bad]
    assert judge(trial, cleaned, best, "offline").merit.rejected_gross_pct == share


def test_small_errors_are_neither_gross_nor_good():
    trial, best, cleaned = result("small")
    size = np.abs(trial.error).max(axis=1) / WORLD.sigma_m
    cleaned.verdicts.verdict[(size > 0.0) & (size <= 8.0)] = Verdict.REJECTED
    merit = judge(trial, cleaned, best, "offline").merit
    assert merit.rejected_gross_pct == 0.0
    assert merit.rejected_good_pct == 0.0


@pytest.mark.parametrize("late", [0, 7, 31])
def test_return_after_a_jump_is_timed_in_intervals(late):
    trial, _, cleaned = result("jump")
    best = oracle(trial, "realtime")
    position = best.position.copy()
    position[trial.jump : trial.jump + late] += 10.0
    made = placed(cleaned, position, best.sigma)
    assert judge(trial, made, best, "realtime").merit.back_fixes == pytest.approx(late)
    assert judge(trial, made, best, "realtime").merit.rmse_ratio == pytest.approx(1.0)
    assert np.isnan(judge(trial, made, best, "lagged").merit.back_fixes)
    lost = placed(cleaned, trial.position + 50.0, best.sigma)
    assert np.isnan(judge(trial, lost, best, "realtime").merit.back_fixes)


def test_noise_is_held_against_the_true_one():
    trial, best, cleaned = result("clean")
    doubled = tuple(
        each._replace(value=2.0 * (WORLD.sigma_m if each.unit == "m" else WORLD.sigma_mps))
        if each.sensor != "motion"
        else each._replace(value=3.0 * WORLD.process)
        for each in cleaned.noise
    )
    merit = judge(trial, replace(cleaned, noise=doubled), best, "offline").merit
    figures = merit.noise_position, merit.noise_velocity, merit.noise_motion
    assert figures == pytest.approx((2.0, 2.0, 3.0))
    given = tuple(each._replace(source="given") for each in doubled)
    assert np.isnan(judge(trial, replace(cleaned, noise=given), best, "offline").merit[4:7]).all()
