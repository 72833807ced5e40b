"""Write docs/reference/cli.md from the command line itself.

Run ``python docs/cli.py`` after a change of a command or an option; a test tells when it is due.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from pathlib import Path
from typing import Any, get_args, get_type_hints

from typer.models import ArgumentInfo

from surefix.cli import app

__all__ = ["render", "write"]

PLACE = Path(__file__).parent / "reference" / "cli.md"

HEAD = """\
# Command line

This page is written by `docs/cli.py` from the program itself; do not edit it by hand.

`DURATION` is a number with a unit: `0.5s`, `200ms`, `2min`, `1h`; without a unit, seconds.

| exit code | meaning |
|---|---|
| 0 | done |
| 1 | something the user can mend: one line says what was given, what was expected, what to do |
| 2 | a wrong word on the command line |
| 70 | an error of surefix itself; `SUREFIX_DEBUG=1` shows where |
| 130 | interrupted |
"""


def render() -> str:
    """Make the page."""
    assert app.registered_callback is not None
    parts = [HEAD, f"## `surefix`\n\n{app.info.help}\n\n{_table(app.registered_callback.callback)}"]
    for command in app.registered_commands:
        assert command.callback is not None
        name = command.name or command.callback.__name__
        told = (inspect.getdoc(command.callback) or "").partition("\n\n")[0]
        parts.append(f"## `surefix {name}`\n\n{told}\n\n{_table(command.callback)}")
    return "\n".join(parts)


def write() -> None:
    """Write the page."""
    PLACE.write_text(render(), encoding="utf-8")


def _table(function: Callable[..., Any]) -> str:
    hints = get_type_hints(function, include_extras=True)
    rows = ["| option | value | meaning |", "|---|---|---|"]
    for name, parameter in inspect.signature(function).parameters.items():
        if not get_args(hints[name]):  # the context, which is no option
            continue
        kind, info = get_args(hints[name])[:2]
        rows.append(f"| {_names(name, info)} | {_value(kind, info)} | {_help(parameter, info)} |")
    return "\n".join(rows) + "\n"


def _names(name: str, info: Any) -> str:
    if isinstance(info, ArgumentInfo):
        return f"`{name.upper()}…`"
    given = (info.default, *(info.param_decls or ()))  # Typer keeps the first as the default
    names = [each for each in given if isinstance(each, str) and each.startswith("-")]
    return ", ".join(f"`{each}`" for each in names or [f"--{name.replace('_', '-')}"])


def _value(kind: Any, info: Any) -> str:
    if info.metavar:
        return f"`{info.metavar}`"
    leaves = [each for each in _leaves(kind) if each is not type(None)]
    if all(isinstance(each, str) for each in leaves):  # one word of a list
        return " ".join(f"`{each}`" for each in leaves)
    inner = set(leaves)
    words = {bool: "", str: "`TEXT`", float: "`NUMBER`", int: "`NUMBER`", Path: "`PATH`"}
    return words[inner.pop()]


def _leaves(kind: Any) -> list[Any]:
    return [leaf for part in get_args(kind) for leaf in _leaves(part)] or [kind]


def _help(parameter: inspect.Parameter, info: Any) -> str:
    text = " ".join((info.help or "").split()).replace("|", "\\|")
    if parameter.default in (None, False, inspect.Parameter.empty):
        return text
    return f"{text} Default: `{parameter.default}`."


if __name__ == "__main__":
    write()
