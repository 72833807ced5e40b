"""Programs and packages that a test needs: it is skipped, saying so, where one is absent.

With ``SUREFIX_REQUIRE_TOOLS=1``, as in CI, a missing program is a failure instead of a skip.
"""

import importlib
import os
import shutil
from pathlib import Path

import pytest


def tool(*names):
    """Path of a program, by any of its names."""
    for name in names:
        if path := shutil.which(name):
            return path
    return _absent(f"{' or '.join(names)} is not installed")


def package(name):
    """A module of an optional package."""
    try:
        return importlib.import_module(name)
    except ImportError:
        return _absent(f"the package {name} is not installed")


def built(*parts):
    """Path of what `.ci/run` has installed in the build folder."""
    place = Path(__file__).parents[1].joinpath("build", *parts)
    return place if place.exists() else _absent(f"{place.name} is not installed: .ci/run")


def _absent(text):
    if os.environ.get("SUREFIX_REQUIRE_TOOLS") == "1":
        pytest.fail(text)
    return pytest.skip(text)
