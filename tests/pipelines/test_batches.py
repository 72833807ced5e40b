"""Live equals batch: how a log is cut on its way through changes nothing."""

from dataclasses import replace
from functools import partial
from itertools import pairwise

import numpy as np
import pandas as pd
import pytest

from acceptance.product import START, geographic, survey, write
from surefix.api import to_table
from surefix.io.table import from_frame
from surefix.pipelines import inputs
from surefix.pipelines.clean import Source, clean_batches, clean_sources
from surefix.pipelines.joining import join
from surefix.pipelines.options import CleanOptions
from surefix.types import Cleaned, Log

HEAD = 120


REALTIME = CleanOptions(mode="realtime", settle_rows=HEAD)


def faulty(n: int = 900) -> pd.DataFrame:
    """A log with wild fixes, a sustained jump, copies, polls, gaps, late and missing rows."""
    log = pd.DataFrame(geographic(survey(n), 60.0, 5.0))
    rng = np.random.default_rng(3)
    log.loc[rng.choice(n, 40, replace=False), "lat"] += 6e-4
    log.loc[500:, "lon"] += 8e-4
    log.loc[[200, 201], ["lat", "lon", "depth"]] = np.nan
    log.loc[[310, 700], "time"] = np.nan
    log.loc[400:406, ["lat", "lon", "depth"]] = log.loc[400, ["lat", "lon", "depth"]].to_numpy()
    log = log.drop(index=range(600, 660))
    log["heading"] = (350.0 + 0.05 * np.arange(len(log)) + rng.normal(0, 1, len(log))) % 360.0
    log.loc[250, "heading"] = 100.0
    log = pd.concat([log[:150], log[149:150], log[150:]], ignore_index=True)
    order = np.argsort(np.arange(len(log)) + rng.uniform(0, 2, len(log)), kind="stable")
    return log.iloc[order].reset_index(drop=True)


def cut(frame: pd.DataFrame, sizes: list[int], **role) -> list[Log]:
    """The log of a frame in chunks, with the rows numbered through."""
    whole = from_frame(frame, mapping={}, **role)
    bounds = np.cumsum([0, *sizes, len(frame)]).clip(0, len(frame))
    return [_part(whole, slice(a, b)) for a, b in pairwise(bounds)]


def _part(whole: Log, rows: slice) -> Log:
    fixes = whole.fixes
    if fixes is not None:
        fixes = fixes._replace(**{name: getattr(fixes, name)[rows] for name in fixes._fields[:-1]})
    channels = tuple(c._replace(time=c.time[rows], value=c.value[rows]) for c in whole.channels)
    first = rows.start == 0
    return replace(
        whole,
        fixes=fixes,
        channels=channels,
        events=whole.events if first else (),
        problems=whole.problems if first else (),
    )


def realtime(sizes: list[int], depth: list[int] | None = None, **options) -> list[Cleaned]:
    frame = faulty()
    sources = [Source(iter(cut(frame, sizes)), "fixes", "log")]
    if depth is not None:
        log = survey(900)
        pressure = pd.DataFrame({"time": log["time"] + 0.21, "depth": -log["z"] + 0.1})
        chunks = cut(pressure, depth, role="depth", sensor="pressure")
        sources.append(Source(iter(chunks), "depth", "pressure"))
    return list(clean_batches(sources, replace(REALTIME, **options)))


def equal(one: Cleaned, other: Cleaned, within: float = 0.0) -> None:
    how = {"check_exact": True} if within == 0.0 else {"rtol": 0.0, "atol": within}
    pd.testing.assert_frame_equal(to_table(one).to_pandas(), to_table(other).to_pandas(), **how)
    assert len(one.channels) == len(other.channels)
    for a, b in zip(one.channels, other.channels, strict=True):
        for x, y in zip(a[2:7], b[2:7], strict=True):  # time, raw, value, rate, sigma
            np.testing.assert_array_equal(x, y)
        np.testing.assert_array_equal(a.verdicts.verdict, b.verdicts.verdict)
    if one.resampled is not None and other.resampled is not None:
        for x, y in zip(one.resampled, other.resampled, strict=True):
            np.testing.assert_allclose(x, y, rtol=0, atol=within)
    assert sorted(map(str, one.events)) == sorted(map(str, other.events))


@pytest.mark.parametrize(
    "sizes",
    [[HEAD + 30, *[1] * 700], [HEAD + 30, *[7] * 120], [HEAD + 30, 300, 1, 299]],
    ids=["one by one", "sevens", "large"],
)
@pytest.mark.parametrize("options", [{}, {"every_s": 0.4}], ids=["fixes", "regular"])
def test_chunks_do_not_change_the_fixes(sizes, options):
    """The head, on which noise is learnt, is the same; what follows comes as it likes."""
    few = realtime([HEAD + 30], **options)
    many = realtime(sizes, **options)
    assert len(many) > len(few)
    equal(join(few), join(many), within=1e-6 if options else 0.0)


def test_chunks_do_not_change_what_several_hypotheses_say():
    few = realtime([HEAD + 30], method="multi-hypothesis")
    many = realtime([HEAD + 30, 1, 1, 1, *[7] * 30, 250], method="multi-hypothesis")
    assert len(many) > len(few)
    equal(join(few), join(many))


@pytest.mark.parametrize("pieces", [[1] * 90, [33] * 6, [HEAD // 2]])
def test_the_head_does_not_depend_on_the_chunks(pieces):
    """Origin and noise are learnt on the first rows, whatever pieces these arrive in."""
    equal(join(realtime([HEAD + 30])), join(realtime(pieces)))


def test_chunks_of_two_sources_do_not_change_the_fixes():
    few = realtime([HEAD + 30], depth=[HEAD + 30])
    many = realtime([HEAD + 30, *[11] * 50], depth=[HEAD + 30, *[5] * 140])
    one, other = to_table(join(few)).to_pandas(), to_table(join(many)).to_pandas()
    pd.testing.assert_frame_equal(one, other, check_exact=True)


@pytest.mark.parametrize("mode", ["lagged", "offline"])
def test_modes_that_see_the_future_do_not_see_the_chunks(mode):
    options = CleanOptions(mode=mode)
    whole = clean_sources([Source(iter(cut(faulty(), [])), "fixes", "log")], options)
    parts = clean_sources([Source(iter(cut(faulty(), [50] * 17)), "fixes", "log")], options)
    equal(whole, parts)


def test_the_past_does_not_know_the_future():
    """In real time a row is the same whether the log goes on or ends there."""
    frame, options = faulty(), REALTIME
    sizes = [HEAD + 30, *[10] * 70]
    whole = join(list(clean_batches([Source(iter(cut(frame, sizes)), "fixes")], options)))
    early = frame[:550]
    part = join(list(clean_batches([Source(iter(cut(early, sizes)), "fixes")], options)))
    n = 500  # the last rows of the shorter log had nothing to be ordered against
    a, b = to_table(whole).to_pandas()[:n], to_table(part).to_pandas()[:n]
    pd.testing.assert_frame_equal(a, b, check_exact=True)


@pytest.mark.parametrize("mode", ["realtime", "lagged", "offline"])
def test_block_size_of_the_reader(tmp_path, monkeypatch, mode):
    """A file is the same log in blocks of any size, and the same as its table."""
    frame = faulty()
    path = write(tmp_path / "log.csv", frame)
    options = CleanOptions(mode=mode, settle_rows=HEAD)
    results = [clean_sources(inputs.open_inputs([pd.read_csv(path)]), options)]
    read = inputs.read_table
    for block in (1 << 22, 20_000):
        monkeypatch.setattr(inputs, "read_table", partial(read, chunk=block))
        results.append(clean_sources(inputs.open_inputs([path]), options))
    one, *others = (to_table(result).to_pandas().drop(columns="sensor") for result in results)
    for other in others:
        pd.testing.assert_frame_equal(one, other, check_exact=True)


def test_rows_out_of_order_by_two_seconds_equal_the_sorted_run():
    log = pd.DataFrame(survey(400, interval=0.5))
    log.loc[[50, 222], "x"] += 30.0
    rng = np.random.default_rng(8)
    shuffled = log.iloc[np.argsort(log.time + rng.uniform(0, 2, len(log)), kind="stable")]
    assert (np.diff(shuffled.time) < 0).sum() > 100
    assert log.time[0] == START
    for mode in ("realtime", "lagged", "offline"):
        options = CleanOptions(mode=mode)
        a, b = (
            to_table(clean_sources([Source(iter([from_frame(f, mapping={})]))], options))
            .to_pandas()
            .drop(columns="row")
            for f in (log, shuffled.reset_index(drop=True))
        )
        pd.testing.assert_frame_equal(a, b, check_exact=True, obj=mode)
