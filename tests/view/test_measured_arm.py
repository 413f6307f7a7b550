"""An arm that is measured: drawn beside its setpoint, and where it is unknown."""

from __future__ import annotations

from argparse import Namespace
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import viser

from katana450.arm.control.session.session import Session
from katana450.arm.control.state.arm_report import ArmMode, ArmReport
from katana450.arm.robot.object_meshes import Meshes
from katana450.arm.robot.props import load_props
from katana450.arm.robot.robot import Robot
from katana450.arm.runtime.pipes.state_publisher import Snapshot
from katana450.extensions.real_arm.options import view_layer
from katana450.maths.geometry import so3
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.server.view.layer import ViewLayer
from katana450.server.view.scenery import Scenery
from katana450.server.view.view import GHOST_FROM, View
from tests.view.gestures import RecordedGestures
from tests.viser_bridge.internals import nodes


def assert_drawn(server: viser.ViserServer, robot: Robot, root: str, q: FloatArray) -> None:
    """Check that the frames below ``root`` are those of the joints ``q`` (5,) [rad]."""
    angles, node = robot.joint_values(q, 0.0), nodes(server)
    for link in robot.links:
        if link.joint is None or link.name.startswith("finger"):
            continue
        R = link.T_parent_link[:3, :3] @ so3.exp(link.joint.axis * angles[link.joint.name])
        (name,) = (
            name for name in node if name.startswith(root) and name.endswith(f"/{link.name}")
        )
        np.testing.assert_allclose(so3.from_quaternion(node[name].wxyz), R, atol=1e-9)


def test_arm_is_drawn_where_it_is_measured_and_its_setpoint_as_a_ghost(
    robot: Robot, server: viser.ViserServer, session: Session
) -> None:
    rest = session.begin(session.ready, 0.0, 0.0)
    measured = frozen(session.ready - 0.1)
    state_publisher: Any = SimpleNamespace(snapshot=Snapshot(rest, 0))
    view = View(
        server,
        robot,
        state_publisher,
        RecordedGestures(),
        lambda: 0,
        session,
        (),
        Meshes(),
    )

    def show(q: FloatArray) -> bool:
        """Show an arm at ``q``; return whether the ghost of its setpoint is visible."""
        state = replace(rest, q=frozen(q))
        view.show(Snapshot(state, 0))
        ghost: Any = nodes(server).get("/setpoint")
        return ghost is not None and bool(ghost.visible)

    assert not show(session.ready)
    assert show(measured)
    assert_drawn(server, robot, "/arm", measured)
    assert_drawn(server, robot, "/setpoint", session.ready)
    # Both follow, and an arm that has reached its setpoint has no ghost.
    assert show(frozen(session.ready - 1.01 * GHOST_FROM))
    assert not show(frozen(session.ready - 0.99 * GHOST_FROM))
    assert_drawn(server, robot, "/arm", session.ready - 0.99 * GHOST_FROM)


def layer(arm: str | None) -> ViewLayer | None:
    return view_layer(Namespace(device=arm))


def test_simulated_arm_has_no_such_layer() -> None:
    assert layer(None) is None


@pytest.mark.parametrize("mode", ArmMode)
def test_links_of_an_arm_are_drawn_while_it_is_connected(
    robot: Robot, server: viser.ViserServer, session: Session, mode: ArmMode
) -> None:
    measured = layer("tcp://arm:5566")
    assert measured is not None
    gestures: Any = SimpleNamespace(listen=lambda *_: None)
    scenery = Scenery(server, robot, session, load_props(), gestures, Meshes(), (measured,))
    rest = session.begin(session.ready, 0.0, 0.0)
    still, unknown = np.zeros(6), mode is ArmMode.DISCONNECTED
    for shown, hidden in ((ArmMode.HOLDING, False), (mode, unknown), (ArmMode.MOVING, False)):
        scenery.show(replace(rest, report=ArmReport(shown, 0.0, still, still)))
        drawn = {name.rpartition("/")[2]: node.visible for name, node in nodes(server).items()}
        assert drawn[robot.links[0].name]
        for link in robot.links:
            if link.joint is not None:
                assert drawn[link.name] == (not hidden)
