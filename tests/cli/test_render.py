"""``katana450 render`` makes the requested picture, and reports the reason where it cannot."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from katana450.cli.main import main

SMALL = ("--size", "160x100")


def test_the_picture_has_the_requested_size(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "one.png"
    words = ["--pose=0.4,-1.187,1.484,0.14,0.5,0.2", "--camera", "tool", *SMALL]
    assert main(["render", "--out", str(path), *words]) == 0
    assert f"{path}: {path.stat().st_size} bytes\n" in capsys.readouterr().out
    with Image.open(path) as picture:
        assert picture.size == (160, 100)


def test_a_picture_of_a_run_shows_its_end(tmp_path: Path) -> None:
    script, run, pose = (tmp_path / name for name in ("s.yaml", "run.png", "pose.png"))
    script.write_text("steps:\n  - joints: [80, -68, 85, 8, 0]\n")
    angles = ",".join(f"{math.radians(angle):.6f}" for angle in (80, -68, 85, 8, 0))
    assert main(["render", "--out", str(run), "--run", str(script), *SMALL]) == 0
    assert main(["render", "--out", str(pose), f"--pose={angles},0", *SMALL]) == 0
    shown, expected = (np.asarray(Image.open(path), float) for path in (run, pose))
    assert np.abs(shown - expected).mean() < 2.0


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("a.gif",), "must end in .png for a picture or in .mp4"),
        (("a.mp4",), "A film needs a motion"),
        (("a.mp4", "--run", "pour", "--size", "101x80"), "must be even"),
        (("a.mp4", "--run", "pour", "--fps", "0"), "pictures per second"),
        (("a.mp4", "--run", "nowhere.yaml"), "nowhere.yaml cannot be read"),
        (("a.png", "--pose", "9,0"), "axis_1 cannot be at 9 rad"),
        (("nowhere/a.png",), "There is no directory"),
        (("a.png", "--urdf", "nowhere.urdf"), "no robot description"),
    ],
)
def test_impossible_pictures_are_reported(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], words: tuple[str, ...], message: str
) -> None:
    out, *more = words
    assert main(["render", "--out", str(tmp_path / out), *more]) == 1
    assert message in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "words",
    [("--size", "9x9"), ("--size", "big"), ("--camera", "moon"), ("--run", "pour", "--pose", "0")],
)
def test_unknown_words_are_refused(tmp_path: Path, words: tuple[str, ...]) -> None:
    with pytest.raises(SystemExit):
        main(["render", "--out", str(tmp_path / "a.png"), *words])
