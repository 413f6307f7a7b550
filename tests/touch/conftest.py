"""The arm of the project with the cup between its fingers."""

from __future__ import annotations

import numpy as np
import pytest

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.session.session import Session
from katana450.arm.control.state.state import State
from katana450.arm.robot.arm_reader import MountedArm
from katana450.assembly.robot_session import DescribedRobot, describe_robot
from katana450.resources import URDF_PATH
from katana450.settings import Settings
from tests.control.test_grip import OPEN, around_cup
from tests.ticks import rested


@pytest.fixture(scope="session")
def described() -> DescribedRobot:
    return describe_robot(Settings(), URDF_PATH, None)


@pytest.fixture(scope="session")
def session(described: DescribedRobot) -> Session:
    return described.session


@pytest.fixture(scope="session")
def arm(described: DescribedRobot) -> MountedArm:
    return described.robot.require_arm()


@pytest.fixture(scope="session")
def around(session: Session, arm: MountedArm) -> State:
    """The state with open fingers around the cup, on the table."""
    state = around_cup(session, arm)
    assert np.isclose(state.gripper, OPEN)
    return state


@pytest.fixture(scope="session")
def holding(session: Session, around: State) -> State:
    """The state after the fingers were closed with all their force."""
    return rested(session, around, cmd.Gripper(-0.44))
