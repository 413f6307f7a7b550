"""The situation that a program is planned for: its plans stay valid while it is unchanged."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from katana450.arm.control.session.goals import START_TOLERANCE
from katana450.arm.control.state.scene_objects import SceneObject
from katana450.arm.control.state.state import State
from katana450.maths.geometry.arrays import FloatArray

MAX_SLIP = 1e-3
"""[m or 1] Change of a pose in the hand, in which friction lets objects slip, that keeps plans."""

Scene = tuple[tuple[Any, ...], ...]
"""Shape and pose of every object; a plan does not depend on their appearance."""


@dataclass(frozen=True, eq=False)
class Situation:
    """Everything in a state on which plans depend.

    Attributes:
        posture: (n,) the joints [rad].
        fingers: the finger joint, and the angle at which it grips, None with an empty hand [rad].
        tool: the tool frame.
        scene: the scene objects.
        water: volume in each vessel [fl]; None without a cup.
    """

    posture: FloatArray
    fingers: tuple[float, float | None]
    tool: str
    scene: Scene
    water: tuple[int, ...] | None

    @staticmethod
    def of(state: State) -> Situation:
        """Return the situation of an arm at rest in ``state``."""
        water = None if state.poured is None else state.poured.water
        return Situation(
            state.setpoint,
            (state.gripper_setpoint, state.grip),
            state.tool,
            tuple(map(_shape, state.objects)),
            None if water is None else tuple(vessel.volume for vessel in water.vessels),
        )

    @property
    def key(self) -> tuple[object, ...]:
        """A hashable value that is equal for equal situations."""
        return self.posture.tobytes(), self.fingers, self.tool, self.scene, self.water

    def changed_to(self, now: Situation) -> str:
        """Return a clause that names the first change that invalidates a plan, else "" for none.

        A difference in posture within the start tolerance of a plan is ignored.
        """
        if float(np.abs(self.posture - now.posture).max()) > START_TOLERANCE:
            return "the arm has moved"
        if self.fingers != now.fingers:
            return "the gripper has moved"
        if self.tool != now.tool:
            return "another tool frame is chosen"
        same = len(self.scene) == len(now.scene) and all(map(_is_same, self.scene, now.scene))
        if not same:
            return "the scene has changed"
        return "" if self.water == now.water else "the water has changed"


def _shape(scene_object: SceneObject) -> tuple[object, ...]:
    solid = None if scene_object.solid is None else scene_object.solid.key
    T = scene_object.T.tobytes()
    return (
        scene_object.name, scene_object.shape, scene_object.size, scene_object.scale, solid,
        scene_object.fixed, scene_object.can_be_held, scene_object.zone,
        scene_object.held, T,
    )  # fmt: skip


def _is_same(before: tuple[Any, ...], now: tuple[Any, ...]) -> bool:
    """Return whether an object is unchanged, except that a held one may slip in the hand."""
    slip = np.abs(np.frombuffer(before[-1]) - np.frombuffer(now[-1])).max()
    return before[:-1] == now[:-1] and bool(slip <= (MAX_SLIP if now[-2] else 0.0))
