"""What the benchmarks of reading, scale and start-up share: machine, versions, tables, JSON."""

from __future__ import annotations

import json
import os
import platform
from collections.abc import Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

__all__ = ["conclude", "machine"]


def machine() -> dict[str, str]:
    """Name the processor, its load, and the versions that matter."""
    info = Path("/proc/cpuinfo")
    text = info.read_text() if info.exists() else ""
    names = [line.partition(": ")[2] for line in text.splitlines() if line.startswith("model name")]
    packages = ("surefix", "numpy", "numba", "pyarrow")
    return {
        "processor": names[0] if names else platform.processor(),
        "cores": str(os.cpu_count()),
        "load": f"{os.getloadavg()[0]:.1f}",
        "python": platform.python_version(),
        **{name: version(name) for name in packages},
    }


def conclude(rows: Sequence[Mapping[str, Any]], place: Path | None) -> None:
    """Print one line per row and the machine; write all of it as JSON where wanted."""
    for row in rows:
        print("  ".join(f"{name} {value}" for name, value in row.items()))
    print(", ".join(f"{name} {value}" for name, value in machine().items()))
    if place is not None:
        place.write_text(json.dumps({"machine": machine(), "rows": list(rows)}, indent=2) + "\n")
