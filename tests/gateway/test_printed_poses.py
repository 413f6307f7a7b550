"""Test poses with rounded numbers, as programs print them, on a real server."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from msgspec import structs

from katana450.arm.control.scene_objects import Shape
from katana450.arm.robot.mounted_arm import MountedArm
from katana450.client import Client, RefusedError
from katana450.maths.geometry import so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.forward import forward
from katana450.server.api import answers, requests

THERE = np.deg2rad((20.0, -60.0, 80.0, 20.0, -30.0))


def test_printed_pose_is_accepted_and_its_rounding_reported(
    program: Client, arm: MountedArm
) -> None:
    for decimals in (6, 5, 4):
        check_printed(program, forward(arm.chain, THERE), decimals)


def check_printed(program: Client, T: FloatArray, decimals: int) -> None:
    rounding = 0.5 * 10.0**-decimals
    printed = T.round(decimals).tolist()
    accepted = program.ask(requests.Pose(T=printed))
    assert isinstance(accepted, answers.Done)
    assert accepted.rotation_misfit is not None
    assert 1e-3 * rounding < accepted.rotation_misfit < 4.0 * rounding
    there = program.go(requests.Pose(T=printed))
    np.testing.assert_allclose(np.array(there.T), T, rtol=0, atol=10.0 * rounding)


def test_object_is_placed_at_a_printed_pose(program: Client) -> None:
    T = np.eye(4)
    T[:3, :3] = so3.from_rpy(0.0, 0.0, 0.7)
    T[:3, 3] = 0.3, -0.3, 0.0
    printed: Any = T.round(4).tolist()
    placed = program.ask(requests.Place(name="block", shape=Shape.BOX, size=[0.02] * 3, T=printed))
    assert isinstance(placed, answers.Done)
    assert placed.rotation_misfit is not None
    assert placed.rotation_misfit > 1e-6
    program.ask(requests.Remove(name="block"))


def test_skewed_pose_is_refused_with_the_error(program: Client) -> None:
    skewed = ((1.0, 2e-3, 0.0, 0.3), (0.0, 1.0, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0), (0, 0, 0, 1.0))
    with pytest.raises(RefusedError, match=r"off orthonormal by 0\.002 \(allowed: 1e-03\)"):
        program.ask(requests.Pose(T=skewed))


def test_object_is_placed_near_a_point_of_the_table(program: Client) -> None:
    ball = requests.Place(name="near", shape=Shape.SPHERE, size=[0.02], can_be_held=True)
    program.ask(structs.replace(ball, near=(0.1, 0.5)))
    (found,) = (each for each in program.query(answers.Objects).objects if each.name == "near")
    np.testing.assert_allclose(np.array(found.T)[:3, 3], (0.1, 0.5, 0.0), rtol=0, atol=1e-9)
    program.ask(requests.Remove(name="near"))
    with pytest.raises(RefusedError, match="nothing carries it there"):
        program.ask(structs.replace(ball, near=(1.3, 1.3)))
