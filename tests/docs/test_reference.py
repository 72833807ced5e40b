"""The lists of the reference hold what the code holds."""

import importlib.util
import re
from dataclasses import MISSING, fields
from pathlib import Path
from typing import get_args

import numpy as np
import pytest

import surefix
from docs.pages import PAGES, ROOT
from surefix.geo.local_frame import LocalFrame
from surefix.io.acoustic_sentence import PROPRIETARY
from surefix.io.attitude_sentence import ATTITUDE, TRANSDUCERS
from surefix.io.nmea_record import ProblemKind
from surefix.io.nmea_sentence import LAYOUTS
from surefix.io.options_file import read_options
from surefix.io.roles import ALIASES, ROLES, UNITS
from surefix.io.write_nmea import TYPES
from surefix.pipelines import deliver
from surefix.pipelines.channels import channel_head
from surefix.pipelines.options import METHODS, MULTI_HYPOTHESIS
from surefix.reasons import texts
from surefix.robust.loss import LOSSES
from surefix.types import Reason, Verdict, Verdicts

DOCS = ROOT / "docs"
SOURCE = Path(surefix.__file__).parent
WORDS = re.compile(r"`([^`]+)`")


def table(page, heading):
    """Cells of the first table below a heading, without its head."""
    text = (DOCS / page).read_text(encoding="utf-8")
    below = re.split(rf"^## {re.escape(heading)}$", text, flags=re.MULTILINE)[1]
    rows = re.search(r"(?:^\|.*\n)+", below, flags=re.MULTILINE)[0].splitlines()[2:]
    return [
        [cell.strip() for cell in re.split(r"(?<!\\)\|", row.strip().strip("|"))] for row in rows
    ]


def words(cells):
    return [word for cell in cells for word in WORDS.findall(cell)]


def script(name):
    spec = importlib.util.spec_from_file_location(f"docs_{name}", DOCS / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_command_line_page_is_up_to_date():
    page = script("cli")
    assert page.PLACE.read_text(encoding="utf-8") == page.render(), "run python docs/cli.py"


def test_picture_is_small_and_shows_what_the_demonstration_gives():
    page = script("picture")
    kept = page.PLACE.read_text(encoding="utf-8")
    assert len(kept) < 300_000
    assert shown(kept) == shown(page.draw()), "run python docs/picture.py"


def shown(picture):
    """Numbers in the headings of the picture."""
    return re.findall(r"(\d[\d,]*) [A-Za-z ]*fixes<", picture)


def test_columns_are_those_that_are_recognised():
    rows = {WORDS.findall(row[0])[0]: row for row in table("reference/files.md", "Columns")}
    assert list(rows) == list(ROLES)
    for role, (_, other, units, names) in rows.items():
        known = [name for tier in ROLES[role].tiers for name in tier]
        assert WORDS.findall(names) == known
        assert WORDS.findall(other) == [a for a, target in ALIASES.items() if target == role]
        assert units == UNITS[ROLES[role].dimension]


def test_sentences_are_those_that_are_read():
    listed = words(row[0] for row in table("reference/files.md", "Input: NMEA 0183"))
    assert sorted(listed) == sorted(LAYOUTS)


def test_messages_of_roll_and_pitch_are_those_that_are_read():
    listed = words(row[0] for row in table("reference/files.md", "Input: roll and pitch"))
    assert sorted(listed) == sorted([*ATTITUDE, *TRANSDUCERS, "TSS1"])


def test_acoustic_messages_are_those_that_are_read():
    listed = words(row[0] for row in table("reference/files.md", "Input: acoustic positioning"))
    assert sorted(listed) == sorted([*PROPRIETARY, "USBLLONG", "DVL"])


def test_nmea_output_is_what_is_written():
    listed = words(row[0] for row in table("reference/files.md", "Output: NMEA 0183"))
    assert listed == [name for name in TYPES if name != "HDT"]


def test_output_columns_are_those_that_are_written():
    listed = words(row[0] for row in table("reference/files.md", "Output: tables"))
    log = {"time": [0, 1, 2], "lat": [1.0, 1.0, 1.0], "lon": [2.0, 2.0, 2.0]}
    for vertical, other in (("depth", "height"), ("height", "depth")):
        written = surefix.to_table(surefix.clean({**log, vertical: [1.0, 1.1, 1.0]}))
        assert [name for name in listed if name != other] == written.column_names


def test_verdicts_are_all_there():
    listed = words(row[0] for row in table("reference/files.md", "Verdicts"))
    assert listed == [verdict.name.lower() for verdict in Verdict]


def test_reasons_are_all_there_in_the_words_that_are_written():
    rows = table("reference/files.md", "Reasons")
    assert words(row[0] for row in rows) == [reason.name for reason in Reason]
    for reason, (_, text, goes) in zip(Reason, rows, strict=True):
        said = texts(_verdict(reason))[0]
        skeleton = re.sub(r"[\d.:]+", "#", said)
        assert skeleton in re.sub(r"[\d.:]+", "#", text).split(" *or* "), f"{reason.name}: {said}"
        used = [p for p in SOURCE.rglob("*.py") if p.name not in ("reasons.py", "types.py")]
        given = any(f"Reason.{reason.name}" in p.read_text(encoding="utf-8") for p in used)
        assert given is ("not given today" not in goes), reason.name


def _verdict(reason):
    detail = 1.0 if reason == Reason.AXIS_OFF else 300.0
    if reason in (Reason.JUMP, Reason.HELD, Reason.LATE, Reason.REPEATED):
        detail = 1715673602.0
    verdict = (
        Verdict.REJECTED
        if reason in (Reason.OFF, Reason.ISOLATED, Reason.RUN, Reason.DRAG)
        else Verdict.DOWNWEIGHTED
    )
    one = [verdict, 0.5, 6.1, float("nan"), reason, detail, [4.1, -7.0, float("nan")]]
    return Verdicts(*(np.array([value]) for value in one))


def test_events_are_those_of_the_code():
    listed = words(row[0] for row in table("reference/files.md", "Events"))
    assert sorted(listed) == sorted(_called("Event"))


def test_problems_are_those_of_the_code():
    listed = words(row[0] for row in table("reference/files.md", "Problems"))
    tables = {*_called("count"), *_called("Problem")}
    assert sorted(listed) == sorted(tables | set(get_args(ProblemKind)))


def _called(name):
    """First arguments, where they are plain text, of all calls of a name in the sources."""
    pattern = re.compile(rf'\b{name}\(\s*"([a-z-]+)"')
    text = "\n".join(
        path.read_text(encoding="utf-8")
        for path in SOURCE.rglob("*.py")
        if path.name not in ("delimited.py",)
    )
    return set(pattern.findall(text))


def test_options_are_all_there_with_their_defaults():
    rows = {WORDS.findall(row[0])[0]: row for row in first_table("reference/options.md")}
    options = {field.name: field for field in fields(surefix.CleanOptions)}
    assert list(rows) == list(options)
    for name, field in options.items():
        default = rows[name][1]
        if field.default in (None, MISSING):
            assert "`" not in default, name
        else:
            written = field.default
            if isinstance(written, bool):
                written = str(written).lower()
            written = f'"{written}"' if isinstance(field.default, str) else str(written)
            assert default == f"`{written}`"


def first_table(page):
    text = (DOCS / page).read_text(encoding="utf-8")
    rows = re.search(r"(?:^\|.*\n)+", text, flags=re.MULTILINE)[0].splitlines()[2:]
    return [[cell.strip() for cell in row.strip().strip("|").split("|")] for row in rows]


def test_method_constants_are_those_of_the_code():
    text = (DOCS / "reference/options.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| `([\w-]+)` \| ([\d.–]+) \| ([\d.–]+)", text, re.M)
    found = {name: (k0, k1) for name, k0, k1 in rows}
    assert set(found) == set(METHODS) - {MULTI_HYPOTHESIS}
    for name, (k0, k1) in found.items():
        options = surefix.CleanOptions(method=name)
        used = options.decider.k0 if options.decider else options.loss.k0
        for shown, value in ((k0, used), (k1, options.loss.k1)):
            assert (float(shown) if shown != "–" else 0.0) == pytest.approx(value, abs=0.005)


def test_options_file_of_the_page_is_read(tmp_path):
    text = (DOCS / "reference/options.md").read_text(encoding="utf-8")
    place = tmp_path / "options.toml"
    place.write_text(re.search(r"```toml\n(.*?)```", text, re.S)[1], encoding="utf-8")
    assert read_options(place).clean["sensor_delay_s"] == {"usbl": 0.4}


def test_python_names_are_all_there():
    listed = words(row[0] for row in first_table("reference/python.md"))
    assert sorted(listed) == sorted(surefix.__all__)


def test_modules_that_are_named_exist():
    text = (DOCS / "reference/python.md").read_text(encoding="utf-8")
    for name in re.findall(r"^\| `(surefix\.[\w.]+)` \|", text, re.MULTILINE):
        importlib.import_module(name)


def test_figures_in_the_how_to_are_those_of_the_code():
    text = (DOCS / "how-to.md").read_text(encoding="utf-8")
    assert f"first {surefix.CleanOptions().settle_rows:,}\nrows" in text
    assert f"({channel_head(surefix.CleanOptions()):,} values" in text
    assert f"more than {deliver._KEPT:,}" in text


def test_losses_of_the_explanation_are_those_of_the_code():
    listed = words(row[0] for row in table("explanation/estimator.md", "Losses"))
    assert listed == list(LOSSES)


def test_accuracy_of_the_frame_is_as_stated():
    radius = 6_371_000.0
    for distance, ppm in ((3e3, 0.04), (1e5, 41.0), (1e6, 4_000.0)):
        assert distance**2 / (6.0 * radius**2) * 1e6 == pytest.approx(ppm, rel=0.1)
    frame = LocalFrame(60.0, 4.0)
    x, y, _ = frame.to_local([60.0], [4.0])
    assert abs(x[0]) < 1e-6
    assert abs(y[0]) < 1e-6


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_pages_name_no_place_of_one_machine(page):
    text = page.read_text(encoding="utf-8")
    assert not re.search(r"/(work|home|tmp|root)/", text)
