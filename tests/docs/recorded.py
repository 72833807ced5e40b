"""Whether a recorded block of a page shows what an experiment finds now."""

import re

import numpy as np

_CELL = re.compile(r"(-?[\d.]+) ± ([\d.]+)|–")


def assert_shows(text, found, errors=5.0, share=0.02):
    """Hold a block's means over many runs against an experiment of a few.

    They may differ by so many standard errors of the few, by a share, and by two last digits. The
    findings must be the same sentences but for their figures.
    """
    runs = np.sqrt(found.runs)
    for table in found.tables:
        heading = f"{table.title}, {table.unit}" if table.unit else table.title
        part = text.split(f"\n{heading}\n")[1].split("\n\n")[0].splitlines()[1:]
        lines = iter(line.strip() for line in part)
        for row, mean in zip(table.rows, table.mean, strict=True):
            line = next(each for each in lines if not each.startswith("paper  "))
            assert re.split(r"  +", line)[0] == row, f"{heading}: {line}"
            cells = _CELL.findall(line.removeprefix(row))
            bare = not cells or len(cells) != len(table.columns)
            if bare:  # the spread of a table of one figure a chunk of runs is not shown
                continue
            for ours, (value, spread) in zip(mean, cells, strict=True):
                assert np.isfinite(ours) == bool(value), f"{heading}: {line}"
                if value:
                    bound = errors * float(spread) / runs + share * abs(float(value))
                    off = abs(ours - float(value))
                    assert off <= bound + 2.0 * 10.0**-table.digits, f"{heading}: {line}"
    said = text.strip().splitlines()[-len(found.findings) :]
    for ours, theirs in zip(found.findings, said, strict=True):
        assert _bare(ours) == _bare(theirs)


def _bare(sentence):
    return re.sub(r"[-+]?[\d.]+", "0", sentence)
