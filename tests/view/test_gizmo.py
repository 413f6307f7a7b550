"""The gizmo has the rings of its arm, and each ring gives the command of its arm."""

from __future__ import annotations

import asyncio
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import viser

from katana450.arm.control.commands.commands import (
    Command,
    EndDrag,
    Orient,
    Position,
    Turn,
    TurnElbow,
)
from katana450.arm.control.lease import Actor
from katana450.assembly.robot_session import find_robot
from katana450.errors import LateError
from katana450.maths.geometry import so3
from katana450.maths.kinematics.forward import forward
from katana450.maths.motion.arm_angle import elbow_points
from katana450.resources import URDF_PATH
from katana450.server.view.cameras import initial_camera
from katana450.server.view.gizmo import MIN_SCALE, SIZE, Gizmo
from katana450.server.view.gizmo import RINGS as RING_RATIO
from katana450.server.viser_bridge.presets import CAMERA_POSES, Preset
from katana450.settings import Settings
from tests.general_arms.chain_urdf import chain_urdf
from tests.general_arms.published_arms import PANDA, PINCHERX_100, UR5E
from tests.view.gestures import RecordedGestures

OTHERS = {"UR5e": UR5E, "PincherX-100": PINCHERX_100, "Panda": PANDA}
RINGS = {
    **{"katana": ("pitch", "roll"), "UR5e": ("turn",), "PincherX-100": ("turn",)},
    "Panda": ("turn", "elbow"),
}


@dataclass
class Drag:
    """An event of viser."""

    target: Any
    phase: str
    client_id: int = 1


class LateGestures(RecordedGestures):
    """Gestures that are refused while they are late."""

    late = False

    def submit(self, command: Command, actor: Actor) -> int:
        if self.late:
            raise LateError("late")
        return super().submit(command, actor)


def test_handle_has_the_size_of_the_robot(server: viser.ViserServer) -> None:
    robot, session, _ = find_robot(Settings(), URDF_PATH, None)
    arm, state = robot.require_arm(), session.begin(session.ready, 0.0, 0.0)
    for scale, length in ((0.6, MIN_SCALE * SIZE), (0.9, 0.9 * SIZE), (1.5, 1.5 * SIZE)):
        gizmo = Gizmo(server, arm, RecordedGestures(), lambda: state, scale)
        assert gizmo._move.scale == pytest.approx(length)
        assert gizmo._rings["roll"].scale == pytest.approx(RING_RATIO * length)


def test_end_of_a_drag_repeats_a_sample_that_was_refused(server: viser.ViserServer) -> None:
    robot, session, _ = find_robot(Settings(), URDF_PATH, None)
    state, gestures = session.begin(session.ready, 0.0, 0.0), LateGestures()
    gizmo = Gizmo(server, robot.require_arm(), gestures, lambda: state)
    for phase, place, late in (
        ("start", 0.0, False),
        ("update", 0.1, False),
        ("update", 0.2, True),
    ):
        gestures.late = late
        gizmo._move.position = (place, 0.0, 0.0)
        asyncio.run(gizmo._moved(Drag(gizmo._move, phase)))  # type: ignore[arg-type]
    gestures.late = False
    asyncio.run(gizmo._moved(Drag(gizmo._move, "end")))  # type: ignore[arg-type]
    assert [type(command) for command in gestures.commands] == [Position, Position, EndDrag]


@pytest.mark.parametrize("name", RINGS)
def test_rings_turn_the_tool_of_their_arm(
    name: str, server: viser.ViserServer, tmp_path: Path
) -> None:
    path = URDF_PATH
    if name in OTHERS:
        path = tmp_path / "arm.urdf"
        path.write_text(chain_urdf(name, OTHERS[name]), encoding="utf-8")
    robot, session, _ = find_robot(Settings(), path, None)
    arm, state = robot.require_arm(), session.begin(session.ready, 0.0, 0.0)
    chain, gestures = arm.chain_to(state.tool), RecordedGestures()
    gizmo = Gizmo(server, arm, gestures, lambda: state)
    T = forward(chain, state.goal)
    gizmo.aim(state, arm.T_base_shoulder @ T)
    gizmo.follow()
    assert tuple(gizmo._rings) == RINGS[name]
    look = initial_camera(robot)
    eye = np.array(CAMERA_POSES[Preset.FREE].position) if look is None else look.eye
    ray = gizmo._move.position - eye
    for ring, handle in gizmo._rings.items():
        # The first camera of a page sees each ring as an ellipse, not as a line.
        axes = {"pitch": [1], "roll": [0]}.get(ring, [1] if name == "PincherX-100" else [0, 1, 2])
        widths = np.abs(ray @ so3.from_quaternion(handle.wxyz)) / np.linalg.norm(ray)
        assert ring == "elbow" or (widths[axes] > 0.25).all()
        turned = gizmo._turned if ring == "turn" else partial(gizmo._ring_turned, ring)
        about_x = ring in ("roll", "elbow")
        start, axis = np.array(handle.wxyz), (1.0, 0.0, 0.0) if about_x else (0.0, 1.0, 0.0)
        asyncio.run(turned(Drag(handle, "start")))  # type: ignore[arg-type]
        handle.wxyz = so3.to_quaternion(so3.from_quaternion(start) @ so3.exp(0.1 * np.array(axis)))
        asyncio.run(turned(Drag(handle, "end")))  # type: ignore[arg-type]
        if ring == "elbow":
            # Its arc passes the elbow, on the side of the line from shoulder to wrist where it is.
            points = np.array(elbow_points(chain, state.goal)) @ arm.T_base_shoulder[:3, :3].T
            _, elbow, wrist = points - points[0]
            out = so3.from_quaternion(start) @ np.array((0.0, 1.0, 1.0))
            assert out @ elbow > 0.0
            assert abs(out @ wrist) < 1e-9
            (turn,) = (act for act in gestures.commands if isinstance(act, TurnElbow))
            assert turn.by == pytest.approx(0.1, abs=1e-9)
            continue
        command, end = gestures.commands[-2:]
        assert isinstance(end, EndDrag)
        assert isinstance(command, Turn if gizmo.is_five_axis else Orient)
        if isinstance(command, Orient):
            assert so3.angle(command.R, T[:3, :3]) == pytest.approx(0.1, abs=1e-9)
        else:
            now = arm.kinematics.target_at(state.goal)
            turns = {"pitch": (0.1, 0.0), "roll": (0.0, 0.1)}[ring]
            after = (command.pitch - now.pitch, command.roll - now.roll)
            assert after == pytest.approx(turns, abs=1e-9)
