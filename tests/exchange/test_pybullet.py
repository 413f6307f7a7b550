"""The exported ROS package in PyBullet, as it is shipped: the same robot."""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path

import numpy as np
import pytest

from katana450.arm.robot.robot import Robot
from tests.exchange.conftest import POSES
from tests.exchange.tools import PYBULLET, needs_package, run

MASS = 4.8
"""[kg] Mass of the robot without the link that stands on the table."""


@pytest.fixture(scope="module")
def urdf(ros_package: Path) -> Path:
    return ros_package / "urdf" / "katana450.urdf"


LOAD = """
import json, sys
import pybullet as bullet
bullet.connect(bullet.DIRECT)
robot = bullet.loadURDF(sys.argv[1], useFixedBase=True, flags=bullet.URDF_USE_SELF_COLLISION)
joints = range(bullet.getNumJoints(robot))
names = [bullet.getJointInfo(robot, k)[12].decode() for k in joints]
turning = [k for k in joints if bullet.getJointInfo(robot, k)[2] == bullet.JOINT_REVOLUTE]
for k, value in zip(turning, json.loads(sys.argv[2]), strict=True):
    bullet.resetJointState(robot, k, value)
visuals = bullet.getVisualShapeData(robot)
places = {names[k]: bullet.getLinkState(robot, k, computeForwardKinematics=1)[4] for k in joints}
bullet.resetSimulation()
robot = bullet.loadURDF(sys.argv[1], useFixedBase=True, flags=bullet.URDF_USE_SELF_COLLISION)
bullet.performCollisionDetection()
print("\\n" + json.dumps({
    "places": places,
    "colours": [[names[v[1]] if v[1] >= 0 else "base_link", *v[7]] for v in visuals],
    "mass": sum(bullet.getDynamicsInfo(robot, k)[0] for k in joints),
    "contacts": [c[3:5] for c in bullet.getContactPoints(robot, robot)],
}))
"""


@needs_package(PYBULLET)
def test_pybullet_loads_the_same_robot(
    tmp_path: Path, urdf: Path, katana: Robot, monkeypatch: pytest.MonkeyPatch
) -> None:
    pose = (0.4, -1.187, 1.484, 0.14, 0.5, 0.2, 0.2)
    monkeypatch.setenv("PYTHONPATH", os.fspath(PYBULLET.folder))
    # Another folder, so that no name is found by the present folder.
    printed = run(sys.executable, "-c", LOAD, urdf, json.dumps(pose), folder=tmp_path)
    found = json.loads(printed.splitlines()[-1])
    frames = katana.frames(katana.values(POSES[1]))
    assert set(found["places"]) == {link.name for link in katana.links[1:]}
    for link, place in found["places"].items():
        np.testing.assert_allclose(place, frames[link][:3, 3], atol=1e-6, err_msg=link)
    assert found["mass"] == pytest.approx(MASS, abs=1e-9)
    assert found["contacts"] == []
    shown = [
        [link.name, *(round(part, 4) for part in shape.material.colour)]
        for link in katana.links
        for shape in link.shapes
    ]
    colours = [[name, *np.round(rgba[:3], 4).tolist()] for name, *rgba in found["colours"]]
    assert sorted(colours) == sorted(shown)
