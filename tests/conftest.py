"""Where the recorded logs are that stand beside the project and are not part of it."""

import os
from pathlib import Path

import pytest

import cluster
from needs import tool

_FLAGS = (
    "--headless --no-sandbox --disable-gpu --disable-dev-shm-usage --hide-scrollbars "
    "--disable-background-networking"
)
_BESIDE = Path(__file__).resolve().parents[2] / "shared" / "data"


@pytest.fixture(scope="session")
def data() -> Path:
    """Folder of the recorded logs; the test is skipped where they are absent."""
    folder = Path(os.environ.get("SUREFIX_DATA", _BESIDE))
    if not folder.is_dir():
        pytest.skip("no recorded logs: set SUREFIX_DATA to their folder to run this test")
    return folder


@pytest.fixture(scope="session")
def postgres():
    """A PostgreSQL server of our own; the test is skipped where it is not installed."""
    yield from cluster.cluster()


@pytest.fixture(scope="module")
def browser():
    """A headless Chromium; the test is skipped where it is not installed."""
    webdriver = pytest.importorskip("selenium.webdriver")
    options = webdriver.ChromeOptions()
    options.binary_location = tool("chromium", "chromium-browser", "google-chrome")
    for flag in _FLAGS.split():
        options.add_argument(flag)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    service = webdriver.ChromeService(tool("chromedriver"))
    driver = webdriver.Chrome(options=options, service=service)
    yield driver
    driver.quit()


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    """Let what shares an experiment run in one process: it would be computed twice."""
    for item in items:
        if item.path.parent.name in ("papers", "comparison"):
            item.add_marker(pytest.mark.xdist_group(item.path.stem))
