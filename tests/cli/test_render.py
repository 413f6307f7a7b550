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


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("a.gif",), "must end in .png"),
        (("a.mp4",), "`record export --format mp4` makes films"),
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
    [("--size", "9x9"), ("--size", "big"), ("--camera", "moon"), ("--run", "pour")],
)
def test_unknown_words_are_refused(tmp_path: Path, words: tuple[str, ...]) -> None:
    with pytest.raises(SystemExit):
        main(["render", "--out", str(tmp_path / "a.png"), *words])
