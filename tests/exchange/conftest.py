"""Fixtures: mechanisms for export, the Katana450 and a very different tree."""

from __future__ import annotations

import zipfile
from collections.abc import Iterator
from pathlib import Path

import pytest

from katana450.arm.robot.loader import load
from katana450.arm.robot.robot import Robot
from katana450.cli.main import main
from katana450.extensions.importers.formats import shape_file
from katana450.extensions.importers.formats.shape_file import SECONDS
from katana450.resources import URDF_PATH

GANTRY = Path(__file__).parent / "gantry.urdf"

LARGEST_PACKAGE = 800_000
"""[bytes] Maximum size of the zip of the Katana's ROS package."""

POSES = (
    (0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    (0.4, -1.187, 1.484, 0.14, 0.5, 0.2),
    (-1.1, -0.6, -0.9, 0.8, 1.2, -0.3),
)
"""Poses of the Katana, the gripper last."""

GANTRY_POSE = (0.3, 2.0, -0.6)


@pytest.fixture(scope="session", autouse=True)
def patience() -> Iterator[None]:
    """Let a busy machine read meshes slowly, but in tests with ``limited_time``."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(shape_file, "SECONDS", 60.0)
        yield


@pytest.fixture
def limited_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the limit of the time to read a file apply."""
    monkeypatch.setattr(shape_file, "SECONDS", SECONDS)


@pytest.fixture(scope="session")
def katana() -> Robot:
    return load(URDF_PATH)


@pytest.fixture(scope="session")
def gantry() -> Robot:
    return load(GANTRY)


@pytest.fixture(scope="session")
def ros_package(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the Katana's ROS package as the command writes it and unzip unpacks it."""
    where = tmp_path_factory.mktemp("workspace")
    assert main(["export", "urdf", "--out", str(where)]) == 0
    archive = where / "katana450_description.zip"
    assert archive.stat().st_size < LARGEST_PACKAGE
    zipfile.ZipFile(archive).extractall(where / "src")
    return where / "src" / "katana450_description"
