"""From a table of ranges to positions and verdicts."""

import numpy as np
import pyarrow.csv as pacsv
import pytest

import surefix as sf
from filters.sight_worlds import FAR, ranges
from surefix import Reason, SightSource, Survey, Verdict
from surefix.errors import InputError, OptionsError, ParseError
from surefix.pipelines.survey import read_survey

G2 = [(-0.478, 0.997, 0.745), (0.009, 1.459, 0.731), (0.486, 0.957, 0.713), (0.008, 0.989, 0.751)]


def survey_of(anchors, **changes):
    sights = tuple(
        SightSource(kind="range", column=f"r{i}", at=tuple(map(float, at)))
        for i, at in enumerate(anchors)
    )
    return Survey(sights=sights, speed=1.0, **changes)


def log_of(world):
    ranges_ = {f"r{i}": world.sights.z[:, i] for i in range(world.sights.z.shape[1])}
    return {"time": 1.7e9 + world.sights.time, **ranges_}


def codes(found):
    return found.verdicts.verdict.reshape(found.value.shape)


@pytest.fixture(scope="module")
def world():
    return ranges(4, FAR[:4], n=120, size=3.0)


@pytest.fixture(scope="module")
def found(world):
    return sf.locate(log_of(world), survey_of(FAR[:4], process=0.02))


def test_positions_and_verdicts(world, found):
    off = np.linalg.norm(found.position - world.truth[:, :3], axis=1)
    assert off.max() < 0.6
    rejected = codes(found) == Verdict.REJECTED
    assert rejected[world.gross].mean() > 0.99
    assert rejected[~world.wrong].mean() < 0.005
    assert {each.sensor: each.source for each in found.noise} == {
        "range": "estimated",
        "motion": "given",
    }


def test_rows_polled_again_late_or_without_a_time_carry_no_news(world, found):
    log = log_of(world)
    order = [*range(50), 49, 49, *range(50, 120)]
    again = {name: np.array(column)[order] for name, column in log.items()}
    again["time"][50:52] += [0.01, 0.02]
    again["time"] = np.append(again["time"], [1.7e9 + 3.0, np.nan])
    for i in range(4):
        again[f"r{i}"] = np.append(again[f"r{i}"], [50.0 + i, 60.0 + i])
    polled = sf.locate(again, survey_of(FAR[:4], process=0.02))
    kept = np.delete(np.arange(122), [50, 51])
    np.testing.assert_allclose(polled.position[kept], found.position, atol=1e-9)
    reason = polled.verdicts.reason.reshape(-1, 4)
    assert (reason[50:52] == Reason.HELD).all()
    assert (reason[122] == Reason.LATE).all()
    assert (reason[123] == Reason.NO_TIME).all()


def test_bad_cells_and_negative_ranges_are_missing(world):
    log = log_of(world)
    log["r1"] = [f"{value:.3f}" for value in log["r1"]]
    log["r1"][7] = "x"
    log["r2"] = np.where(np.arange(120) % 3, log["r2"], -1.0)
    log["r3"] = log["r3"].copy()
    log["r3"][[20, 30]] = np.inf, 1e300
    located = sf.locate(log, survey_of(FAR[:4], process=0.02))
    verdict = codes(located)
    assert verdict[7, 1] == Verdict.MISSING
    assert (verdict[::3, 2] == Verdict.MISSING).all()
    assert (verdict[[20, 30], 3] == Verdict.MISSING).all()
    assert located.problems[0].total == 1
    assert np.isfinite(located.position).all()


def test_a_track_begins_anew_after_a_gap(world):
    log = log_of(world)
    log["time"][60:] += 3600.0
    located = sf.locate(log, survey_of(FAR[:4], process=0.02), mode="realtime")
    off = np.linalg.norm(located.position - world.truth[:, :3], axis=1)
    assert off[[*range(3, 60), *range(63, 120)]].max() < 1.5


def test_columns_move_receivers_and_depth_is_down(world):
    log = log_of(world)
    rng = np.random.default_rng(0)
    east = rng.normal(0, 5, 120)
    shifted = FAR[0] + np.outer(east, [1, 0, 0])
    log["r0"] = np.linalg.norm(world.truth[:, :3] - shifted, axis=1) + rng.normal(0, 0.05, 120)
    log["east"] = east
    log["depth"] = -world.truth[:, 2] + rng.normal(0, 0.02, 120)
    survey = survey_of(FAR[:4], process=0.02)
    first = SightSource(kind="range", column="r0", at=("east", 0.0, 0.0))
    depth = SightSource(kind="depth", column="depth", sigma=0.02)
    moving = Survey(sights=(first, *survey.sights[1:], depth), speed=1.0, process=0.02)
    located = sf.locate(log, moving)
    off = np.abs(located.position - world.truth[:, :3])
    assert off[:, 2].max() < 0.1
    assert off.max() < 0.5


def test_a_log_without_ranges_or_columns_is_told(world):
    log = log_of(world)
    with pytest.raises(ParseError, match="no column r9"):
        sf.locate(log, Survey(sights=(SightSource(kind="range", column="r9", at=(0.0,)),)))
    none = {**log, **{f"r{i}": np.full(120, -1.0) for i in range(4)}}
    with pytest.raises(InputError, match="no range to begin"):
        sf.locate(none, survey_of(FAR[:4]))
    with pytest.raises(OptionsError, match="mode"):
        sf.locate(log, survey_of(FAR[:4]), mode="lagged")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "no sights"),
        ("speed = -1\n[[sight]]\nkind='range'\ncolumn='r'\nat=[0,0]", "speed"),
        ("[[sight]]\nkind='sonar'\ncolumn='r'\nat=[0,0]", "kind 'sonar'"),
        ("[[sight]]\nkind='range'\ncolumn='r'", "at"),
        ("[[sight]]\nkind='range'\ncolumn='r'\nat=[0,0]\nhue=1", "'hue'"),
        ("[[sight]]\nkind='range'\nat=[0,0]", "without column"),
        ("[[sight]]\nkind='elevation'\ncolumn='r'\nat=[0,0]", "3 axes"),
        ("[[sight]]\nkind='depth'\ncolumn='r'", "no range and no start"),
        ("start=[0,0]\n[[sight]]\nkind='range'\ncolumn='r'\nat=[0,0]", "start_sigma"),
    ],
)
def test_a_wrong_survey_is_told(tmp_path, text, said):
    (tmp_path / "survey.toml").write_text(text)
    with pytest.raises(OptionsError, match=said):
        read_survey(tmp_path / "survey.toml")


def test_recorded_ranges_that_contradict_each_other_are_found(data):
    """Ranges of an array of 0.8 m cannot differ by more than 1 m."""
    log = next((data / "usbl_ugps_raw").glob("*acoustic.csv"))
    table = pacsv.read_csv(log)
    names = [f"distance_r{i}" for i in range(4)]
    part = {name: table.column(name).to_numpy()[1300:4300] for name in ("timestamp", *names)}
    sights = tuple(
        SightSource(kind="range", column=name, at=at) for name, at in zip(names, G2, strict=True)
    )
    survey = Survey(sights=sights, time="timestamp", speed=1.0, process=0.2)
    located = sf.locate(part, survey)
    r = np.where(located.value > 0.0, located.value, np.nan)
    verdict = codes(located)
    fresh = np.isfinite(located.position[:, 0])
    pairs = [(a, b) for a in range(4) for b in range(a)]
    certain = [fresh & (np.abs(r[:, a] - r[:, b]) > 1.0) for a, b in pairs]
    found = [
        (verdict[here][:, [a, b]] == Verdict.REJECTED).any(axis=1)
        for here, (a, b) in zip(certain, pairs, strict=True)
    ]
    assert sum(len(each) for each in found) > 30
    assert np.concatenate(found).all()
    share = (verdict[fresh] == Verdict.REJECTED).sum() / np.isfinite(r[fresh]).sum()
    assert share < 0.1
    assert 0.01 < located.noise[0].value < 0.05
