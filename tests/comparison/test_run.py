"""Comparisons: the product against the oracle, the same from a seed, complete in every form."""

import json

import numpy as np
import pytest

from acceptance.product import surefix, told_in_one_line
from surefix.comparison.merit import judge
from surefix.comparison.options import CompareOptions, world_of
from surefix.comparison.oracle import lag_of, oracle
from surefix.comparison.run import clean_trial, compare
from surefix.errors import OptionsError
from surefix.papers.reproduce import contents
from surefix.pipelines.clean import clean_sources
from surefix.pipelines.inputs import open_inputs
from surefix.pipelines.options import CleanOptions
from surefix.simulate.contamination import SCENARIOS, World, alone, columns, draw, draw_world

MODES = ("offline", "lagged", "realtime")
SMALL = CompareOptions(
    methods=("kalman", "igg3"),
    scenarios=("isolated-20", "jump", "dvl-faults"),
    modes=("offline", "realtime"),
    runs=1,
    epochs=300,
)


@pytest.fixture(scope="module")
def small():
    return compare(SMALL)


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("seed", range(3))
def test_the_plain_filter_told_the_truth_is_the_oracle_where_nothing_is_wrong(seed, mode):
    world = draw_world([40, seed], epochs=600, axes=1 + seed)
    whole = draw("clean", world, [40, seed])
    for trial in (whole, alone(whole)):
        told = CleanOptions(
            mode=mode,
            method="kalman",
            model="cv",
            lag_s=lag_of(trial) if mode == "lagged" else None,
            sigma_position=world.sigma_m,
            sigma_height=world.sigma_m,
            sigma_velocity=world.sigma_mps,
            process=world.process,
        )
        cleaned = clean_sources(open_inputs([columns(trial)]), told)
        merit = judge(trial, cleaned, oracle(trial, mode), mode).merit
        assert merit.rmse_ratio == pytest.approx(1.0, abs=2e-3)
        assert merit.nees == pytest.approx(1.0, abs=0.35)
        assert merit.rejected_good_pct == 0.0


def test_a_misjudged_noise_is_told_and_no_other():
    wrong, right = (
        clean_trial(draw(name, World(epochs=200), 1), "kalman", "offline").noise
        for name in ("noise-misjudged", "isolated-5")
    )
    told = {each.quantity: each.value for each in wrong if each.source == "given"}
    assert told == {"position": 0.6, "height": 0.6}
    assert {each.source for each in right} == {"estimated"}


def test_a_seed_gives_the_same_figures_whatever_else_is_run(small):
    names = {table.key: table for table in small.tables}
    other = CompareOptions(
        methods=("igg3",),
        scenarios=("jump",),
        modes=("realtime",),
        runs=2,
        epochs=300,
        jobs=2,
    )
    for table in compare(other).tables:
        if table.key.startswith("noise"):
            continue
        whole = names[table.key]
        column, row = whole.columns.index("igg3"), whole.rows.index("jump")
        assert table.values[0, 0, 0] == whole.values[0, row, column]
        assert table.values.shape[0] == 2
        assert table.values[1, 0, 0] != table.values[0, 0, 0] or table.values[0, 0, 0] in (0, 100)


def test_one_world_for_all_runs_or_one_each():
    drawn = [world_of(SMALL, i) for i in range(3)]
    assert len({world.sigma_m for world in drawn}) == 3
    assert world_of(CompareOptions(world=World(sigma_m=2.0)), 7).sigma_m == 2.0


def test_tables_hold_every_figure_once(small):
    tables = {table.key: table for table in small.tables}
    ratio = tables["rmse_ratio-offline-aided"]
    assert ratio.rows == SMALL.scenarios
    assert ratio.columns == SMALL.methods
    assert ratio.of == "Scenario"
    assert np.isfinite(ratio.values).all()
    assert tables["rmse_ratio-realtime-alone"].rows == ("isolated-20", "jump")
    assert tables["nees-offline-aided"].columns == (*SMALL.methods, "oracle")
    assert tables["back_fixes-realtime-aided"].rows == ("jump",)
    assert "back_fixes-offline-aided" not in tables
    assert "noise_position-offline-alone" in tables
    assert "noise_position-realtime-alone" not in tables
    assert "noise_velocity-offline-alone" not in tables
    kalman, igg3 = ratio.mean[0]
    assert kalman > 5.0
    assert igg3 < 1.5


def test_pictures_show_every_mode_and_method(small):
    assert [figure.key for figure in small.figures] == ["ratio-offline", "ratio-realtime", "errors"]
    aided, bare = small.figures[0].panels
    assert aided.x_names == SMALL.scenarios
    assert bare.x_names == ("isolated-20", "jump")
    for panel in small.figures[-1].panels:
        names = [trace.name for trace in panel.traces]
        assert names == ["bad fix", "oracle", *SMALL.methods]


def test_findings_name_the_worst(small):
    assert len(small.findings) == 4
    ratios = np.vstack(
        [table.mean for table in small.tables if table.key.startswith("rmse_ratio-offline")]
    )
    assert small.findings[1].startswith("igg3, offline: RMSE ÷ oracle ")
    assert f"at worst {ratios[:, 1].max():.2f} (" in small.findings[1]


def test_json_holds_what_the_text_shows_and_more(small, tmp_path):
    place, page = tmp_path / "c.json", tmp_path / "c.html"
    words = ["--methods", "kalman,igg3", "--scenarios", "isolated-20,jump,dvl-faults"]
    words += ["--modes", "offline,realtime", "--runs", 1, "--epochs", 300, "--jobs", 1]
    done = surefix("compare", *words, "--json", place, "--report", page)
    assert done.code == 0, done.err
    held = json.loads(place.read_text(encoding="utf-8"))
    assert held == contents(small)
    assert held["tables"]["rmse_ratio-offline-aided"]["isolated-20"][1] < 1.5
    shown = [line for line in done.out.splitlines() if line.startswith("RMSE ÷ oracle")]
    assert len(shown) == 4
    assert "NEES, " not in done.out
    drawn = page.read_text(encoding="utf-8")
    assert all(each in drawn for each in ("Normalised NEES", ">Scenario<", "ticktext"))


@pytest.mark.parametrize(
    ("wrong", "choices"),
    [
        ({"scenarios": ("rain",)}, "isolated-20"),
        ({"methods": ("magic",)}, "student-t"),
        ({"modes": ("later",)}, "lagged"),
        ({"methods": ("igg3", "igg3")}, "each once"),
        ({"scenarios": ()}, "at least one"),
        ({"runs": 0}, "from 1"),
        ({"epochs": 100}, "from 200"),
        ({"jobs": 0}, "from 1"),
        ({"seed": -1}, "from 0"),
    ],
)
def test_what_cannot_be_compared_is_refused(wrong, choices):
    with pytest.raises(OptionsError, match=choices):
        CompareOptions(**wrong)


def test_a_wrong_word_on_the_command_line_names_the_choices():
    for option, word, choice in (
        ("--scenarios", "rain", "buoy"),
        ("--methods", "igg3,magic", "huber"),
        ("--modes", "later", "offline"),
    ):
        assert choice in told_in_one_line(surefix("compare", option, word))


def test_everything_is_compared_unless_something_is_chosen():
    usual = CompareOptions()
    assert usual.scenarios == tuple(SCENARIOS)
    assert usual.modes == MODES
    assert usual.trials == 5 * len(SCENARIOS)
