"""Records as the journal notes them: one line of JSON each, in which what is not known is null."""

from __future__ import annotations

import json
import math
from typing import Any, Protocol, TypeVar

__all__ = ["as_text", "from_text"]


class _Record(Protocol):
    """A named tuple of words and numbers."""

    def _asdict(self) -> dict[str, Any]: ...


_Kind = TypeVar("_Kind", bound=_Record)


def as_text(record: _Record) -> str:
    """A record as JSON; NaN is null."""
    plain = {
        name: None if isinstance(value, float) and math.isnan(value) else value
        for name, value in record._asdict().items()
    }
    return json.dumps(plain, ensure_ascii=False)


def from_text(text: str, kind: type[_Kind]) -> _Kind | None:
    """Give the record that a text is of; None if it is of no such."""
    try:
        plain = json.loads(text)
        return kind(**{name: math.nan if v is None else v for name, v in plain.items()})
    except (TypeError, ValueError, AttributeError):
        return None
