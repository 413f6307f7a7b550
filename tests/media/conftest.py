"""Fixtures: the arm on its table, with the shapes for pictures."""

from __future__ import annotations

from typing import NamedTuple

import pytest

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.session.session import Session
from katana450.arm.control.state.state import State
from katana450.arm.robot.props import load_props
from katana450.arm.robot.robot import Robot
from katana450.assembly.robot_session import describe_robot
from katana450.extensions.media.stage import RenderStage
from katana450.resources import URDF_PATH
from katana450.settings import Settings


class Workshop(NamedTuple):
    """An arm with its session and shapes."""

    robot: Robot
    session: Session
    stage: RenderStage

    @property
    def ready(self) -> State:
        """Return the state in the ready posture with an empty cup."""
        return self.session.begin(self.session.ready, 0.0, 0.0)

    @property
    def filled(self) -> State:
        """Return the same state with 200 ml of water in the cup."""
        return self.session.step(self.ready, [cmd.Fill(200.0)], 0.01)


@pytest.fixture(scope="session")
def workshop() -> Workshop:
    robot, session, _ = describe_robot(Settings(), URDF_PATH, None)
    return Workshop(robot, session, RenderStage(robot, session, load_props()))
