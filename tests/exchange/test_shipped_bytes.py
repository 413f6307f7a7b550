"""The command writes the bytes that the tests of other programs take from the functions."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import pytest

from katana450.arm.robot.robot import Robot
from katana450.cli.main import main
from katana450.extensions.export.c_source import c_files
from katana450.extensions.export.glb import glb_files
from katana450.extensions.export.vrml.vrml_files import vrml_files, world_of, x3d_files
from tests.exchange.conftest import GANTRY, GANTRY_POSE


def exported(folder: Path, *words: str) -> Mapping[str, bytes]:
    """Return the files that the command writes of the gantry, by their paths in ``folder``."""
    assert main(["export", *words, "--urdf", str(GANTRY), "--out", str(folder)]) == 0
    files = [path for path in folder.rglob("*") if path.is_file()]
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in files}


@pytest.mark.parametrize("kind", ["vrml", "x3d", "glb", "c"])
def test_command_writes_the_files_of_a_pose(tmp_path: Path, gantry: Robot, kind: str) -> None:
    values = gantry.values(GANTRY_POSE)
    expected = {
        "vrml": lambda: vrml_files(gantry, world_of(gantry, values)),
        "x3d": lambda: x3d_files(gantry, world_of(gantry, values)),
        "glb": lambda: glb_files(gantry, values),
        "c": lambda: c_files(gantry, values),
    }[kind]()
    options = ["--no-objects"] if kind in ("vrml", "x3d") else []
    pose = f"--pose={','.join(map(str, GANTRY_POSE))}"
    assert exported(tmp_path / "out", kind, pose, *options) == expected
