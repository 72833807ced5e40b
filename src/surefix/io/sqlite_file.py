"""Tell a SQLite file by its first bytes, without the library that opens it."""

from __future__ import annotations

from pathlib import Path

__all__ = ["is_sqlite"]


def is_sqlite(path: Path) -> bool:
    """Whether a file is a SQLite data base."""
    try:
        with path.open("rb") as file:
            return file.read(16) == b"SQLite format 3\0"
    except OSError:
        return False
