"""``katana450 render`` makes the requested picture, and reports the reason where it cannot."""

from __future__ import annotations

from pathlib import Path

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


def test_a_picture_of_a_motion_shows_its_end(tmp_path: Path) -> None:
    table, motion, pose = (tmp_path / name for name in ("m.csv", "motion.png", "pose.png"))
    table.write_text("t,theta1,theta2,theta3,theta4\n0,0,-1.19,1.48,0.14\n1,1.5,-1.19,1.48,0.14\n")
    assert main(["render", "--out", str(motion), "--trajectory", str(table), *SMALL]) == 0
    assert main(["render", "--out", str(pose), "--pose=1.5,-1.19,1.48,0.14,0,0", *SMALL]) == 0
    assert motion.read_bytes() == pose.read_bytes()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("a.gif",), "must end in .png for a picture or in .mp4"),
        (("a.mp4",), "A film needs a motion"),
        (("a.mp4", "--run", "pour", "--size", "101x80"), "must be even"),
        (("a.mp4", "--run", "pour", "--fps", "0"), "pictures per second"),
        (("a.mp4", "--run", "nowhere.yaml"), "nowhere.yaml cannot be read"),
        (("a.png", "--pose", "9,0"), "axis_1 cannot be at 9 rad"),
        (("a.png", "--trajectory", "nowhere.csv"), "nowhere.csv cannot be read"),
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
