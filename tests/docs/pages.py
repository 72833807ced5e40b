"""The blocks of a page of documentation, and how the examples among them are run.

````
```console            commands after "$ " are run; the lines below each are its output
```python             run in one namespace per page; a ```text block right after it is its output
```toml file=a.toml   written to that file; so is any other language with ``file=``
```console recorded   an example on recorded data; another test runs it
```sh, ```text …      shown only
````

In expected output ``…`` stands for any text, and a line ``…`` for any lines. Numbers may differ
by a tenth, whole numbers below 20 not at all.
"""

from __future__ import annotations

import contextlib
import io
import re
import shlex
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

from surefix.cli import main

ROOT = Path(__file__).resolve().parents[2]
PAGES = sorted([ROOT / "README.md", *(ROOT / "docs").rglob("*.md")])
TOLERANCE = 0.1
EXACT_BELOW = 20
PLAIN = ("head", "tail", "grep", "ls", "sed")  # programs of the system that a page may use

_BLOCK = re.compile(r"^```(\w+)([^\n]*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
_NUMBER = re.compile(
    r"(?<![\w.:-])[+-]?(?:\d{1,3}(?:,\d{3})+(?![\d.,])|\d+)(?:\.\d+)?(?:e[+-]?\d+)?(?![\w:]|-\d|\.\d)"
)


class Block(NamedTuple):
    """One fenced block: language, what follows it, text, line, and whether it joins the last."""

    language: str
    info: str
    text: str
    line: int
    adjoins: bool


def blocks(path: Path) -> list[Block]:
    """Read the fenced blocks of a page."""
    text, found, end = path.read_text(encoding="utf-8"), [], -1
    for match in _BLOCK.finditer(text):
        line = text.count("\n", 0, match.start()) + 1
        adjoins = end >= 0 and not text[end : match.start()].strip()
        found.append(Block(match[1], match[2].strip(), match[3], line, adjoins))
        end = match.end()
    return found


def run_page(path: Path) -> None:
    """Run every example of a page in the current directory."""
    space: dict[str, object] = {"__name__": "page"}
    printed = ""
    for block in blocks(path):
        where = f"{path.name}:{block.line}"
        if block.info.startswith("file="):
            Path(block.info.removeprefix("file=")).write_text(block.text, encoding="utf-8")
        elif block.language == "python":
            printed = _python(block, space, where)
        elif block.language == "text" and block.adjoins and printed:
            same(printed, block.text, where)
        elif block.language == "console" and block.info != "recorded":
            run_console(block.text, where)
        printed = printed if block.language == "python" else ""


def _python(block: Block, space: dict[str, object], where: str) -> str:
    out = io.StringIO()
    with contextlib.redirect_stdout(out):
        exec(compile(block.text, where, "exec"), space)
    return out.getvalue()


def run_console(text: str, where: str) -> None:
    """Run the commands of a block and compare what they print."""
    for part in re.split(r"^\$ ", text, flags=re.MULTILINE)[1:]:
        lines = part.split("\n")
        count = next(i for i, line in enumerate(lines) if not line.endswith("\\")) + 1
        command = " ".join(line.removesuffix("\\").strip() for line in lines[:count])
        wanted = "\n".join(lines[count:]).strip("\n")
        printed = run(command)
        if wanted:
            same(printed, wanted, f"{where}, {command}")


def run(command: str) -> str:
    """Run one command; what it prints, errors included."""
    words = shlex.split(command)
    if words[0] in PLAIN:
        done = subprocess.run(words, capture_output=True, text=True, encoding="utf-8", check=True)
        return done.stdout
    assert words[0] == "surefix", f"a page may run surefix and {', '.join(PLAIN)}, not {command}"
    out, before = io.StringIO(), sys.argv
    sys.argv = words
    try:
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(out):
            main()
    except SystemExit:
        pass
    finally:
        sys.argv = before
    return out.getvalue()


def same(printed: str, wanted: str, where: str) -> None:
    """Compare output with what the page shows."""
    words, numbers = _split(printed.strip())
    pattern, expected = _split(wanted.strip())
    match = _pattern(pattern).fullmatch(words)
    shown = f"{where}\n--- the page shows\n{wanted}\n--- printed\n{printed}"
    assert match is not None, shown
    kept = [int(n) for text in match.groups() for n in re.findall("\0(\\d+)\0", text)]
    for number, value in zip(expected, kept, strict=True):
        assert _close(number, numbers[value]), f"{number} or {numbers[value]}? {shown}"


def _split(text: str) -> tuple[str, list[str]]:
    """Text with its numbers replaced by their places, and the numbers."""
    numbers: list[str] = []

    def place(match: re.Match[str]) -> str:
        numbers.append(match[0])
        return f"\0{len(numbers) - 1}\0"

    return _NUMBER.sub(place, re.sub(r"[ \t]+", " ", text)), numbers


def _pattern(text: str) -> re.Pattern[str]:
    parts = []
    for line in text.split("\n"):
        if line.strip() == "…":
            parts.append(r"(?:[^\n]*(?:\n|\Z))*?")
            continue
        quoted = re.escape(line.rstrip()).replace("…", "[^\n]*?")
        parts.append(
            re.sub("(?:\\\\)?\0\\d+(?:\\\\)?\0", "(\0\\\\d+\0)", quoted) + r"[ ]*(?:\n|\Z)"
        )
    return re.compile("".join(parts))


def _close(one: str, two: str) -> bool:
    a, b = float(one.replace(",", "")), float(two.replace(",", ""))
    if "." not in one and abs(a) < EXACT_BELOW:
        return a == b
    return abs(a - b) <= TOLERANCE * max(abs(a), abs(b))
