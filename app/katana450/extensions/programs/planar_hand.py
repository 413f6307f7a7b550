"""The hand of an arm with four axes, which move it in a plane that turns about axis 1."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final, cast

import numpy as np

from katana450.arm.control.scene_objects import SceneObject
from katana450.errors import InputError
from katana450.extensions.general_arms.driven_tool import DrivenTool
from katana450.extensions.general_arms.tool_pose import ToolPose
from katana450.extensions.programs.approach import UP, YAW_TOLERANCE, Approach, symmetry
from katana450.extensions.programs.fitting import Widths
from katana450.extensions.programs.grasp_frame import GraspFrame
from katana450.extensions.programs.pose_hand import PoseHand, TiltDirection
from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.kinematics.branch import AnyBranch
from katana450.maths.kinematics.forward import forward
from katana450.maths.kinematics.tool import DragTarget
from katana450.maths.kinematics.turns import wrapped

STRAIGHT: Final = 1e-3
"""[1] Sine of the angle up to which directions count as parallel."""

MAX_SKEW: Final = math.radians(15.0)
"""[rad] Maximum angle between the fingers and the sides of a box."""

NOT_IN_PLANE: Final = (
    "An arm with four axes grasps if axis 1 is upright, axes 2 to 4 are level, and its fingers "
    "close across the plane of the arm. The description of this arm has them otherwise."
)


@dataclass(frozen=True, eq=False, kw_only=True)
class PlanarHand(PoseHand):
    """The hand of four axes as `HandPlanning`: pitches alone, and its yaw follows.

    Attributes:
        outward: direction (3,) of the plane of the arm with axis 1 at zero, away from that axis.
        across: unit vector (3,) across that plane.
        roll: turn of the grasp frame about its x axis [rad], which the arm keeps.
        beside: (2,) distances of the tool and of the grasp frame from the plane through axis 1,
            along ``across`` [m].
    """

    outward: FloatArray
    across: FloatArray
    roll: float
    beside: tuple[float, float]

    @staticmethod
    def of(
        kinematics: DrivenTool,
        T_base_shoulder: FloatArray,
        T_tool_grasp: FloatArray,
        frame: GraspFrame,
        ready: FloatArray,
    ) -> PlanarHand:
        """Return the hand of an arm whose tool is in front of axis 1 at ``ready`` (4,) [rad].

        Raises InputError for an arm that does not move its hand in a plane.
        """
        chain = kinematics.chain
        across = np.array(chain.S[:3, 1])
        level = max(abs(float(axis[2])) for axis in chain.S[:3, 1:].T)
        if level > STRAIGHT or abs(abs(float(chain.S[2, 0])) - 1.0) > STRAIGHT:
            raise InputError(NOT_IN_PLANE)
        T = forward(chain, np.append(0.0, ready[1:]))
        T_grasp = T @ T_tool_grasp
        outward = np.cross(across, UP)
        outward = math.copysign(1.0, float(outward @ T_grasp[:3, 3])) * outward
        x = T_grasp[:3, 0]
        pitch = math.atan2(-x[2], float(x @ outward))
        level_R = _plane(outward, pitch)
        y = level_R.T @ T_grasp[:3, 1]
        if abs(float(x @ across)) > STRAIGHT or abs(float(y[2])) > STRAIGHT:
            raise InputError(NOT_IN_PLANE)
        return PlanarHand(
            kinematics,
            T_base_shoulder,
            T_tool_grasp,
            frame.opening,
            frame.one_jaw,
            outward=frozen(outward),
            across=frozen(across),
            roll=math.atan2(y[2], y[1]),
            beside=(float(across @ T[:3, 3]), float(across @ T_grasp[:3, 3])),
        )

    def _options(
        self,
        pitches: Sequence[float],
        scene_object: SceneObject,
        at: FloatArray,
        side: FloatArray,
    ) -> Widths:
        """Return those options that need no turn about the hand's own axis or the vertical."""
        options = super()._options(pitches, scene_object, at, side)
        found = {
            name: [
                (Approach(approach.pitch), width)
                for approach, width in each
                if abs(approach.roll) <= MAX_SKEW and abs(approach.aside) <= MAX_SKEW
            ]
            for name, each in options.items()
        }
        if not any(found.values()):
            raise InputError(
                "its sides are turned too far, seen from the arm, and four axes cannot turn the "
                f"hand: at most {math.degrees(MAX_SKEW):.0f} deg are possible. Turn it."
            )
        return found

    def before(self, middle: FloatArray, approach: Approach, back: float) -> DragTarget:
        """Return the tool with the grasp frame before ``middle``, in the plane through it."""
        R = _plane(self.outward, approach.pitch) @ so3.rotation_x(self.roll)
        beside = self.beside[1] + approach.shift * float(R[:, 1] @ self.across)
        turn = self._turn(middle, beside)
        R = so3.rotation_z(turn) @ R
        T = se3.from_rotation_translation(R, middle - back * R[:, 0] - approach.shift * R[:, 1])
        T = T @ se3.inverse(self.T_tool_grasp)
        return ToolPose(frozen(T[:3, 3]), frozen(so3.rotation_z(-turn) @ T[:3, :3]))

    def _turn(self, p: FloatArray, beside: float) -> float:
        """Return the turn [rad] about axis 1 that brings a point ``beside`` the plane to `p` (3,).

        Raises InputError for a point too near to axis 1.
        """
        outward = math.hypot(p[0], p[1]) ** 2 - beside**2
        if outward < 0.0:
            raise InputError("it stands too near to axis 1, where the plane of the arm cannot be.")
        at = math.sqrt(outward) * self.outward + beside * self.across
        return wrapped(math.atan2(p[1], p[0]) - math.atan2(at[1], at[0]))

    def branches_to(self, q: FloatArray, target: DragTarget) -> Sequence[AnyBranch | None]:
        """Return those with a posture inside the limits that takes the pose."""
        pose = cast(ToolPose, target)
        R = so3.rotation_z(self._turn(pose.position, self.beside[0])) @ pose.R
        return self._branches_to(q, se3.from_rotation_translation(R, pose.position))

    def tilt_directions(
        self, q: FloatArray, cup: FloatArray, over: FloatArray
    ) -> Iterable[TiltDirection]:
        """Yield the two directions in the plane of the arm, that away from axis 1 first."""
        present = self._present(q)
        turn = self._turn(over, float(self.across @ so3.rotation_z(-present) @ cup))
        for outward in (self.outward, -self.outward):
            toward = so3.rotation_z(turn) @ outward
            yield TiltDirection(wrapped(turn - present), toward, outward)

    def _present(self, q: FloatArray) -> float:
        """Return the turn [rad] of the plane of the arm about the vertical at `q` (4,) [rad]."""
        return math.copysign(1.0, self.kinematics.chain.S[2, 0]) * float(q[0])

    def turned(self, target: DragTarget, position: FloatArray, angle: float) -> DragTarget:  # noqa: ARG002
        """Return the pose there: its rotation turns with axis 1."""
        return target.moved(frozen(position))

    def over(
        self,
        held: SceneObject,
        T_base_object: FloatArray,
        q: FloatArray,
        goal: FloatArray,
        yaw: float | None,
    ) -> Sequence[DragTarget]:
        """Return the tool; the object turns with the arm."""
        T = se3.inverse(self.T_base_shoulder) @ T_base_object
        present = self._present(q)
        p = so3.rotation_z(-present) @ T[:3, 3]
        turn = self._turn(goal, float(self.across @ p)) - present
        alike = symmetry(held)
        if yaw is not None and alike != 0.0:
            natural = turn + math.atan2(T_base_object[1, 0], T_base_object[0, 0])
            if abs(math.remainder(yaw - natural, alike)) > YAW_TOLERANCE:
                raise InputError(
                    "it turns with the arm, and its yaw would be "
                    f"{math.degrees(wrapped(natural)):.1f} deg there instead of "
                    f"{math.degrees(yaw):g}. Leave out the yaw: four axes cannot turn it."
                )
        at = self.kinematics.target_at(q)
        position = goal + so3.rotation_z(turn) @ (at.position - T[:3, 3])
        return [at.moved(frozen(position))]


def _plane(outward: FloatArray, pitch: float) -> FloatArray:
    """Return the rotation (3, 3) of a hand with ``pitch`` [rad] in the plane along ``outward``."""
    return so3.from_rpy(0.0, pitch, math.atan2(outward[1], outward[0]))
