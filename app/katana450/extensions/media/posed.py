"""A robot at rest at a pose, for pictures."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from katana450.arm.control.session.session import Session
from katana450.arm.control.state.state import State
from katana450.arm.robot.robot import Robot
from katana450.assembly.robot_session import find_robot
from katana450.settings import Settings


def posed(pose: Sequence[float], urdf: Path) -> tuple[Robot, Session, State]:
    """Return the robot of ``urdf``, its rules, and its state at rest at ``pose``.

    ``pose``: values of the driven joints [rad, m]; its ready posture without any.
    """
    robot, session, notes = find_robot(Settings(), urdf, None)
    for note in notes:
        print(f"katana450: {note}", file=sys.stderr)
    if pose:
        return robot, session, _standing(robot, session, robot.values(pose))
    gripper = 0.0 if session.arm is None else session.arm.gripper.clamp(0.0)
    return robot, session, session.begin(session.ready, gripper, 0.0)


def _standing(robot: Robot, session: Session, values: dict[str, float]) -> State:
    names = robot.driven if robot.arm is None else robot.arm.chain.names
    q = np.array([values[name] for name in names])
    fingers = {} if robot.arm is None else robot.arm.fingers
    driven = [name for name, follows in fingers.items() if follows == (1.0, 0.0)]
    return session.begin(q, values[driven[0]] if driven else 0.0, 0.0)
