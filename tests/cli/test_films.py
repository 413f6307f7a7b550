"""Ctrl-C during a film of a recording."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.recording.recorded import record, swinging

pytestmark = pytest.mark.long

ROOT = Path(__file__).resolve().parents[2]


def test_ctrl_c_leaves_no_partial_film(tmp_path: Path) -> None:
    run, path = tmp_path / "run.mcap", tmp_path / "film" / "m.mp4"
    record(run, 2000, commands=swinging)
    path.parent.mkdir()
    words = ("--format", "mp4", "--out", str(path), "--size", "160x100")
    with subprocess.Popen(
        [sys.executable, "-m", "katana450", "record", "export", str(run), *words],
        cwd=ROOT,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    ) as process:
        # Wait for the first picture in it.
        deadline = time.monotonic() + 90.0
        while not list(path.parent.iterdir()):
            assert time.monotonic() < deadline
            assert process.poll() is None
            time.sleep(0.1)
        process.send_signal(signal.SIGINT)
        _, output = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "Traceback" not in output
    assert list(path.parent.iterdir()) == []
