"""The same work in C, built on the spot."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path
from tempfile import gettempdir

import numpy as np

from problems import Linear

SOURCE = Path(__file__).with_name("kalman.c")
FLAGS = ("-O3", "-march=native", "-shared", "-fPIC")


def compiler() -> str:
    """First line of ``gcc --version``; raises FileNotFoundError without gcc."""
    found = shutil.which("gcc")
    if not found:
        raise FileNotFoundError("gcc is not installed")
    shown = subprocess.run([found, "--version"], check=True, capture_output=True, text=True)
    return shown.stdout.splitlines()[0]


def filter_in_c(problem: Linear, *, robust: bool) -> Callable[[], tuple[np.ndarray, np.ndarray]]:
    """Means and covariances by `kalman.c`."""
    compiler()
    N, m = problem.z.shape
    n = len(problem.mean)
    library = Path(gettempdir()) / f"surefix-bench-{n}-{m}-{robust}.so"
    sizes = [f"-DN={n}", f"-DM={m}", *(["-DROBUST"] if robust else [])]
    command = ["gcc", *FLAGS, *sizes, str(SOURCE), "-o", str(library), "-lm"]
    subprocess.run(command, check=True)
    call = ctypes.CDLL(str(library)).filter
    given = [problem.F, problem.Q, problem.H, problem.R, problem.z]
    arrays = [np.ascontiguousarray(each) for each in (*given, problem.mean, problem.covariance)]

    def run() -> tuple[np.ndarray, np.ndarray]:
        mean, covariance = np.empty((N, n)), np.empty((N, n, n))
        places = [each.ctypes.data_as(ctypes.c_void_p) for each in (*arrays, mean, covariance)]
        call(ctypes.c_long(N), *places, ctypes.c_double(1.5), ctypes.c_double(4.5))
        return mean, covariance

    return run
