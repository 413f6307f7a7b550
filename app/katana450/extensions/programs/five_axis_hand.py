"""The hand of the five-axis family: a grasp has a pitch and a roll, and its yaw follows."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, Final, cast

import numpy as np

from katana450.arm.control.pouring import is_vessel
from katana450.arm.control.scene_objects import SceneObject
from katana450.errors import InputError
from katana450.extensions.programs.approach import (
    ABOVE,
    DOWN,
    FRONT,
    LOW,
    UP,
    YAW_TOLERANCE,
    Approach,
    symmetry,
)
from katana450.extensions.programs.reaching import reaching
from katana450.maths.geometry import se3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.branch import AnyBranch, branch_of
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.forward import forward
from katana450.maths.kinematics.tool import DragTarget, ToolTarget
from katana450.maths.kinematics.turns import wrapped

PITCHES: Final = tuple(np.radians((30.0, 35.0, 25.0, 40.0, 20.0, 45.0)).tolist())
"""[rad] Pitches of the tool for a grasp from the front, tried in this order. The arm pours better
with a smaller pitch, but the limit of the shoulder joint keeps a level tool (pitch 0) above 110 mm.
"""

STEEP_PITCHES: Final = tuple(np.radians((55.0, 65.0, 75.0)).tolist())
"""[rad] Further pitches for objects that are not poured, as near the arm only these are reached."""

TIP_DISTANCES: Final = tuple(np.arange(0.014, 0.056, 0.002).tolist())
"""[m] Distances between the tool frame and the middle of an object that is grasped by the tips,
tried from the smallest. The tips move down as the fingers close.
"""

MAX_SKEW: Final = math.radians(15.0)
"""[rad] Maximum angle between the fingers and the sides of a box: the pads yield by as much."""

PLACED: Final = 1e-12
"""[m] Error up to which the tool is over the place."""

ROUNDS: Final = 50
"""Maximum number of corrections of the tool's place; each leaves less than a third of the error."""


@dataclass(frozen=True, eq=False)
class FiveAxisHand:
    """The hand of one chain as `HandPlanning`.

    Attributes:
        chain: the arm with its tool.
        T_base_shoulder: (4, 4) pose of {S} in the base frame [m].
    """

    chain: Chain
    T_base_shoulder: FloatArray

    tool: ClassVar[str] = "grasp"
    tip_distances: ClassVar[Sequence[float]] = TIP_DISTANCES
    is_redundant: ClassVar[bool] = False

    def approaches(
        self, scene_object: SceneObject, at: FloatArray, side: FloatArray
    ) -> Mapping[str, Sequence[Approach]]:
        """Return the approaches; the fingers close on two opposite sides of a box or mesh.

        A vessel is only grasped from the front: from above the wrist could not pour it.
        """
        if is_vessel(scene_object):
            return {FRONT: tuple(map(Approach, PITCHES))}
        # Only steep fingertips come near what a low object stands on.
        low = scene_object.height < LOW
        front = tuple(map(Approach, STEEP_PITCHES[::-1] if low else (*PITCHES, *STEEP_PITCHES)))
        if scene_object.shape.is_round:
            return {FRONT: front, ABOVE: (Approach(DOWN),)}
        x, y, _ = at
        skew = math.atan2(y, x) - math.atan2(side[1], side[0])
        rolls = sorted((wrapped(skew + quarter * DOWN) for quarter in range(4)), key=abs)
        found = {ABOVE: tuple(Approach(DOWN, roll) for roll in rolls)}
        return found | ({FRONT: front} if abs(rolls[0]) <= MAX_SKEW else {})

    def with_pitch(
        self,
        pitch: float,
        scene_object: SceneObject,  # noqa: ARG002
        at: FloatArray,  # noqa: ARG002
        side: FloatArray,  # noqa: ARG002
    ) -> Sequence[Approach]:
        """Return the one approach without roll."""
        return [Approach(pitch)]

    def before(self, middle: FloatArray, approach: Approach, back: float) -> ToolTarget:
        """Return the tool before ``middle``, on its own axis."""
        pitch, roll = approach.pitch, approach.roll
        out = np.array((middle[0], middle[1], 0.0)) / math.hypot(middle[0], middle[1])
        along = math.cos(pitch) * out - math.sin(pitch) * UP
        return ToolTarget(middle - back * along, pitch, roll)

    def drawn_back(self, q: FloatArray, away: float) -> DragTarget:
        """Return the tool at `q`, drawn back radially and along its pitch."""
        at = ToolTarget.at(self.chain, q)
        return self.before(at.position, Approach(at.pitch, at.roll), away)

    def retreat(self, q: FloatArray, away: float) -> DragTarget:
        """Return ``drawn_back``."""
        return self.drawn_back(q, away)

    def branches_to(self, q: FloatArray, target: DragTarget) -> Sequence[AnyBranch | None]:
        """Return the nearest one if `reaching` finds a posture."""
        return () if reaching(self.chain, q, cast(ToolTarget, target), None) is None else (None,)

    def branch_at(self, q: FloatArray) -> AnyBranch | None:  # noqa: ARG002
        """Return None: the nearest branch is that of the way there."""
        return None

    def way_round(self, here: float, there: float) -> float:
        """Return the turn that axis 1 can make, which does not pass behind the arm."""
        return there - here

    def turned(
        self,
        target: DragTarget,
        position: FloatArray,
        angle: float,  # noqa: ARG002
    ) -> DragTarget:
        """Return the target there: pitch and roll turn with the arm."""
        return target.moved(position)

    def over(
        self,
        held: SceneObject,
        T_base_object: FloatArray,
        q: FloatArray,
        goal: FloatArray,
        yaw: float | None,
    ) -> Sequence[ToolTarget]:
        """Return the tools; only an object that is held from above can be turned."""
        at = ToolTarget.at(self.chain, q)
        natural, low = self._over(T_base_object, q, goal, at)
        turn_alike = symmetry(held)
        if yaw is None or turn_alike == 0.0:
            return [low]
        turn = math.remainder(yaw - natural, turn_alike)
        if abs(turn) <= YAW_TOLERANCE:
            return [low]
        if abs(at.pitch - DOWN) > YAW_TOLERANCE:
            raise InputError(
                f"it turns with the arm, and its yaw would be {math.degrees(natural):.1f} deg "
                f"there instead of {math.degrees(yaw):g}. Pick it with `side: above`, or leave out "
                "the yaw."
            )
        count = round(math.tau / turn_alike)
        rolls = sorted((wrapped(at.roll - turn + k * turn_alike) for k in range(count)), key=abs)
        return [self._over(T_base_object, q, goal, replace(at, roll=roll))[1] for roll in rolls]

    def _over(
        self, T_base_object: FloatArray, q: FloatArray, goal: FloatArray, at: ToolTarget
    ) -> tuple[float, ToolTarget]:
        """Return the yaw [rad] of the object over ``goal``, and the tool there.

        The tool has the pitch and roll of ``at``, and holds the object as it does now.
        """
        chain = self.chain
        T_base_tool = self.T_base_shoulder @ forward(chain, q)
        T_tool_object = se3.inverse(T_base_tool) @ T_base_object
        branch = branch_of(chain, q)
        position = goal
        for _ in range(ROUNDS):
            tool = replace(at, position=position)
            T = tool.pose(chain, tool.facing(chain, branch, float(q[0]))) @ T_tool_object
            error = goal - T[:3, 3]
            if float(np.abs(error).max()) <= PLACED:
                break
            position = position + error
        R = self.T_base_shoulder[:3, :3] @ T[:3, :3]
        return math.atan2(R[1, 0], R[0, 0]), tool
