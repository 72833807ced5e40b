"""The running median side by side with scipy's (and bottleneck's, where installed).

Run ``python bench/running_median.py``. Cost per sample, medians of several rounds in turn, and the
ratio to ``scipy.ndimage.median_filter``: above 1 scipy is faster. scipy knows neither missing
samples nor single steps; the window here does.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from importlib.util import find_spec

import numpy as np
from scipy.ndimage import median_filter

from surefix.cleaning.running_median import running_median

SAMPLES = 100_000
ROUNDS = 9
WINDOWS = (5, 39, 301, 3001, 30_001)


def main() -> None:
    """Print one row per window."""
    series = np.random.default_rng(1).standard_normal(SAMPLES)
    print("window  " + "  ".join(f"{name:>12}" for name in methods(5)) + "   ns a sample (ratio)")
    for window in WINDOWS:
        rounds = methods(window)
        for method in rounds.values():
            method(series)
        taken = {name: [] for name in rounds}
        for _ in range(ROUNDS):
            for name, method in rounds.items():
                taken[name].append(seconds(partial(method, series)))
        cost = {name: 1e9 * float(np.median(each)) / SAMPLES for name, each in taken.items()}
        cells = (f"{each:6.0f} ({each / cost['scipy']:4.2f})" for each in cost.values())
        print(f"{window:6d}  " + "  ".join(f"{cell:>12}" for cell in cells))


def methods(window: int) -> dict[str, Callable[[np.ndarray], np.ndarray]]:
    """Each way to the running median of one window."""
    found = {
        "surefix": partial(running_median, window=window),
        "scipy": partial(median_filter, size=window),
    }
    if find_spec("bottleneck"):
        import bottleneck

        found["bottleneck"] = partial(bottleneck.move_median, window=window)
    return found


def seconds(call: Callable[[], object]) -> float:
    """Time one call."""
    start = time.perf_counter()
    call()
    return time.perf_counter() - start


if __name__ == "__main__":
    main()
