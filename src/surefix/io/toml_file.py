"""Read a TOML file."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any, Final

from surefix.errors import InputError, ParseError

__all__ = ["read_toml"]

_LARGEST: Final = 1 << 63


def read_toml(path: Path) -> dict[str, Any]:
    """Read a TOML file.

    Raises
    ------
    InputError, ParseError
        The file cannot be read, or is not TOML.
    """
    try:
        content = tomllib.loads(path.read_text("utf-8"))
    except OSError as error:
        raise InputError(f"{path}: {error.strerror}", "a readable TOML file") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, RecursionError) as error:
        raise ParseError(f"{path}: {error}", "a TOML file") from error
    if _too_large(content):
        raise ParseError(f"{path}: a whole number of more than 64 bits", "one of 64 bits")
    return content


def _too_large(value: object) -> bool:
    """Whether there is a whole number that TOML does not have."""
    if isinstance(value, dict):
        return any(map(_too_large, value.values()))
    if isinstance(value, list):
        return any(map(_too_large, value))
    return isinstance(value, int) and not -_LARGEST <= value < _LARGEST
