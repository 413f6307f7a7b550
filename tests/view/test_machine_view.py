"""A mechanism without a tool in viser's scene, and its panel."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import viser

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.session.session import Session
from katana450.arm.control.state.state import State
from katana450.arm.robot.loader import load
from katana450.arm.robot.object_meshes import Meshes
from katana450.arm.robot.robot import Robot
from katana450.arm.runtime.pipes.state_publisher import LoopTiming, Snapshot, StatePublisher
from katana450.extension import provided
from katana450.extensions.bodies.robot_world import robot_world
from katana450.extensions.objects.handles import HandlesLayer
from katana450.extensions.recording.playback.drawing import CONTEXTS, RunDrawing
from katana450.extensions.recording.playback.rows import RecordedMoment
from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.server.service.hub import Hub
from katana450.server.view.layer import FolderContext, PanelFolder
from katana450.server.view.panel import Panel
from katana450.server.view.readout import joint_page
from katana450.server.view.scene import ArmNodes
from katana450.server.view.view import View
from katana450.server.viser_bridge.guard import PERSONAL
from tests.exchange.trees import tree
from tests.recording.recorded import state_message
from tests.robot.hands import column, hand, rail
from tests.robot.on_the_table import block
from tests.view.gestures import RecordedGestures
from tests.viser_bridge import internals


@pytest.fixture
def robot(tmp_path: Path) -> Robot:
    path = tmp_path / "tree.urdf"
    path.write_text(tree(3, 10))
    return replace(load(path), why="It is <b>no</b> arm.")


def standing(robot: Robot) -> State:
    joints = robot.joint_group
    session = Session(joints, joints.ready, travel=robot.distance)
    return session.begin(session.ready, 0.0, 0.0)


def shown(server: viser.ViserServer, path: str) -> FloatArray:
    """Return the pose (4, 4) of a node in the world, as in the messages to a browser."""
    T, name = np.eye(4), ""
    for part in path.split("/")[1:]:
        name += f"/{part}"
        node: Any = internals.nodes(server)[name]
        T = T @ se3.from_rotation_translation(so3.from_quaternion(node.wxyz), node.position)
    return T


def test_every_link_is_shown_in_its_pose(server: viser.ViserServer, robot: Robot) -> None:
    nodes = ArmNodes(server, robot)
    joints, random = robot.joint_group, np.random.default_rng(1)
    for _ in range(3):
        values = robot.joint_values(random.uniform(joints.lower, joints.upper), 0.0)
        nodes.move(values)
        for name, T in robot.frames(values).items():
            np.testing.assert_allclose(shown(server, nodes.path[name]), T, rtol=0, atol=1e-9)


def test_panel_has_a_slider_per_joint_and_shows_the_reason(
    server: viser.ViserServer, robot: Robot
) -> None:
    state = standing(robot)
    Panel(server, robot, RecordedGestures(), lambda _: (), state)
    controls = {
        handle.label: handle for handle in internals.controls(server)
        if isinstance(handle, viser.GuiSliderHandle)
    }  # fmt: skip
    joints = robot.joint_group
    labels = [f"{axis + 1} {name}" for axis, name in enumerate(joints.names)]
    assert set(controls) == set(labels)
    for axis, label in enumerate(labels):
        unit = 1e3 if joints.slides[axis] else float(np.degrees(1.0))
        assert controls[label].min == pytest.approx(unit * joints.lower[axis], abs=0.01)
        assert controls[label].min >= unit * joints.lower[axis] - 1e-9
        assert controls[label].max <= unit * joints.upper[axis] + 1e-9
        # No joint name can produce a label that the guard treats differently.
        assert label not in PERSONAL
    assert "mm" in joint_page(joints, labels, state)
    assert "Pose by numbers" not in [getattr(h, "label", "") for h in internals.panel(server)]
    texts = [h.content for h in internals.panel(server) if isinstance(h, viser.GuiHtmlHandle)]
    assert any("It is &lt;b&gt;no&lt;/b&gt; arm." in text for text in texts)


def test_objects_and_floor_are_shown_at_the_height_of_the_table(
    server: viser.ViserServer, tmp_path: Path
) -> None:
    path = tmp_path / "column.urdf"
    path.write_text(column(foot=-0.3))
    robot = load(path)
    joints, (world, _, _) = robot.joint_group, robot_world(robot)
    session = Session(joints, joints.ready, world, travel=robot.distance)
    publisher = StatePublisher(
        Snapshot(session.begin(session.ready, 0.0, 0.0), 0), LoopTiming(0.01)
    )
    gestures = RecordedGestures()
    view = View(server, robot, publisher, gestures, lambda: 0, session, (HandlesLayer(),), Meshes())
    view.add_panel(lambda: ())
    floor: Any = internals.nodes(server)["/floor"]
    assert floor.position[2] == pytest.approx(-0.3, abs=1e-3)
    state = session.step(publisher.snapshot.state, (cmd.PlaceObject(block(-0.3)),), 0.0)
    view.show(replace(publisher.snapshot, state=state))
    np.testing.assert_allclose(shown(server, "/objects/block")[:3, 3], (0.2, 0.0, -0.3))
    handle: Any = internals.nodes(server)["/handles/block"]
    assert not handle.visible


def machine_view(
    server: viser.ViserServer, robot: Robot, hub: Hub, options: Namespace
) -> tuple[View, Session]:
    """Return the view with what the extensions add to it, as in a server."""
    joints = robot.joint_group
    session = Session(joints, joints.ready, travel=robot.distance)
    publisher = StatePublisher(
        Snapshot(session.begin(session.ready, 0.0, 0.0), 0), LoopTiming(0.01)
    )
    gestures = RecordedGestures()

    def folders() -> Iterator[PanelFolder]:
        context = FolderContext(
            server,
            robot,
            gestures,
            lambda: publisher.snapshot.state,
            hub,
            options,
        )
        for make in provided("folder"):
            if (folder := make(context)) is not None:
                yield folder

    view = View(server, robot, publisher, gestures, lambda: 0, session, (HandlesLayer(),), Meshes())
    view.add_panel(folders)
    return view, session


def test_extensions_add_what_needs_no_tool(server: viser.ViserServer, robot: Robot) -> None:
    hub = Hub(lambda: 0.0)
    machine_view(server, robot, hub, Namespace())
    # Windows of this server can play back.
    assert CONTEXTS[hub].robot is robot


@pytest.mark.parametrize("text", [tree(3, 10), hand(), rail("visual")])
def test_recorded_joints_are_drawn(server: viser.ViserServer, tmp_path: Path, text: str) -> None:
    path = tmp_path / "robot.urdf"
    path.write_text(text)
    robot = load(path)
    _, session = machine_view(server, robot, Hub(lambda: 0.0), Namespace())
    drawing, names = RunDrawing(server, robot, 0), ArmNodes(server, robot).path
    joints, random = robot.joint_group, np.random.default_rng(2)
    for _ in range(3):
        q = random.uniform(joints.lower, joints.upper)
        row = state_message(q.tolist())
        drawing.show(RecordedMoment(row, (), None), session, None)
        for link, T in robot.frames(robot.joint_values(q, 0.0)).items():
            drawn = shown(server, names[link].replace("/arm", "/playback/0/arm", 1))
            np.testing.assert_allclose(drawn, T, rtol=0, atol=1e-9)
    node: Any = internals.nodes(server)["/playback/0/arm"]
    assert node.visible
    drawing.hide()
    assert not node.visible
