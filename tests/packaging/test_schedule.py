"""Tests in several processes: results come back, and tests that never ran are an error."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from tests.commands import ROOT, completed

CONFTEST = """
import os
import pytest
from tests.schedule import Distribution

def pytest_configure(config):
    os.environ["XDG_STATE_HOME"] = "state"
    config.pluginmanager.register(Distribution(2))

@pytest.fixture(scope="session")
def process():
    with open(f"{os.getpid()}.txt", "x"):
        yield os.getpid()
"""
FAILS = "def test_fails(process):\n    print('its words')\n    assert process < 0\n"
PASSES = "def test_passes(process):\n    assert process > 0\n" + "\n".join(
    f"def test_{number}(process):\n    pass" for number in range(3)
)
CRASHES = "import os\ndef test_crashes():\n    os._exit(7)\n"


@pytest.mark.skipif(sys.platform == "win32", reason="forks")
def test_failures_and_crashes_of_processes_are_reported(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", "-c", "none.ini"]
    files = {"conftest.py": CONFTEST, "test_a.py": FAILS, "test_b.py": PASSES, "none.ini": ""}
    for name, text in files.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    done = completed(command, cwd=tmp_path, env={"PYTHONPATH": str(ROOT)})
    assert "1 failed, 4 passed" in done.stdout, done.stdout + done.stderr
    assert "its words" in done.stdout
    assert done.returncode == pytest.ExitCode.TESTS_FAILED
    # The fixtures of the session are made once in each process.
    assert 1 <= len(list(tmp_path.glob("*.txt"))) <= 2
    (tmp_path / "test_c.py").write_text(CRASHES, encoding="utf-8")
    done = completed(command, cwd=tmp_path, env={"PYTHONPATH": str(ROOT)})
    assert "in test_c.py::test_crashes" in done.stdout, done.stdout + done.stderr
    assert done.returncode == pytest.ExitCode.INTERNAL_ERROR
