"""The handle a person drags: five freedoms, because the arm has five.

Arrows move the tool point. Two rings turn the tool: pitch, about the horizontal that
is square to the arm's plane, and roll, about the tool's own axis. There is no third ring: where
the tool points sideways follows from where it is.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass

import numpy as np
import viser

from katana450.arm.control.actor import Actor
from katana450.arm.control.commands import Command, EndDrag, MoveTool, TurnTool
from katana450.arm.control.state import State, ToolTarget
from katana450.arm.robot.mounted_arm import MountedArm
from katana450.errors import KatanaError
from katana450.maths.geometry import so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.freedoms import pitch_and_roll, pitched_frame
from katana450.server.view.controls import GestureGate
from katana450.server.viser_bridge.guard import WORKSPACE
from katana450.server.viser_bridge.posing import Point, Quaternion, place, turn

SIZE = 0.13
"""[m] Length of the arrows: clear of the gripper, within the picture."""

RINGS = 1.6
"""Size of the rings to that of the arrows: their arcs end just outside the arrow heads."""

DISTANCE_WORTH_SENDING = 1e-6
"""[m]"""

TURN_WORTH_SENDING = 1e-7
"""Of each number of a quaternion."""


PARTS = ("move", "pitch", "roll")
"""What of the handle can be held."""


@dataclass
class _Turn:
    """A ring drag under way: where it began and how far it has gone [rad]."""

    R_start: FloatArray
    pitch: float
    roll: float
    turned: float = 0.0


@dataclass(frozen=True)
class _Aim:
    """Where the parts of the handle are when nobody holds them, as viser has it."""

    point: Point
    pitched: Quaternion
    rolled: Quaternion


class Gizmo:
    """Sends where the handle is dragged; goes where the goal is when nobody holds it."""

    def __init__(
        self,
        server: viser.ViserServer,
        arm: MountedArm,
        gestures: GestureGate,
        current: Callable[[], State],
    ) -> None:
        """``current``: the newest state."""
        self._arm = arm
        self._gestures = gestures
        self._current = current
        self._held: dict[str, Actor] = {}
        self._turns: dict[str, _Turn] = {}
        self._aim = _Aim((0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))
        bounds = ((-WORKSPACE, WORKSPACE),) * 3
        self._move = server.scene.add_transform_controls(
            "/target/move",
            scale=SIZE,
            line_width=3.5,
            disable_rotations=True,
            disable_sliders=True,
            depth_test=False,
            translation_limits=bounds,
        )
        # A ring is drawn where both axes that span it are active.
        self._pitch = self._ring(server, "/target/move/pitch", (True, False, True))
        self._roll = self._ring(server, "/target/move/roll", (False, True, True))
        self._move.on_update(self._moved)
        self._pitch.on_update(self._pitched)
        self._roll.on_update(self._rolled)

    @staticmethod
    def _ring(
        server: viser.ViserServer, name: str, axes: tuple[bool, bool, bool]
    ) -> viser.TransformControlsHandle:
        return server.scene.add_transform_controls(
            name,
            scale=RINGS * SIZE,
            line_width=5.0,
            active_axes=axes,
            disable_axes=True,
            disable_sliders=True,
            depth_test=False,
        )

    def aim(self, state: State, T: FloatArray) -> None:
        """Take in where the goal of ``state`` is, ``T`` (4, 4) in the base frame."""
        chain = self._arm.chain_to(state.tool)
        pitched = self._arm.T_base_shoulder[:3, :3] @ pitched_frame(chain, state.goal)
        _, roll = pitch_and_roll(chain, state.goal)
        x, y, z = T[:3, 3].tolist()
        rolled = pitched @ so3.rotation_x(roll)
        self._aim = _Aim((x, y, z), _quaternion(pitched), _quaternion(rolled))

    def follow(self) -> None:
        """Go where the goal is, but for what is held."""
        aim = self._aim
        apart = _apart(self._move.position, aim.point) > DISTANCE_WORTH_SENDING
        if apart and not any(map(self._holds, PARTS)):
            place(self._move, aim.point)
        if not self._holds("pitch"):
            _turn(self._pitch, aim.pitched)
        if not self._holds("roll"):
            _turn(self._roll, aim.rolled)

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
        self._submit(event, actor, MoveTool(p @ self._arm.T_base_shoulder[:3, :3]))

    def _submit(self, event: viser.TransformControlsEvent, actor: Actor, command: Command) -> None:
        # A drag sends twenty a second: the next one says the same, or is refused visibly.
        with suppress(KatanaError):
            self._gestures.submit(command, actor)
            if event.phase == "end":
                self._gestures.submit(EndDrag(), actor)

    def _holds(self, part: str) -> bool:
        actor = self._held.get(part)
        return actor is not None and self._gestures.is_current(actor)

    async def _pitched(self, event: viser.TransformControlsEvent) -> None:
        actor = self._gestures.actor(event.client_id)
        turn = self._turning(event, actor, "pitch")
        if turn is not None:
            self._submit(event, actor, TurnTool(turn.pitch + turn.turned, turn.roll))

    async def _rolled(self, event: viser.TransformControlsEvent) -> None:
        actor = self._gestures.actor(event.client_id)
        turn = self._turning(event, actor, "roll")
        if turn is not None:
            self._submit(event, actor, TurnTool(turn.pitch, turn.roll + turn.turned))

    def _turning(
        self, event: viser.TransformControlsEvent, actor: Actor, ring: str
    ) -> _Turn | None:
        """Follow one ring's drag; the turn is counted on past half a circle."""
        R = so3.from_quaternion(np.asarray(event.target.wxyz, dtype=float))
        if event.phase == "start":
            state = self._current()
            wish = state.target
            if isinstance(wish, ToolTarget):
                pitch, roll = wish.pitch, wish.roll
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


def _turn(handle: viser.TransformControlsHandle, wxyz: Quaternion) -> None:
    if _apart(handle.wxyz, wxyz) > TURN_WORTH_SENDING:
        turn(handle, wxyz)


def _apart(there: FloatArray, here: tuple[float, ...]) -> float:
    known: list[float] = there.tolist()
    return max(abs(a - b) for a, b in zip(known, here, strict=True))


def _quaternion(R: FloatArray) -> Quaternion:
    w, x, y, z = so3.to_quaternion(R).tolist()
    return w, x, y, z
