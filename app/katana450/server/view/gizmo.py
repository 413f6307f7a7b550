"""The handle at the tool that a person drags. It has the degrees of freedom that the arm has.

Arrows move the tool point, and rings turn the tool. Those of five axes are pitch about the
horizontal that is square to the arm's plane, and roll about the tool's own axis. There is no third
ring, because the position determines the sideways direction of the tool. Other arms have three
rings in the frame of the tool, and an arm of four axes has one, which pitches its tool. A ring at
the elbow of seven axes turns it about the line from shoulder to wrist, while the tool rests.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import partial

import numpy as np
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
from katana450.arm.control.state.state import State
from katana450.arm.robot.arm_reader import MountedArm
from katana450.errors import KatanaError
from katana450.maths.geometry import so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.forward import forward, joint_frames
from katana450.maths.kinematics.tool import ToolTarget, pitch_and_roll, pitched_frame
from katana450.maths.motion.arm_angle import elbow_points
from katana450.server.view.controls import GestureGate
from katana450.server.viser_bridge.guard import WORKSPACE
from katana450.server.viser_bridge.posing import Point, Quaternion, place, turn

SIZE = 0.13
"""Length [m] of the arrows: they are clear of the gripper and stay within the picture.

Those of a larger or smaller robot are so too, because it is seen from farther away or nearer.
"""

MIN_SCALE = 0.8
"""Least size of the handle as a multiple of the Katana450's: a finger must find it."""

RINGS = 1.6
"""Ratio of ring size to arrow size: the arcs end just outside the arrow heads."""

RADIUS = 0.65
"""Ratio of the radius of a ring to its size."""

ELBOW_CLEARANCE = 0.06
"""[m] Distance of the ring from the elbow, outside of its link."""

ELBOW_STEP = 0.02
"""[m] Change of the size of that ring that is sent."""

PITCHING = 4
"""Number of axes of an arm that can only pitch its tool."""

DISTANCE_WORTH_SENDING = 1e-6
"""Smallest change of position [m] that is sent."""

TURN_WORTH_SENDING = 1e-7
"""Smallest change of a number of a quaternion that is sent."""


@dataclass
class _Turn:
    """A drag of a ring: rotation, pitch and roll [rad] at its start, and angles so far [rad]."""

    R_start: FloatArray
    pitch: float = 0.0
    roll: float = 0.0
    turned: float = 0.0
    sent: float = 0.0


@dataclass(frozen=True)
class Aim:
    """The poses of the gizmo's parts while they are not held, in the types of viser.

    Attributes:
        point: the tool point.
        rings: the rotation of each ring.
        elbow: centre and size [m] of the ring at the elbow; None without one.
    """

    point: Point
    rings: Mapping[str, Quaternion]
    elbow: tuple[Point, float] | None = None


class Gizmo:
    """The gizmo: sends the pose to which it is dragged, and follows the goal while not held."""

    def __init__(
        self,
        server: viser.ViserServer,
        arm: MountedArm,
        gestures: GestureGate,
        current: Callable[[], State],
        scale: float = 1.0,
    ) -> None:
        """Add the gizmo to the scene.

        Args:
            server: viser's server.
            arm: The arm of the gizmo.
            gestures: The path of gestures to the arm.
            current: Returns the newest state.
            scale: The size of the robot as a multiple of that of the Katana450.
        """
        self._size = SIZE * max(scale, MIN_SCALE)
        self._arm = arm
        self._gestures = gestures
        self._current = current
        self._held: dict[str, Actor] = {}
        self._turns: dict[str, _Turn] = {}
        self._sent: tuple[float, ...] = ()
        self._aim = Aim((0.0, 0.0, 0.0), {})
        # The rotation of the tool in the frame of the rings while they are held.
        self._R_ring_tool = np.eye(3)
        bounds = ((-WORKSPACE, WORKSPACE),) * 3
        self._move = server.scene.add_transform_controls(
            "/target/move",
            scale=self._size,
            line_width=3.5,
            disable_rotations=True,
            disable_sliders=True,
            depth_test=False,
            translation_limits=bounds,
        )
        self._move.on_update(self._moved)
        # A ring is drawn where both axes that span it are active.
        if self.is_five_axis:
            self._rings = {
                "pitch": self._ring(server, "/target/move/pitch", (True, False, True)),
                "roll": self._ring(server, "/target/move/roll", (False, True, True)),
            }
            self._rings["pitch"].on_update(partial(self._ring_turned, "pitch"))
            self._rings["roll"].on_update(partial(self._ring_turned, "roll"))
        else:
            several = arm.chain.n != PITCHING
            self._rings = {"turn": self._ring(server, "/target/move/turn", (True, several, True))}
            self._rings["turn"].on_update(self._turned)
        if arm.kinematics.turns_elbow:
            self._rings["elbow"] = self._ring(server, "/target/elbow", (False, True, True))
            self._rings["elbow"].on_update(partial(self._ring_turned, "elbow"))

    @property
    def is_five_axis(self) -> bool:
        """True if the rings are pitch and roll."""
        return self._arm.kinematics.turn is Turn

    def _ring(
        self, server: viser.ViserServer, name: str, axes: tuple[bool, bool, bool]
    ) -> viser.TransformControlsHandle:
        return server.scene.add_transform_controls(
            name,
            scale=RINGS * self._size,
            line_width=5.0,
            active_axes=axes,
            disable_axes=True,
            disable_sliders=True,
            depth_test=False,
        )

    def aim(self, state: State, T: FloatArray) -> None:
        """Store the pose of the goal of ``state``; its ``T`` (4, 4) is in the base frame."""
        x, y, z = T[:3, 3].tolist()
        frame = self._ring_frame(state)
        rings = {"turn": quaternion(frame)}
        if self.is_five_axis:
            _, roll = pitch_and_roll(self._arm.chain_to(state.tool), state.goal)
            rings = {"pitch": rings["turn"], "roll": quaternion(frame @ so3.rotation_x(roll))}
        self._aim = Aim((x, y, z), rings)
        if "elbow" in self._rings:
            rings["elbow"], elbow = self._elbow_ring(state)
            self._aim = Aim((x, y, z), rings, elbow)

    def _elbow_ring(self, state: State) -> tuple[Quaternion, tuple[Point, float]]:
        """Return rotation, centre and size [m] of the ring whose arc passes outside the elbow."""
        T = self._arm.T_base_shoulder
        chain = self._arm.chain_to(state.tool)
        points = np.array(elbow_points(chain, state.goal)) @ T[:3, :3].T + T[:3, 3]
        shoulder, elbow, wrist = points
        u = (wrist - shoulder) / max(float(np.linalg.norm(wrist - shoulder)), ELBOW_STEP)
        centre = shoulder + float((elbow - shoulder) @ u) * u
        # The axis of a bent elbow is square to the plane of the arm.
        axis = T[:3, :3] @ joint_frames(chain, state.goal)[3][:3, :3] @ chain.S[:3, 3]
        out = np.cross(u, axis) * np.sign(np.cross(u, axis) @ (elbow - centre) or 1.0)
        out /= max(float(np.linalg.norm(out)), ELBOW_STEP)
        y, z = (math.sqrt(0.5) * (out + side * np.cross(u, out)) for side in (-1.0, 1.0))
        size = (float(np.linalg.norm(elbow - centre)) + ELBOW_CLEARANCE) / RADIUS
        a, b, c = centre.tolist()
        return quaternion(np.column_stack((u, y, z))), ((a, b, c), size)

    def _ring_frame(self, state: State) -> FloatArray:
        """Return the frame of the rings (3, 3) in the base frame.

        Of four and five axes its y axis is that about which the tool pitches.
        """
        chain = self._arm.chain_to(state.tool)
        if self.is_five_axis:
            R = pitched_frame(chain, state.goal)
        else:
            R = forward(chain, state.goal)[:3, :3]
            if chain.n == PITCHING:
                y = joint_frames(chain, state.goal)[3][:3, :3] @ chain.S[:3, 3]
                x = np.cross(y, chain.axes[:, 0])
                x = x / np.linalg.norm(x) if x.any() else R[:, int(np.abs(y @ R).argmin())]
                R = np.column_stack((x, y, np.cross(x, y)))
        return np.asarray(self._arm.T_base_shoulder[:3, :3] @ R)

    def follow(self) -> None:
        """Move the parts that are not held to the goal."""
        aim = self._aim
        apart = _apart(self._move.position, aim.point) > DISTANCE_WORTH_SENDING
        if apart and not any(map(self._holds, ("move", *self._rings))):
            place(self._move, aim.point)
        for name, wxyz in aim.rings.items():
            if not self._holds(name):
                turn_ring(self._rings[name], wxyz)
        if aim.elbow is not None and not self._holds("elbow"):
            ring, (centre, size) = self._rings["elbow"], aim.elbow
            if _apart(ring.position, centre) > DISTANCE_WORTH_SENDING:
                place(ring, centre)
            if abs(ring.scale - size) > ELBOW_STEP:
                ring.scale = size

    async def _moved(self, event: viser.TransformControlsEvent) -> None:
        actor = self._gestures.actor(event.client_id)
        if event.phase == "start":
            self._held["move"] = actor
            return
        if self._held.get("move") != actor:
            return
        if event.phase == "end":
            del self._held["move"]
        p = np.asarray(event.target.position, dtype=float) - self._arm.T_base_shoulder[:3, 3]
        command = Position(p @ self._arm.T_base_shoulder[:3, :3])
        self._submit(event, actor, command, tuple(event.target.position.tolist()))

    def _submit(
        self,
        event: viser.TransformControlsEvent,
        actor: Actor,
        command: Command,
        place: tuple[float, ...],
    ) -> None:
        """Submit ``command`` of a drag to ``place``, and the end of the drag."""
        # A hand that lets go without a motion gives no new target: the arm may have another one.
        again = event.phase == "end" and place == self._sent
        self._sent = ()
        # A drag sends 20 messages a second: the next one repeats the request or shows the refusal.
        with suppress(KatanaError):
            if not again:
                self._gestures.submit(command, actor)
            if event.phase == "end":
                self._gestures.submit(EndDrag(), actor)
            else:
                # A sample that is refused because it is late is repeated at the end.
                self._sent = place

    def _holds(self, part: str) -> bool:
        actor = self._held.get(part)
        return actor is not None and self._gestures.is_current(actor)

    async def _ring_turned(self, ring: str, event: viser.TransformControlsEvent) -> None:
        """Send the turn of a ``ring`` that turns about one axis alone."""
        actor = self._gestures.actor(event.client_id)
        turn = self._turning(event, actor, ring)
        if turn is not None and ring != "elbow":
            pitch, roll = (turn.turned if ring == name else 0.0 for name in ("pitch", "roll"))
            command = Turn(turn.pitch + pitch, turn.roll + roll)
            self._submit(event, actor, command, (command.pitch, command.roll))
        elif turn is not None and turn.turned != turn.sent:
            with suppress(KatanaError):
                self._gestures.submit(TurnElbow(turn.turned - turn.sent), actor)
                turn.sent = turn.turned

    async def _turned(self, event: viser.TransformControlsEvent) -> None:
        actor = self._gestures.actor(event.client_id)
        if event.phase == "start":
            state = self._current()
            T = forward(self._arm.chain_to(state.tool), state.goal)
            R_base_tool = self._arm.T_base_shoulder[:3, :3] @ T[:3, :3]
            self._R_ring_tool = self._ring_frame(state).T @ R_base_tool
            self._held["turn"] = actor
            return
        if self._held.get("turn") != actor:
            return
        if event.phase == "end":
            del self._held["turn"]
        wxyz = np.asarray(event.target.wxyz, dtype=float)
        R = self._arm.T_base_shoulder[:3, :3].T @ so3.from_quaternion(wxyz) @ self._R_ring_tool
        self._submit(event, actor, Orient(R), tuple(wxyz.tolist()))

    def _turning(
        self, event: viser.TransformControlsEvent, actor: Actor, ring: str
    ) -> _Turn | None:
        """Update the turn of a ring's drag and return it; None at its start or without a drag.

        The angle is counted past half a circle.
        """
        R = so3.from_quaternion(np.asarray(event.target.wxyz, dtype=float))
        if event.phase == "start":
            state = self._current()
            target = state.target
            if not self.is_five_axis:
                pitch = roll = 0.0
            elif isinstance(target, ToolTarget) and target.is_pitched:
                pitch, roll = target.pitch, target.roll
            else:
                chain = self._arm.chain_to(state.tool)
                pitch, roll = pitch_and_roll(chain, state.goal)
            self._turns[ring] = _Turn(R, pitch, roll)
            self._held[ring] = actor
            return None
        turn = self._turns.get(ring)
        if turn is None or self._held.get(ring) != actor:
            return None
        D = turn.R_start.T @ R
        angle = (
            math.atan2(D[0, 2] - D[2, 0], D[0, 0] + D[2, 2])
            if ring == "pitch"
            else math.atan2(D[2, 1] - D[1, 2], D[1, 1] + D[2, 2])
        )
        turn.turned += math.remainder(angle - turn.turned, math.tau)
        if event.phase == "end":
            del self._held[ring]
            del self._turns[ring]
        return turn


def turn_ring(handle: viser.TransformControlsHandle, wxyz: Quaternion) -> None:
    """Turn a ring that is not turned so already."""
    if _apart(handle.wxyz, wxyz) > TURN_WORTH_SENDING:
        turn(handle, wxyz)


def _apart(shown: FloatArray, new: tuple[float, ...]) -> float:
    """Return the largest difference between two numbers at the same place."""
    numbers: list[float] = shown.tolist()
    return max(abs(a - b) for a, b in zip(numbers, new, strict=True))


def quaternion(R: FloatArray) -> Quaternion:
    """Return the rotation `R` (3, 3) in the type of viser."""
    w, x, y, z = so3.to_quaternion(R).tolist()
    return w, x, y, z
