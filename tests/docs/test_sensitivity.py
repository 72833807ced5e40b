"""The constants of several hypotheses: the page holds their values, the script changes them."""

import importlib.util
import re
from fractions import Fraction

import pytest

from docs.pages import ROOT
from surefix.filters import learning

PAGE = (ROOT / "docs" / "explanation" / "hypotheses.md").read_text(encoding="utf-8")
_SPEC = importlib.util.spec_from_file_location("sensitivity", ROOT / "docs" / "sensitivity.py")
SENSITIVITY = importlib.util.module_from_spec(_SPEC)
_SPEC.loader.exec_module(SENSITIVITY)
CONSTANTS = SENSITIVITY.CONSTANTS


def test_page_names_all_constants_with_their_values():
    part = PAGE.split("\n## Constants\n")[1].split("\n###")[0]
    rows = re.findall(r"^\| `([\w.]+)` \| (\S+)[^|]* \| (.+) \|$", part, re.MULTILINE)
    assert [name for name, _, _ in rows] == list(CONSTANTS)
    for name, value, _ in rows:
        stated = float(Fraction(value))
        assert stated == pytest.approx(SENSITIVITY.value_of(name), rel=1e-9), name


def test_page_shows_every_variant():
    """A constant that is changed, or added, wants the script to be run again."""
    below = PAGE.split("### What they are worth")[1]
    shown = re.findall(r"^\| `([\w.]+)` \| (\S+) \|", below, re.MULTILINE)
    wanted = [
        (name, f"{SENSITIVITY.varied(rule, SENSITIVITY.value_of(name), up):.3g}")
        for name, rule in CONSTANTS.items()
        for up in (False, True)
    ]
    assert shown == wanted
    assert set(re.findall(r"`([\w.]+)` [-+][\d.]+ %", below)) == set(CONSTANTS)


@pytest.mark.parametrize(
    ("rule", "value", "low", "high"),
    [("size", 64, 32, 128), ("probability", 0.3, 0.1, 0.9), ("odds", 0.9, 0.75, 27 / 28)],
)
def test_values_are_varied_and_keep_their_type(rule, value, low, high):
    for up, wanted in ((False, low), (True, high)):
        made = SENSITIVITY.varied(rule, value, up)
        assert made == pytest.approx(wanted)
        assert type(made) is type(value)


def test_half_the_longest_run_follows_a_burst(monkeypatch):
    """A burst has 30 fixes, and the longest run 39.5 intervals."""
    monkeypatch.setattr(learning, "supposed", learning.supposed)  # put back afterwards
    log = "burst-common alone"
    plan = SENSITIVITY.Plan((log,), seed=11, runs=1, epochs=200)
    before = SENSITIVITY.measure(plan)
    SENSITIVITY.vary(SENSITIVITY.Variant("Prior.longest", up=False))
    after = SENSITIVITY.measure(plan)
    for mode in SENSITIVITY.MODES:
        assert after[mode, log] > 3.0 * before[mode, log]
