"""Names of the outputs of a fleet, so that two logs of one name do not meet in one file."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path

__all__ = ["output_names"]


def output_names(logs: Sequence[Path], known: Mapping[str, str]) -> dict[Path, str]:
    """Give every log a name of its own.

    The stem, where only one log has it; else with the folders above in front, as many as it takes;
    else with its suffix; else with a number. A log keeps the name it had before.

    Parameters
    ----------
    logs
        Absolute paths, all different.
    known
        Names by path, of an earlier run.

    Examples
    --------
    >>> logs = [Path("/d/a/usbl.csv"), Path("/d/b/usbl.csv"), Path("/d/b/gps.nmea")]
    >>> list(output_names(logs, {}).values())
    ['a-usbl', 'b-usbl', 'gps']
    """
    out = {log: known[str(log)] for log in logs if str(log) in known}
    taken = {name.casefold() for name in known.values()}
    waiting = [log for log in logs if log not in out]
    depth = max((len(log.parts) for log in waiting), default=0)
    for folders in range(1, depth):
        proposed = {log: _joined(log, folders, log.stem) for log in waiting}
        waiting = _settle(proposed, out, taken)
    with_suffix = {log: log.name.replace(".", "-") for log in waiting}
    waiting = _settle(with_suffix, out, taken)
    for log in waiting:
        number = 2
        while f"{log.stem}-{number}".casefold() in taken:
            number += 1
        out[log] = f"{log.stem}-{number}"
        taken.add(out[log].casefold())
    return {log: out[log] for log in logs}


def _joined(log: Path, parts: int, last: str) -> str:
    return "-".join([*log.parts[1:-1], last][-parts:])


def _settle(proposed: dict[Path, str], out: dict[Path, str], taken: set[str]) -> list[Path]:
    """Take the names that nobody else wants; give the logs that still wait."""
    wanted = Counter(name.casefold() for name in proposed.values())
    waiting = []
    for log, name in proposed.items():
        if wanted[name.casefold()] > 1 or name.casefold() in taken:
            waiting.append(log)
        else:
            out[log] = name
    taken |= {name.casefold() for name in out.values()}
    return waiting
