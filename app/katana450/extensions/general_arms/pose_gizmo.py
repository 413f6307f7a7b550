"""The gizmo of an arm whose tool can have every orientation: three arrows and three rings.

An arm of four axes has one ring, which pitches its tool.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np
import viser

from katana450.arm.control.commands import Orient
from katana450.arm.control.state import State
from katana450.maths.geometry import so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.forward import forward, joint_frames
from katana450.server.view.gizmo import Aim, Gizmo, quaternion, turn_ring

ALL_FREEDOMS = 6
"""Number of freedoms of a tool that can have every orientation."""

PITCHING = 4
"""Number of axes of an arm that can only pitch its tool."""


class PoseGizmo(Gizmo):
    """The gizmo. Its rings are those of the tool's frame."""

    parts: ClassVar[tuple[str, ...]] = ("move", "turn")

    def _add_rings(self, server: viser.ViserServer) -> None:
        one = self._arm.chain.n == PITCHING
        self._turn = self._ring(server, "/target/move/turn", (True, not one, True))
        self._turn.on_update(self._turned)
        # The rotation of the tool in the frame of the rings while they are held.
        self._R_ring_tool = np.eye(3)

    def aim(self, state: State, T: FloatArray) -> None:
        """Store the pose of the goal of ``state``; its ``T`` (4, 4) is in the base frame."""
        x, y, z = T[:3, 3].tolist()
        wxyz = quaternion(self._rings(state))
        self._aim = Aim((x, y, z), wxyz, wxyz)

    def _rings(self, state: State) -> FloatArray:
        """Return the frame of the rings (3, 3) in the base frame.

        With four axes its y axis, about which the ring turns, is axis 4.
        """
        chain = self._arm.chain_to(state.tool)
        R: FloatArray = forward(chain, state.goal)[:3, :3]
        if chain.n == PITCHING:
            y = joint_frames(chain, state.goal)[3][:3, :3] @ chain.S[:3, 3]
            x = np.cross(y, chain.S[:3, 0])
            R = np.column_stack((x, y, np.cross(x, y)))
        return self._arm.T_base_shoulder[:3, :3] @ R

    def _turn_rings(self, aim: Aim) -> None:
        if not self._holds("turn"):
            turn_ring(self._turn, aim.pitched)

    async def _turned(self, event: viser.TransformControlsEvent) -> None:
        actor = self._gestures.actor(event.client_id)
        if event.phase == "start":
            state = self._current()
            T = forward(self._arm.chain_to(state.tool), state.goal)
            R_base_tool = self._arm.T_base_shoulder[:3, :3] @ T[:3, :3]
            self._R_ring_tool = self._rings(state).T @ R_base_tool
            self._held["turn"] = actor
            return
        if self._held.get("turn") != actor:
            return
        if event.phase == "end":
            del self._held["turn"]
        wxyz = np.asarray(event.target.wxyz, dtype=float)
        R = self._arm.T_base_shoulder[:3, :3].T @ so3.from_quaternion(wxyz) @ self._R_ring_tool
        self._submit(event, actor, Orient(R), tuple(wxyz.tolist()))


def gizmo_for(freedoms: int) -> type[Gizmo] | None:
    """Return the class of the gizmo of a tool with so many freedoms; None if it is another one."""
    return PoseGizmo if freedoms == ALL_FREEDOMS else None
