"""Films and pages of runs as a person makes them, and Ctrl-C during a film."""

from __future__ import annotations

import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from imageio_ffmpeg import get_ffmpeg_exe

from katana450.cli.main import main
from tests.commands import completed

pytestmark = pytest.mark.long

ROOT = Path(__file__).resolve().parents[2]

TABLE = "t,theta1,theta2,theta3,theta4\n0,0,-1.19,1.48,0.14\n0.5,1,-1.19,1.48,0.14\n"

PAGE_AT_MOST = 6e6
"""[bytes]"""


def command(*words: str) -> list[str]:
    return [sys.executable, "-m", "katana450", *words]


def test_a_film_of_a_motion(tmp_path: Path) -> None:
    (tmp_path / "m.csv").write_text(TABLE)
    path = tmp_path / "m.mp4"
    words = ("--trajectory", str(tmp_path / "m.csv"), "--size", "160x100", "--fps", "10")
    subprocess.run(command("render", "--out", str(path), *words), cwd=ROOT, check=True, timeout=120)
    output = completed([get_ffmpeg_exe(), "-i", str(path)]).stderr
    assert "160x100" in output
    assert "10 fps" in output
    # From 0 to 0.5 s, with both ends.
    assert re.search(r"Duration: 00:00:00.60", output)


def test_ctrl_c_leaves_no_partial_film(tmp_path: Path) -> None:
    (tmp_path / "m.csv").write_text(TABLE.replace("0.5,1", "60,1"))
    path = tmp_path / "film" / "m.mp4"
    path.parent.mkdir()
    words = ("--trajectory", str(tmp_path / "m.csv"), "--size", "160x100")
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


def test_the_pages_of_both_demos_are_small_and_load_nothing(tmp_path: Path) -> None:
    for run in ("circle", "pour"):
        path = tmp_path / f"{run}.html"
        assert main(["export", "html", "--out", str(path), "--run", run]) == 0
        assert path.stat().st_size < PAGE_AT_MOST
        text = path.read_text(encoding="utf-8")
        assert f"<title>katana450: {run}</title>" in text
        assert "__VISER_EMBED_DATA__" in text
