"""The page on comparisons holds the scenarios and the figures of the code."""

import re
import shlex

import pytest

from docs.pages import ROOT, blocks
from surefix.comparison.options import CompareOptions
from surefix.comparison.run import compare
from surefix.simulate.contamination import SCENARIOS

PAGE = ROOT / "docs" / "compare.md"


def test_scenarios_are_all_there():
    below = PAGE.read_text(encoding="utf-8").split("## The scenarios")[1].split("\n## ")[0]
    rows = [line.split("|")[1] for line in below.splitlines() if line.startswith("| `")]
    assert [name for row in rows for name in re.findall(r"`([^`]+)`", row)] == list(SCENARIOS)


@pytest.mark.parametrize(("place", "methods"), [(0, ("igg3",)), (1, ("gnc", "imm"))])
def test_recorded_figures_are_those_of_the_code(place, methods):
    scenario = "burst-common"  # its figures differ most from run to run
    recorded = [block.text for block in blocks(PAGE) if block.info == "recorded"][place]
    command, _, printed = recorded.partition("\n")
    words = shlex.split(command.removeprefix("$ "))
    given = {words[i][2:]: words[i + 1] for i in range(2, len(words), 2)}
    made = compare(
        CompareOptions(
            methods=methods,
            scenarios=(scenario,),
            modes=("offline", "realtime"),
            runs=int(given["runs"]),
            epochs=int(given.get("epochs", 2400)),
        )
    )
    names = given["methods"].split(",")
    tables = {part.splitlines()[0]: part for part in printed.split("\n\n")}
    for table in made.tables:
        if table.key.startswith("rmse_ratio"):
            (row,) = re.findall(rf"^  {scenario} .*$", tables[table.title], re.MULTILINE)
            shown = re.findall(r"([\d.]+) ± [\d.]+|(–)", row)
            for method, mean in zip(methods, table.mean[0], strict=True):
                figure = float(shown[names.index(method)][0] or "nan")
                assert figure == pytest.approx(float(mean), rel=0.1, nan_ok=True)


def test_figures_of_the_default_method_are_those_of_the_code():
    """Three vehicles with gross errors on one axis each, in real time: the cheapest row."""
    made = compare(
        CompareOptions(
            methods=("multi-hypothesis",), scenarios=("one-axis",), modes=("realtime",), runs=3
        )
    )
    text = PAGE.read_text(encoding="utf-8").split("### The default method")[1]
    (row,) = re.findall(r"^\| `one-axis` \|(.*)\|$", text, re.MULTILINE)
    shown = [float(each) for each in row.split("|")]
    aided, alone = (table for table in made.tables if table.key.startswith("rmse_ratio"))
    for figure, table in zip(shown[4:], (aided, alone), strict=True):
        assert figure == pytest.approx(float(table.mean[0, 0]), abs=0.01)
