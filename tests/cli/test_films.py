"""Films of runs as a person makes them, and Ctrl-C during a film."""

from __future__ import annotations

import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from imageio_ffmpeg import get_ffmpeg_exe

from tests.commands import completed

pytestmark = pytest.mark.long

ROOT = Path(__file__).resolve().parents[2]

SCRIPT = "steps:\n  - joints: [20, -68, 85, 8, 0]\n"


def command(*words: str) -> list[str]:
    return [sys.executable, "-m", "katana450", *words]


def test_a_film_of_a_motion(tmp_path: Path) -> None:
    (tmp_path / "m.yaml").write_text(SCRIPT)
    path = tmp_path / "m.mp4"
    words = ("--run", str(tmp_path / "m.yaml"), "--size", "160x100", "--fps", "10")
    subprocess.run(command("render", "--out", str(path), *words), cwd=ROOT, check=True, timeout=120)
    output = completed([get_ffmpeg_exe(), "-i", str(path)]).stderr
    assert "160x100" in output
    assert "10 fps" in output
    assert re.search(r"Duration: 00:00:0[1-5]\.\d0", output)


def test_ctrl_c_leaves_no_partial_film(tmp_path: Path) -> None:
    path = tmp_path / "film" / "m.mp4"
    path.parent.mkdir()
    words = ("--run", "pour", "--size", "160x100")
    with subprocess.Popen(
        command("render", "--out", str(path), *words),
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
