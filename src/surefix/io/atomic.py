"""Write a file whole or not at all."""

from __future__ import annotations

import contextlib
import io
import os
import secrets
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

from surefix.errors import OutputError

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer

__all__ = ["replacing", "told_by_name"]


@contextlib.contextmanager
def replacing(path: str | Path) -> Iterator[BinaryIO]:
    """Open a file that takes the place of ``path`` when the block ends without an exception.

    It is written beside its place under a hidden name, brought to the disk, then renamed; on any
    exception, Ctrl-C included, it is removed and what stood in its place before stays.

    Raises
    ------
    OutputError
        The place cannot be written to, or the disk is full. Writing to the file raises it as well;
        other errors of the block pass through as they are.
    """
    place = Path(path)
    draft = place.with_name(f".{place.name}.{secrets.token_hex(4)}.part")
    try:
        with told_by_name(place):
            if place.is_dir():
                raise IsADirectoryError(0, "it is a directory")
            file = _Draft(draft, place)
        try:
            yield file
            file.sync()
        finally:
            with contextlib.suppress(OutputError):
                file.close()
        with told_by_name(place):
            draft.replace(place)
            _sync_directory(place.parent)
    finally:
        with contextlib.suppress(OSError):
            draft.unlink()


class _Draft(io.BufferedWriter):
    """A file whose failures to write are told as those of the file it will become."""

    def __init__(self, draft: Path, place: Path) -> None:
        super().__init__(io.FileIO(draft, "xb"))
        self._place = place

    def write(self, data: ReadableBuffer, /) -> int:
        with told_by_name(self._place):
            return super().write(data)

    def sync(self) -> None:
        """Bring everything to the disk."""
        with told_by_name(self._place):
            self.flush()
            os.fsync(self.fileno())

    def close(self) -> None:
        with told_by_name(self._place):
            super().close()


@contextlib.contextmanager
def told_by_name(place: Path) -> Iterator[None]:
    """Tell failures of the system as those of a file.

    Raises
    ------
    OutputError
        It cannot be written.
    """
    try:
        yield
    except OSError as error:
        raise OutputError(
            f"{place}: {error.strerror or error}",
            "a place that can be written to",
            "check the directory, its permissions and the space left",
        ) from error


def _sync_directory(directory: Path) -> None:
    """Bring a rename to the disk, where the system can."""
    if os.name != "posix":
        return
    handle = os.open(directory, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
