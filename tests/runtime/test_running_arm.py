"""The arm of the arm's process: its end."""

from __future__ import annotations

import multiprocessing

import numpy as np
import pytest

from katana450.arm.control import commands as cmd
from katana450.arm.control.session import Session
from katana450.arm.robot.robot import Robot
from katana450.arm.runtime.arm_listener import FRONT, Greeting
from katana450.arm.runtime.front_end import FrontEnd
from katana450.assembly import running_arm
from katana450.assembly.robot_session import DescribedRobot
from katana450.assembly.running_arm import RunningArm
from katana450.settings import Settings


def test_arm_ends_stopped_and_at_rest_although_a_command_has_just_arrived(
    robot: Robot, session: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    # The priority of this process stays.
    monkeypatch.setattr(running_arm, "raise_priority", lambda: None)
    arm = RunningArm(Settings(), DescribedRobot(robot, session, ()))
    arm.start()
    ours, theirs = multiprocessing.Pipe()
    arm.attach(ours, Greeting(FRONT))
    front = FrontEnd(theirs, session.check)
    front.start()
    front.deliver(cmd.SetJoint(0, 2.0))
    arm.stop()
    state = arm.state_publisher.snapshot.state
    assert (state.stopped is not None, state.moving, arm.running) == (True, False, False)
    np.testing.assert_array_equal(state.q, state.setpoint)
    assert front.cut.wait(5.0)
    # The front end is disconnected, and sees no stop that nobody pressed.
    assert front.state_publisher.snapshot.state.stopped is None
    theirs.close()
