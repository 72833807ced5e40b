"""What a test needs from outside the project: it is skipped, saying so, where that is absent.

``SUREFIX_DATA`` points to the real logs (else ``../shared/data`` beside the checkout is tried).
With ``SUREFIX_REQUIRE_TOOLS=1``, as in CI, a missing program is a failure instead of a skip.
"""

import os
import shutil
from pathlib import Path

import pytest

BESIDE = Path(__file__).resolve().parents[2] / "shared" / "data"


def data(folder):
    """Path of a folder of real logs."""
    path = Path(os.environ.get("SUREFIX_DATA", BESIDE)) / folder
    if not path.is_dir():
        pytest.skip(f"real data {folder} is not here (set SUREFIX_DATA)")
    return path


def tool(*names):
    """Path of a program, by any of its names."""
    for name in names:
        if path := shutil.which(name):
            return path
    text = f"{' or '.join(names)} is not installed"
    if os.environ.get("SUREFIX_REQUIRE_TOOLS") == "1":
        pytest.fail(text)
    return pytest.skip(text)
