"""A state as bytes, to be stored and gone on from: no code in it, only plain data of surefix.

The bytes are a head (magic, form, check sum), a JSON text that says how records are nested, and the
arrays one after the other. What is read back is the same to the last bit.
"""

from __future__ import annotations

import json
import struct
import zlib
from array import array
from collections import deque
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from importlib import import_module
from importlib.metadata import version
from typing import Any, Final, TypeVar

import numpy as np
from numpy.typing import NDArray

from surefix.errors import InputError, OptionsError
from surefix.pipelines.state import Session

__all__ = ["restored", "snapshot"]

_MAGIC: Final = b"surefix\x00"
_HEAD: Final = struct.Struct("<8sIIQ")  # magic, form, check sum of the rest, length of the JSON
_FORM: Final = 1
_KINDS: Final = "biuf"  # of arrays
_PLAIN: Final = (bool, int, float, str, type(None))
_OURS: Final = "surefix."
_SEVERAL: Final = (list, set)

T = TypeVar("T")


def snapshot(state: object) -> bytes:
    """Everything that a session remembers, or another state made of records of surefix.

    Raises
    ------
    OptionsError
        It is a session with an estimator of its own, which cannot be stored.
    """
    arrays: list[NDArray[Any]] = []
    tree = {"version": version("surefix"), "state": _packed(state, arrays)}
    tree["arrays"] = [[each.dtype.str, each.shape] for each in arrays]
    text = json.dumps(tree, separators=(",", ":")).encode()
    body = b"".join([text, *(each.tobytes() for each in arrays)])
    return _HEAD.pack(_MAGIC, _FORM, zlib.crc32(body, len(text)), len(text)) + body


def restored(stored: bytes, kind: type[T]) -> T:
    """Read back what `snapshot` gave, which is to be of a kind.

    Raises
    ------
    InputError
        It is damaged, or was written by another version.
    """
    body = stored[_HEAD.size :]
    if len(stored) < _HEAD.size or stored[:8] != _MAGIC:
        raise InputError("bytes that are no snapshot", "what surefix stored")
    _, form, check, length = _HEAD.unpack_from(stored)
    if form != _FORM or zlib.crc32(body, length & 0xFFFFFFFF) != check or length > len(body):
        raise InputError("a snapshot that is damaged", "what surefix stored, whole")
    tree = json.loads(body[:length])
    if tree["version"] != version("surefix"):
        raise InputError(
            f"a snapshot of surefix {tree['version']}",
            f"one of surefix {version('surefix')}",
            "go on with the version that wrote it, or begin anew",
        )
    arrays, at = [], length
    for code, shape in tree["arrays"]:
        dtype = np.dtype(code)
        if dtype.kind not in _KINDS:
            raise InputError(f"a snapshot with an array of {code}", "numbers")
        count = int(np.prod(shape, dtype=np.int64))
        arrays.append(np.frombuffer(body, dtype, count, at).reshape(shape).copy())
        at += arrays[-1].nbytes
    state = _unpacked(tree["state"], arrays)
    if not isinstance(state, kind):
        raise InputError(f"a snapshot of a {type(state).__name__}", f"one of a {kind.__name__}")
    return state


def _packed(value: object, arrays: list[NDArray[Any]]) -> Any:
    if isinstance(value, np.ndarray):
        if value.dtype.kind not in _KINDS:
            raise TypeError(f"an array of {value.dtype} in a state")
        arrays.append(np.ascontiguousarray(value).reshape(value.shape))
        return {"array": len(arrays) - 1}
    if isinstance(value, np.generic):
        return value.item()
    if type(value) in _PLAIN:
        return value
    if isinstance(value, Mapping):
        return {"map": [[_packed(k, arrays), _packed(v, arrays)] for k, v in value.items()]}
    if isinstance(value, bytes):
        return {"bytes": value.decode("latin-1")}
    if isinstance(value, array):
        return {"numbers": value.typecode, "of": _packed(np.array(value), arrays)}
    if isinstance(value, deque):
        return {"deque": [_packed(item, arrays) for item in value], "most": value.maxlen}
    if isinstance(value, _SEVERAL):
        return {type(value).__name__: [_packed(item, arrays) for item in value]}
    if isinstance(value, Session) and value.estimator is not None:
        raise OptionsError("a session with an estimator of its own", "a method of the options")
    names = _names(type(value)) or _attributes(value)
    if names is not None:
        held = {name: _packed(getattr(value, name), arrays) for name in names}
        return {"is": f"{type(value).__module__}:{type(value).__qualname__}", "with": held}
    if isinstance(value, tuple):
        return [_packed(item, arrays) for item in value]
    raise TypeError(f"{type(value).__name__} in a state")


def _unpacked(tree: Any, arrays: list[NDArray[Any]]) -> Any:
    if isinstance(tree, list):
        return tuple(_unpacked(item, arrays) for item in tree)
    if not isinstance(tree, dict):
        return tree
    if "array" in tree:
        return arrays[tree["array"]]
    if "map" in tree:
        return {_unpacked(k, arrays): _unpacked(v, arrays) for k, v in tree["map"]}
    if "bytes" in tree:
        return tree["bytes"].encode("latin-1")
    if "numbers" in tree:
        return array(tree["numbers"], _unpacked(tree["of"], arrays).tolist())
    if "deque" in tree:
        return deque((_unpacked(item, arrays) for item in tree["deque"]), tree["most"])
    for several in _SEVERAL:
        if several.__name__ in tree:
            return several(_unpacked(item, arrays) for item in tree[several.__name__])
    module, _, name = tree["is"].partition(":")
    kind = getattr(import_module(module), name) if module.startswith(_OURS) else None
    if not isinstance(kind, type):
        raise InputError(f"a snapshot with {tree['is']}", "records of this version of surefix")
    held = {key: _unpacked(value, arrays) for key, value in tree["with"].items()}
    names = _names(kind)
    if names is None:
        made: object = object.__new__(kind)
        for name, value in held.items():
            setattr(made, name, value)
        return made
    if set(names) != set(held):
        raise InputError(f"a snapshot with {tree['is']}", "records of this version of surefix")
    return kind(**held)


def _names(kind: type) -> list[str] | None:
    """Fields that a record of surefix is made from; None for anything else."""
    if not kind.__module__.startswith(_OURS):
        return None
    if is_dataclass(kind):
        return [field.name for field in fields(kind) if field.init]
    named = getattr(kind, "_fields", None)
    return list(named) if issubclass(kind, tuple) and named is not None else None


def _attributes(value: object) -> list[str] | None:
    """What an object of surefix that is no record consists of; None for anything else."""
    if not type(value).__module__.startswith(_OURS):
        return None
    return list(getattr(type(value), "__slots__", None) or vars(value))
