"""Tests of drivable mechanisms: limits that followers impose, and reasons against driving."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from katana450.arm.robot.loader import load
from katana450.errors import RobotDescriptionError
from katana450.extensions.export.c_source import c_files
from katana450.extensions.export.glb import glb_files
from katana450.extensions.export.urdf_package import package_files
from katana450.extensions.export.vrml.vrml_files import vrml_files, world_of
from tests.exchange.conftest import GANTRY
from tests.exchange.trees import tree
from tests.exchange.vrml_reading import read_world
from tests.robot.urdf_files import saved


def test_followers_limit_their_leader() -> None:
    robot = load(GANTRY)
    joints = robot.joint_group
    assert joints.names == ("rail", "turn", "grip")
    assert joints.slides == (True, False, False)
    # "grip too" = 0.1 - grip in (-2, 2) and "out" = -0.04 + ... are not narrower than its own.
    np.testing.assert_allclose(joints.lower, (-0.4, -math.pi, -1.0))
    np.testing.assert_allclose(joints.upper, (0.4, math.pi, 0.5))
    assert joints.speed[1] == 1.0
    assert any(
        "'turn' has no speed in its file; it gets 1 rad/s" in note for note in robot.joint_notes
    )


@pytest.mark.parametrize("seed", range(12))
def test_no_posture_inside_the_limits_takes_any_joint_beyond_its_own(
    tmp_path: Path, seed: int
) -> None:
    robot = load(saved(tmp_path, tree(seed, 6 + seed)))
    joints, random = robot.joint_group, np.random.default_rng(seed)
    for fraction in (0.0, 1.0, random.uniform(size=joints.n)):
        values = robot.joint_values(joints.lower + fraction * (joints.upper - joints.lower), 0.0)
        for name, value in values.items():
            joint = robot.joints[name]
            assert joint.lower - 1e-12 <= value <= joint.upper + 1e-12


def test_a_path_length_is_that_of_the_link_that_moves_farthest() -> None:
    robot = load(GANTRY)
    q = np.zeros(3)
    assert robot.distance(q, q) == 0.0
    assert robot.distance(q, np.array((0.25, 0.0, 0.0))) == pytest.approx(0.25)


LOCKED = """<robot name="r"><link name="a"/><link name="b"/>
<joint name="j" type="prismatic"><parent link="a"/><child link="b"/><axis xyz="1 0 0"/>
<limit lower="0.1" upper="0.1" velocity="1" effort="1"/></joint></robot>"""


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('<robot name="r"><link name="a"/></robot>', "r has no joint that can be driven"),
        (LOCKED, "'j' of r cannot be driven.*range is 0.1 to 0.1"),
    ],
)
def test_undrivable_robot_is_reported(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(RobotDescriptionError, match=said):
        assert load(saved(tmp_path, text)).joint_group


@pytest.mark.parametrize("seed", range(4))
def test_drivable_mechanisms_can_be_exported(tmp_path: Path, seed: int) -> None:
    path = saved(tmp_path, tree(seed))
    robot = load(path)
    values = robot.joint_values(robot.joint_group.upper, 0.0)
    exports = (
        vrml_files(robot, world_of(robot, values)),
        c_files(robot, values),
        glb_files(robot, values),
        package_files(path),
    )
    for files in exports:
        assert files
        assert all(files.values())
    world = read_world(exports[0]["tree.wrl"].decode())
    assert set(robot.joint_group.names) <= set(world.named())
