"""Targets of a drag; that of a five-axis arm has as many numbers as the arm has axes."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Protocol

import numpy.typing as npt

from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.kinematics.arm import FiveAxisArm, arm_of
from katana450.maths.kinematics.branch import Branch
from katana450.maths.kinematics.canonical_target import CanonicalTarget
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.forward import forward
from katana450.maths.kinematics.priority import Priority
from katana450.maths.kinematics.turns import wrapped


def pitch_and_roll(chain: Chain, q: npt.ArrayLike) -> tuple[float, float]:
    """Return pitch and roll [rad] at the joint angles `q` (5,) [rad]."""
    arm = arm_of(chain)
    alpha = arm.angles(chain.check_q(q))
    return arm.pitch(alpha), alpha[4]


def pitched_frame(chain: Chain, q: npt.ArrayLike) -> FloatArray:
    """Return the rotation (3, 3) in {S} of the frame that follows pan and pitch but not roll.

    Its x axis is the roll axis and its y axis is the pitch axis. `q` (5,) are joint angles [rad].
    """
    arm = arm_of(chain)
    pitch, _ = pitch_and_roll(chain, q)
    alpha1 = arm.signs[0] * float(chain.check_q(q)[0])
    R: FloatArray = arm.T_C_S[:3, :3].T @ so3.rotation_z(alpha1) @ so3.rotation_y(pitch)
    return R


class DragTarget(Protocol):
    """A target that a drag moves: `ToolTarget`, or that of an arm outside the five-axis family.

    Attributes:
        position: the tool point (3,) [m] in {S}.
    """

    @property
    def position(self) -> FloatArray: ...  # noqa: D102

    def moved(self, position: FloatArray) -> DragTarget:
        """Return the target with another `position` (3,)."""


@dataclass(frozen=True, eq=False)
class ToolTarget:
    """The five freedoms of the arm's tool: ``position`` (3,) [m] in {S}, pitch and roll [rad].

    Pitch is the angle of the roll axis below the horizontal, and roll the turn about it: for the
    Katana theta2 + theta3 + theta4 and theta5. The yaw follows from the arm: the roll axis lies in
    the plane that turns with axis 1.
    """

    position: FloatArray
    pitch: float
    roll: float

    @staticmethod
    def at(chain: Chain, q: FloatArray) -> ToolTarget:
        """Return the target at which the tool is with the joints at `q` (5,) [rad]."""
        return ToolTarget(frozen(forward(chain, q)[:3, 3]), *pitch_and_roll(chain, q))

    def canonical(self, arm: FiveAxisArm, priority: Priority) -> CanonicalTarget:
        """Return the same target for the canonical arm."""
        x, y, z = (arm.T_C_S[:3, :3] @ self.position + arm.T_C_S[:3, 3]).tolist()
        return CanonicalTarget.five(arm, (x, y, z), self.pitch, self.roll, priority)

    def facing(self, chain: Chain, branch: Branch, theta1: float) -> float:
        """Return the theta1 [rad] in (-pi, pi] with the position in the arm's plane, on `branch`.

        Over axis 1, where every plane has it, the result is the present `theta1`.
        """
        arm = arm_of(chain)
        alpha1 = self.canonical(arm, Priority.POSE).facing(arm, branch.shoulder)
        return theta1 if alpha1 is None else wrapped(arm.signs[0] * alpha1)

    def pose(self, chain: Chain, theta1: float) -> FloatArray:
        """Return T_S_tool (4, 4) with the arm's plane at `theta1` [rad]."""
        arm = arm_of(chain)
        alpha1 = arm.signs[0] * theta1
        R_C_K = so3.rotation_z(alpha1) @ so3.rotation_y(self.pitch) @ so3.rotation_x(self.roll)
        R = arm.T_C_S[:3, :3].T @ R_C_K @ arm.T_K_tool[:3, :3]
        return se3.from_rotation_translation(R, self.position)

    def turned_round(self) -> ToolTarget:
        """Return the same pose in space for the other shoulder, with axis 1 turned by half a turn.

        For an arm whose plane passes beside axis 1, the yaw of the pose differs.
        """
        return ToolTarget(
            self.position, wrapped(math.pi - self.pitch), wrapped(self.roll + math.pi)
        )

    def moved(self, position: FloatArray) -> ToolTarget:
        """Return the target with another `position` (3,)."""
        return replace(self, position=position)

    def towards(self, other: ToolTarget, fraction: float) -> ToolTarget:
        """Return the target at `fraction` (0 to 1) of the straight path to `other`."""
        return ToolTarget(
            frozen(self.position + fraction * (other.position - self.position)),
            self.pitch + fraction * (other.pitch - self.pitch),
            self.roll + fraction * (other.roll - self.roll),
        )
