"""Test that mypy finds no fault in the app; in tests and for other systems in `make test-long`."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]

SYSTEMS = [
    ("app",),
    pytest.param((), marks=pytest.mark.long),
    pytest.param(("--platform", "win32", "app"), marks=pytest.mark.long),
    pytest.param(("--platform", "darwin", "app"), marks=pytest.mark.long),
]


@pytest.mark.parametrize("options", SYSTEMS, ids=["app", "here", "win32", "darwin"])
def test_types_are_consistent(options: tuple[str, ...]) -> None:
    command = [sys.executable, "-m", "mypy", *options]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
