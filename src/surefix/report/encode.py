"""Figures as JSON that is small and safe inside a page.

Arrays are stored once each, however many figures use them: numbers as float32 about their median,
times as float64 milliseconds, texts as codes into a table. The page's script unpacks them.
"""

from __future__ import annotations

import base64
import json
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["dumps"]

_SAFE: dict[str, str | int | None] = {
    "<": "\\u003c",
    ">": "\\u003e",
    "&": "\\u0026",
    "\u2028": "\\u2028",
    "\u2029": "\\u2029",
}


def dumps(figures: Any) -> str:
    """Write figures (dicts, lists, arrays, numbers, texts) as ``{"arrays": …, "figures": …}``.

    Characters that mean something to an HTML parser are written as escapes; NaN becomes null.
    """
    pool: dict[tuple[str, bytes], int] = {}
    arrays: list[dict[str, Any]] = []
    plain = _plain(figures, pool, arrays)
    text = json.dumps({"arrays": arrays, "figures": plain}, allow_nan=False, separators=(",", ":"))
    return text.translate(str.maketrans(_SAFE))


def _plain(value: Any, pool: dict[tuple[str, bytes], int], arrays: list[dict[str, Any]]) -> Any:
    match value:
        case dict():
            return {key: _plain(item, pool, arrays) for key, item in value.items()}
        case list() | tuple():
            return [_plain(item, pool, arrays) for item in value]
        case np.ndarray():
            key = (value.dtype.str, value.tobytes())
            if key not in pool:
                pool[key] = len(arrays)
                arrays.append(_packed(value))
            return {"array": pool[key]}
        case np.generic():
            return _plain(value.item(), pool, arrays)
        case float():
            return value if np.isfinite(value) else None
        case _:
            return value


def _packed(values: NDArray[Any]) -> dict[str, Any]:
    """Pack one array, (n,), under its kind."""
    if values.dtype.kind == "M":
        ticks = values.astype("datetime64[ms]")
        known = np.where(np.isnat(ticks), np.nan, ticks.astype(np.int64).astype(np.float64))
        return {"time": _base64(known.astype("<f8"))}
    if values.dtype.kind == "U":
        table, codes = np.unique(values, return_inverse=True)
        return {"text": _base64(codes.astype("<i4")), "table": table.tolist()}
    numbers = values.astype(np.float64)
    finite = numbers[np.isfinite(numbers)]
    offset = float(np.median(finite)) if finite.size else 0.0
    with np.errstate(over="ignore"):
        return {"number": _base64((numbers - offset).astype("<f4")), "offset": offset}


def _base64(values: NDArray[Any]) -> str:
    return base64.b64encode(values.tobytes()).decode("ascii")
