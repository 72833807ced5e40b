"""The first run says that it compiles; help loads nothing heavy."""

import subprocess
import sys
from pathlib import Path

import pytest

from surefix.cli_warmup import announced
from surefix.jit import kernel


def test_help_loads_neither_numba_nor_numpy() -> None:
    code = (
        "import sys\n"
        "sys.argv = ['surefix', '--help']\n"
        "from surefix.cli import main\n"
        "try: main()\n"
        "except SystemExit: pass\n"
        "heavy = {'numba', 'numpy', 'pyarrow', 'scipy'} & set(sys.modules)\n"
        "sys.exit(1 if heavy else 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout
    assert "warmup" in done.stdout


def test_cleaning_loads_nothing_that_it_does_not_use(tmp_path: Path) -> None:
    log = tmp_path / "log.csv"
    log.write_text("time,x\n" + "".join(f"{k},{k * k % 7}\n" for k in range(50)))
    code = (
        "import sys\n"
        f"sys.argv = ['surefix', 'clean', {str(log)!r}]\n"
        "from surefix.cli import main\n"
        "try: main()\n"
        "except SystemExit: pass\n"
        "slow = {'pandas', 'scipy.linalg', 'scipy.optimize', 'scipy.special', 'scipy.stats'}\n"
        "sys.exit(1 if slow & set(sys.modules) else 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize("terminal", [True, False])
def test_compilation_is_announced_on_a_terminal(
    terminal: bool, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys.stderr, "isatty", lambda: terminal, raising=False)

    def double(x: float) -> float:
        return 2.0 * x

    fresh = kernel(double)
    with announced():
        assert fresh(1.5) == 3.0
    said = capsys.readouterr().err
    assert ("compiling" in said) == (terminal and bool(fresh.stats.cache_misses))  # type: ignore[attr-defined]
