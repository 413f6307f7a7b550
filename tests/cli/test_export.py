"""``katana450 export`` writes all formats, and reports the reason where it cannot."""

from __future__ import annotations

import time
from pathlib import Path

import pytest

from katana450.cli.main import main
from tests.exchange.conftest import GANTRY

pytestmark = pytest.mark.long

LONGEST = 3.0
"""[s] Of processor for one export."""


@pytest.mark.parametrize(
    ("kind", "file"),
    [
        ("vrml", "katana450.wrl"),
        ("c", "viewer.c"),
        ("glb", "katana450.glb"),
        ("urdf", "katana450_description.zip"),
        ("mjcf", "katana450_mjcf.zip"),
    ],
)
def test_every_format_is_written_quickly(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], kind: str, file: str
) -> None:
    before = time.process_time()
    assert main(["export", kind, "--out", str(tmp_path / "new" / "folder")]) == 0
    assert time.process_time() - before < LONGEST
    path = tmp_path / "new" / "folder" / file
    assert f"{path}: {path.stat().st_size} bytes\n" in capsys.readouterr().out


def test_any_mechanism_in_a_pose(tmp_path: Path) -> None:
    words = ["--out", str(tmp_path), "--urdf", str(GANTRY), "--pose=-0.1,7"]
    assert main(["export", "vrml", *words]) == 0
    assert (tmp_path / "gantry_2.wrl").exists()
    assert (tmp_path / "parts" / "thumb.wrl").exists()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("urdf", "--pose", "0,0"), "urdf has no pose"),
        (("glb", "--pose", "0,0,9"), "axis_3 cannot be at 9 rad"),
        (("glb", "--urdf", "nowhere.urdf"), "no robot description at nowhere.urdf"),
    ],
)
def test_impossible_exports_are_reported(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], words: tuple[str, ...], message: str
) -> None:
    assert main(["export", *words, "--out", str(tmp_path)]) == 1
    assert message in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_an_existing_file_is_reported(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "file").write_text("")
    assert main(["export", "glb", "--out", str(tmp_path / "file")]) == 1
    assert "cannot be created" in capsys.readouterr().err


def test_an_invalid_pose_is_refused(tmp_path: Path) -> None:
    with pytest.raises(SystemExit):
        main(["export", "glb", "--out", str(tmp_path), "--pose", "up"])
