"""A cup in the hand of the arm, swung half round and stopped on the path."""

from __future__ import annotations

import math

import numpy as np
import pytest

from katana450.arm.control.commands.commands import Command, Joint, Stop
from katana450.arm.control.session.session import Session
from katana450.arm.robot.arm_reader import MountedArm
from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.forward import forward
from katana450.maths.water.flow import VesselMove, Water, WaterFlow

DT = 0.01
LEVEL = np.deg2rad((-50.0, -70.0, 100.0, -30.0, 0.0))
"""Joint angles [rad] with the tool level, half a metre from axis 1."""


def swung(arm: MountedArm, stop_after: float) -> tuple[list[FloatArray], FloatArray]:
    """Return poses and accelerations (n, 3) of an upright cup at the tool, from rest to rest."""
    session = Session(arm, LEVEL)
    state = session.begin(LEVEL, 0.0, 0.0)
    poses = []
    for k in range(300):
        commands: list[Command] = [Joint(1, math.radians(50.0))] if k == 0 else []
        if k == round(stop_after / DT):
            commands = [Stop()]
        state = session.step(state, commands, k * DT)
        state = session.observe(state, state.setpoint, state.gripper)
        tool = arm.T_base_shoulder @ forward(arm.chain, state.setpoint)
        turn = so3.exp((0.0, 0.0, float(state.setpoint[0])))
        poses.append(se3.from_rotation_translation(turn, tool[:3, 3] - (0.0, 0.0, 0.05)))
    places = np.array([T[:3, 3] for T in poses])
    accelerations = np.zeros_like(places)
    accelerations[1:-1] = (places[2:] - 2.0 * places[1:-1] + places[:-2]) / DT**2
    return poses, accelerations


def carried_by(
    flow: WaterFlow, volume: float, poses: list[FloatArray], accelerations: FloatArray
) -> tuple[Water, float]:
    """Return the water at the end, and its minimum margin [m] to the rim."""
    water, least = flow.begin(volume, poses[0]), math.inf
    for T, acceleration in zip(poses, accelerations, strict=True):
        water = flow.step(water, {"cup": VesselMove(T, acceleration)}, DT)
        least = min(least, flow.margin_to_rim(water.cup))
    return water, least


@pytest.mark.parametrize("stop_after", [9.0, 0.6], ids=["whole swing", "stopped"])
def test_at_full_speed_the_arm_keeps_the_water_off_the_rim(
    arm: MountedArm, flow: WaterFlow, stop_after: float
) -> None:
    poses, accelerations = swung(arm, stop_after)
    travelled = np.linalg.norm(poses[-1][:3, 3] - poses[0][:3, 3])
    assert travelled > (0.5 if stop_after > 3.0 else 0.1)
    water, least = carried_by(flow, 2e-4, poses, accelerations)
    assert least > 5e-3
    assert water.cup.volume == water.total
    # With a filling that leaves 6 mm, a stop spills.
    if stop_after < 3.0:
        fuller, least = carried_by(flow, 2.3e-4, poses, accelerations)
        assert least < 0.0 < fuller.spilled
