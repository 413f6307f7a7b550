"""Moving nodes of the scene have the poses that the joint values give."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import viser

from katana450.arm.control.commands.commands import Command, Joints
from katana450.arm.control.session.session import Session
from katana450.arm.control.session.tool_targets import BranchOption
from katana450.arm.control.state.state import State
from katana450.arm.robot.robot import Robot
from katana450.server.view.controls import Clickable
from katana450.server.view.panel import INTERVAL, BranchList


def test_branches_are_computed_once_a_second_while_the_arm_moves(
    robot: Robot, server: viser.ViserServer, session: Session
) -> None:
    looked: list[State] = []

    def find(state: State) -> tuple[BranchOption, ...]:
        looked.append(state)
        return session.choices(state)

    def listen(_handle: Clickable, _say: Callable[[], Command]) -> None:
        return

    rest = session.begin(session.ready, 0.0, 0.0)
    names = robot.require_arm().kinematics.branches
    branches = BranchList(server.gui, names, find, listen, rest)
    state = session.step(rest, [Joints(session.ready + 0.3)], 0.01)
    times = np.arange(0.0, 3.0 * INTERVAL, 0.1)
    for t in times:
        state = replace(state, t=t)
        assert state.moving
        branches.follow(state, t)
    assert len(looked) == 2
    resting = replace(rest, t=9.0)
    branches.follow(resting, times[-1])
    branches.follow(resting, times[-1])
    assert looked[2:] == [resting]
