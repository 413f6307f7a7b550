"""Pictures and pages of other robots: arms of other sizes, and robots without an arm."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from katana450.cli.main import main
from katana450.extensions.media.posed import posed
from katana450.resources import URDF_PATH
from katana450.server.view.cameras import camera_pose
from katana450.server.viser_bridge.presets import CAMERA_POSES, FOV, Preset
from tests.general_arms.links_of_arms import ur5e
from tests.robot.hands import hand

ASPECT = 16.0 / 9.0


@pytest.fixture(params=[ur5e, hand])
def urdf(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    path = tmp_path / f"{request.param.__name__}.urdf"
    path.write_text(request.param())
    return path


@pytest.mark.cases(4)
@pytest.mark.parametrize("preset", CAMERA_POSES)
def test_named_views_show_the_whole_robot(urdf: Path, preset: Preset) -> None:
    robot, session, state = posed((), urdf)
    look = camera_pose(preset, robot, state)
    eye = np.array(look.position)
    view_axis = np.subtract(look.target, eye) / np.linalg.norm(np.subtract(look.target, eye))
    right = np.cross(view_axis, (0.0, 0.0, 1.0))
    right /= np.linalg.norm(right)
    frames = robot.frames(robot.joint_values(session.ready, 0.0))
    corners = [
        shape.corners @ frames[link.name][:3, :3].T + frames[link.name][:3, 3]
        for link in robot.links
        for shape in link.shapes
    ]
    rays = np.concatenate(corners) - eye
    depth = rays @ view_axis
    assert depth.min() > 0.0
    half = math.tan(FOV / 2.0)
    assert np.abs(rays @ np.cross(right, view_axis) / depth).max() < half
    assert np.abs(rays @ right / depth).max() < half * ASPECT
    # Not from far away either: it takes at least a sixth of the height or width.
    sizes = [np.ptp(rays @ axis / depth) for axis in (right, np.cross(right, view_axis))]
    assert max(sizes) > half / 3.0


def test_katana_keeps_its_views() -> None:
    robot, _, state = posed((), URDF_PATH)
    for preset, look in CAMERA_POSES.items():
        assert camera_pose(preset, robot, state) == look


def test_picture_shows_the_robot(urdf: Path, tmp_path: Path) -> None:
    path = tmp_path / "one.png"
    words = ["--urdf", str(urdf), "--pose=0.3,-0.3", "--size", "160x100"]
    assert main(["render", "--out", str(path), *words]) == 0
    with Image.open(path) as picture:
        assert picture.size == (160, 100)
        middle = np.asarray(picture.convert("L"))[35:75, 60:100]
    # The robot is darker than the light background.
    assert np.count_nonzero(middle < 180) > 100
