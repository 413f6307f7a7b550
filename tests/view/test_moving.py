"""Moving nodes of the scene have the poses that the joint values give."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import viser

from katana450.arm.control.branch_options import BranchOption
from katana450.arm.control.commands import Command, Joints
from katana450.arm.control.session import Session
from katana450.arm.control.state import State
from katana450.arm.robot.robot import Robot
from katana450.maths.geometry import so3
from katana450.server.view.branches import INTERVAL, BranchList
from katana450.server.view.controls import Clickable
from katana450.server.view.scene import FrameTree
from tests.viser_bridge.internals import nodes


def test_every_link_turns_with_its_joint(robot: Robot, server: viser.ViserServer) -> None:
    tree = FrameTree(server, "/tree", robot)
    node = nodes(server)
    random = np.random.default_rng(450)
    for _ in range(20):
        angles = robot.joint_values(random.uniform(-4.0, 4.0, 5), random.uniform(-1.0, 1.0))
        tree.move(angles)
        for link in robot.links:
            R = link.T_parent_link[:3, :3]
            if link.joint is not None:
                R = R @ so3.exp(link.joint.axis * angles[link.joint.name])
            shown = so3.from_quaternion(node[tree.path[link.name]].wxyz)
            np.testing.assert_allclose(shown, R, atol=1e-12)


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
    branches = BranchList(server, robot, find, listen, rest)
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
