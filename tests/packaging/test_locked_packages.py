"""Reports and films work with only the packages that ``make run`` installs."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
LOADED_ON_USE = ("imageio_ffmpeg", "matplotlib", "xacro")
NOT_LOCKED = ("hypothesis", "mypy", "playwright", "pyarrow", "pytest")
MOTION = "t,theta1,theta2,theta3,theta4\n0,0,-1.19,1.48,0.14\n0.5,1,-1.19,1.48,0.14\n"


def run(folder: Path, *command: str | Path, seconds: float = 120.0) -> str:
    """Return the output of ``command``, started in ``folder``."""
    words = [str(part) for part in command]
    done = subprocess.run(
        words, cwd=folder, capture_output=True, text=True, check=False, timeout=seconds
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_libraries_are_installed_without_those_of_the_tests(python: Path, tmp_path: Path) -> None:
    words = (
        "import embreex.rtcore_scene, imageio_ffmpeg, matplotlib.pyplot, PIL.Image; "
        f"from importlib.util import find_spec; print(*filter(find_spec, {NOT_LOCKED})); "
        "imageio_ffmpeg.get_ffmpeg_exe()"
    )
    assert run(tmp_path, python, "-c", words).split() == []


def test_libraries_are_loaded_on_use_only(python: Path, tmp_path: Path) -> None:
    words = (
        "import sys; from katana450.cli.main import _parser; _parser(); "
        "from katana450.cli import serve; import katana450.assembly.frontend_process; "
        f"import katana450; katana450.load(); print(*filter(sys.modules.get, {LOADED_ON_USE}))"
    )
    assert run(tmp_path, python, "-c", words).split() == []


@pytest.mark.long
def test_report_of_a_demo(python: Path, tmp_path: Path) -> None:
    """The command of the README."""
    katana450 = python.parent / "katana450"
    run(tmp_path, katana450, "demo", "circle", "--headless", "--report", "out")
    found = {path.name for path in (tmp_path / "out").iterdir()}
    assert found >= {"report.html", "report.json", "trace.csv", "tracing.png", "path.png"}


@pytest.mark.long
def test_film_of_a_motion(python: Path, tmp_path: Path) -> None:
    (tmp_path / "m.csv").write_text(MOTION, encoding="utf-8")
    words = ("--trajectory", "m.csv", "--size", "64x48", "--fps", "4", "--out", "m.mp4")
    run(tmp_path, python.parent / "katana450", "render", *words)
    assert (tmp_path / "m.mp4").read_bytes()[4:8] == b"ftyp"


def test_documents_name_no_further_installation() -> None:
    for page in (
        ROOT / "README.md",
        ROOT / "examples" / "README.md",
        *(ROOT / "docs").glob("*.md"),
    ):
        assert not re.search(r"\[report\]", page.read_text(encoding="utf-8")), page
