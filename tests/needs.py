"""Programs that a test talks to: it is skipped, saying so, where one is absent.

With ``SUREFIX_REQUIRE_TOOLS=1``, as in CI, a missing program is a failure instead of a skip.
"""

import os
import shutil

import pytest


def tool(*names):
    """Path of a program, by any of its names."""
    for name in names:
        if path := shutil.which(name):
            return path
    text = f"{' or '.join(names)} is not installed"
    if os.environ.get("SUREFIX_REQUIRE_TOOLS") == "1":
        pytest.fail(text)
    return pytest.skip(text)
