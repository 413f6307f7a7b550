"""A target with as many numbers as the arm has axes."""

from __future__ import annotations

import math
from dataclasses import dataclass

from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.kinematics.arm import FiveAxisArm, arm_of
from katana450.maths.kinematics.branch import Branch
from katana450.maths.kinematics.canonical_target import CanonicalTarget
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.forward import forward
from katana450.maths.kinematics.freedoms import pitch_and_roll
from katana450.maths.kinematics.priority import Priority
from katana450.maths.kinematics.turns import wrapped


@dataclass(frozen=True, eq=False)
class ToolTarget:
    """The five freedoms of the arm's tool: ``position`` (3,) [m] in {S}, pitch and roll [rad].

    Pitch is the angle of the roll axis below the horizontal and roll the turn about it: of the
    Katana theta2 + theta3 + theta4 and theta5. Which way the tool points sideways is the arm's to
    give: the roll axis lies in the plane that turns with axis 1.
    """

    position: FloatArray
    pitch: float
    roll: float

    @staticmethod
    def at(chain: Chain, q: FloatArray) -> ToolTarget:
        """Where the tool is with the joints at `q` (5,) [rad]."""
        return ToolTarget(frozen(forward(chain, q)[:3, 3]), *pitch_and_roll(chain, q))

    def canonical(self, arm: FiveAxisArm, priority: Priority) -> CanonicalTarget:
        """The same of the canonical arm."""
        x, y, z = (arm.T_C_S[:3, :3] @ self.position + arm.T_C_S[:3, 3]).tolist()
        return CanonicalTarget.five(arm, (x, y, z), self.pitch, self.roll, priority)

    def facing(self, chain: Chain, branch: Branch, theta1: float) -> float:
        """The theta1 [rad] in (-pi, pi] at which the arm's plane has the position on `branch`.

        Over axis 1, where any has, that where the arm stands, `theta1`.
        """
        arm = arm_of(chain)
        alpha1 = self.canonical(arm, Priority.POSE).facing(arm, branch.shoulder)
        return theta1 if alpha1 is None else wrapped(arm.signs[0] * alpha1)

    def pose(self, chain: Chain, theta1: float) -> FloatArray:
        """T_S_tool (4, 4) with the arm's plane at `theta1` [rad]."""
        arm = arm_of(chain)
        alpha1 = arm.signs[0] * theta1
        R_C_K = so3.rotation_z(alpha1) @ so3.rotation_y(self.pitch) @ so3.rotation_x(self.roll)
        R = arm.T_C_S[:3, :3].T @ R_C_K @ arm.T_K_tool[:3, :3]
        return se3.from_rotation_translation(R, self.position)

    def turned_round(self) -> ToolTarget:
        """The same pose in space as the other shoulder counts it, with axis 1 half a turn on.

        Of an arm whose plane passes beside axis 1, the same but for its yaw.
        """
        return ToolTarget(
            self.position, wrapped(math.pi - self.pitch), wrapped(self.roll + math.pi)
        )

    def towards(self, other: ToolTarget, fraction: float) -> ToolTarget:
        """The target that `fraction` (0 to 1) of the straight way to `other` leads to."""
        return ToolTarget(
            frozen(self.position + fraction * (other.position - self.position)),
            self.pitch + fraction * (other.pitch - self.pitch),
            self.roll + fraction * (other.roll - self.roll),
        )
