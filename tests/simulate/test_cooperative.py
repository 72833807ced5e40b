"""The two cases of paper 001: the printed path, noise of the size that is said, equal bits."""

import numpy as np
import pytest

from surefix.errors import OptionsError
from surefix.models.ranging import locate, range_to, range_variance
from surefix.simulate.cooperative import START_SIGMA, Formation, path, simulate, stack


def test_path_of_case_1_is_the_printed_one():
    time = np.arange(101.0)
    x, y, z = path(1, time).T
    assert (x == y).all()
    assert (x[0], x[-1], z.min(), z.max()) == (0.0, 100.0, 0.0, 500.0)
    assert z[69] == pytest.approx(72.2)


def test_masters_of_case_1_sail_one_knot_east_north_and_north_east():
    master = simulate(Formation(), 1).master
    speed = np.linalg.norm(np.diff(master, axis=1), axis=-1)
    assert speed == pytest.approx(np.full((3, 99), 1852.0 / 3600.0))
    assert master[:, 0].tolist() == [[0.0] * 3] * 3
    assert np.degrees(np.arctan2(*master[:, -1, 1::-1].T)) == pytest.approx([0.0, 90.0, 45.0])


def test_slave_of_case_2_is_the_centroid_of_three_and_three_keep_their_course():
    time = np.arange(100.0)
    master = np.mean([simulate(Formation(case=2), seed).master for seed in range(60)], axis=0)
    assert np.abs(master[:3].mean(axis=0) - path(2, time)).max() < 1.0
    bend = np.abs(np.diff(master, 2, axis=1)).max(axis=(1, 2))
    assert bend[0] > 0.3
    assert (bend[1:] < 0.3).all()
    assert (np.diff(path(2, time)[:, 0]) > 0.0).all()


@pytest.mark.parametrize("case", [1, 2])
@pytest.mark.parametrize("variance", [1.0e6, 2.5e7])
def test_noise_has_the_size_that_is_said(case, variance):
    formation = Formation(case=case, squared_variance=variance)
    runs = stack([simulate(formation, seed) for seed in range(40)])
    seen = locate(runs.observed, runs.master, runs.attitude)
    sigma = np.sqrt(range_variance(variance, range_to(runs.truth[:, None], runs.master)))
    scaled = (seen - runs.truth[:, None]) / sigma[..., None]
    assert scaled.std() == pytest.approx(1.0, abs=0.01)
    assert abs(scaled.mean()) < 0.02
    assert (runs.truth == runs.path).all()


def test_quality_is_along_across_and_up():
    formation = Formation(quality=((0.1, 1.0, 2.0),) * 3)
    good = stack([simulate(formation, seed) for seed in range(20)])
    plain = stack([simulate(Formation(), seed) for seed in range(20)])
    size = (good.observed - plain.observed).std(axis=(0, 1, 2)) / plain.observed.std()
    assert size[1] == 0.0
    assert size[0] > 0.0
    assert size[2] > 0.0


@pytest.mark.parametrize("reading", ["components", "range"])
def test_squares_have_variance_R(reading):
    formation = Formation(reading=reading)
    runs = stack([simulate(formation, seed) for seed in range(30)])
    exact = np.square(runs.truth[:, None] - runs.master)
    if reading == "range":
        exact = exact.sum(axis=-1, keepdims=True)
    assert (runs.observed - exact).var() == pytest.approx(2.5e7, rel=0.05)


def test_process_noise_grows_with_time_however_it_is_cut():
    for period in ((), (0.5, 0.7, 3.0)):
        formation = Formation(process=5.0, period_s=period)
        off = [simulate(formation, seed) for seed in range(300)]
        end = np.array([run.truth[-1] - run.path[-1] for run in off])
        assert end.var() == pytest.approx(5.0 * 99.0, rel=0.15)
        start = np.array([run.guess - run.truth[0] for run in off])
        assert start.std() == pytest.approx(START_SIGMA, rel=0.1)


def test_each_master_observes_at_its_own_period():
    formation = Formation(period_s=(1.0, 1.4, 1.9), step_s=2.0, count=50)
    world = simulate(formation, 3)
    seen = np.isfinite(world.observed).all(axis=-1)
    for i, period in enumerate(formation.period_s):
        assert np.diff(world.time[seen[i]]) == pytest.approx(np.full(seen[i].sum() - 1, period))
    assert np.isin(2.0 * np.arange(50), world.time).all()
    assert (np.diff(world.time) > 0.0).all()


def test_gross_errors_are_those_that_are_marked():
    formation = Formation(gross_share=0.2, squared_variance=1.0)
    world = simulate(formation, 2)
    off = locate(world.observed, world.master, world.attitude) - world.truth
    length = np.linalg.norm(off, axis=-1)
    assert (length[world.gross] > 99.0).all()
    assert (length[~world.gross] < 10.0).all()
    assert world.gross.mean() == pytest.approx(0.2, abs=0.07)


def test_same_seed_gives_the_same_bits_and_another_does_not():
    one, same, other = (simulate(Formation(case=2, process=1.0), seed) for seed in (5, 5, 6))
    assert all((a == b).all() for a, b in zip(one, same, strict=True))
    assert (one.observed != other.observed).all()


@pytest.mark.parametrize(
    "wrong",
    [
        {"case": 3},
        {"reading": "bearing"},
        {"squared_variance": 0.0},
        {"process": -1.0},
        {"gross_share": 1.0},
        {"quality": ((1.0, 1.0, 1.0),)},
        {"period_s": (1.0,)},
        {"count": 1},
        {"step_s": 0.0},
    ],
)
def test_impossible_formations_are_refused(wrong):
    with pytest.raises(OptionsError):
        Formation(**wrong)
