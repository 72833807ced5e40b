"""A quick beginning: half of what the libraries would load is of no use to the command line."""

from __future__ import annotations

import gc
import sys
from importlib import import_module
from importlib.abc import MetaPathFinder
from typing import Final

__all__ = ["begin"]

_UNUSED: Final = ("scipy.linalg", "pandas")
_OBJECTS: Final = 300_000


class _Hidden(MetaPathFinder):
    """Lets the import of what is not used fail."""

    def find_spec(self, name: str, *_: object) -> None:
        if name in _UNUSED:
            raise ModuleNotFoundError(name, name=name)


def begin() -> None:
    """Load Numba and Arrow without what they only look for, and keep the collector out of it.

    Numba loads the BLAS of SciPy for products of matrices, which no kernel has (.2 s); Arrow loads
    pandas, where it is installed, for data frames, which no command meets (.4 s). Both do without
    what cannot be imported; it is hidden only while they look. Modules are no garbage either: that
    the collector goes through them while they are made takes another .15 s.

    Arrow watches for Ctrl-C by itself while it reads a table, and now and then it was lost there.
    """
    gc.set_threshold(_OBJECTS)
    sys.meta_path.insert(0, hidden := _Hidden())
    try:
        import_module("numba.np.arraymath")
        arrow = import_module("pyarrow")
        arrow.array([])
    finally:
        sys.meta_path.remove(hidden)
    arrow.enable_signal_handlers(False)
