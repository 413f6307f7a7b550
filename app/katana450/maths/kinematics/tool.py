"""The target of a tool: its point, and the freedoms of its orientation that count."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy.typing as npt

from katana450.caching import cached_property
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


@dataclass(frozen=True, eq=False)
class ToolTarget:
    """A target of the tool, in the freedoms that its arm has.

    A five-axis arm of the family chooses pitch and roll. The yaw follows from the arm: the roll
    axis lies in the plane that turns with axis 1. Every other arm has a rotation as its target.

    Attributes:
        position: the tool point (3,) [m] in {S}.
        pitch: angle of the roll axis below the horizontal [rad], for the Katana theta2 + theta3 +
            theta4.
        roll: turn about the roll axis [rad], for the Katana theta5.
        rotation: rotation (3, 3) of the tool in {S}; None if pitch and roll count. For an arm with
            fewer than six axes it is that with axis 1 at zero. So the tool keeps it in the frame
            that turns with axis 1, like the pitch of a five-axis arm; the turn of axis 1 follows
            from the position.
    """

    position: FloatArray
    pitch: float = 0.0
    roll: float = 0.0
    rotation: FloatArray | None = None

    @staticmethod
    def of(T: FloatArray) -> ToolTarget:
        """Return the target that is the whole pose `T` (4, 4)."""
        return ToolTarget(frozen(T[:3, 3]), rotation=frozen(T[:3, :3]))

    @property
    def is_pitched(self) -> bool:
        """True if its orientation is the pitch and roll of a five-axis arm."""
        return self.rotation is None

    @property
    def R(self) -> FloatArray:
        """The rotation (3, 3) of a target that is not pitched."""
        assert self.rotation is not None
        return self.rotation

    @cached_property
    def T(self) -> FloatArray:
        """The pose (4, 4) of a target that is not pitched."""
        return se3.from_rotation_translation(self.R, self.position)

    @staticmethod
    def at(chain: Chain, q: FloatArray) -> ToolTarget:
        """Return the target at which the tool of a five-axis arm is at `q` (5,) [rad]."""
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
        """Return the target at `fraction` (0 to 1) of the straight path to `other`.

        Pitch and roll change evenly, or the tool turns about one axis.
        """
        position = frozen(self.position + fraction * (other.position - self.position))
        if self.is_pitched:
            pitch = self.pitch + fraction * (other.pitch - self.pitch)
            return ToolTarget(position, pitch, self.roll + fraction * (other.roll - self.roll))
        turn = so3.log(other.R @ self.R.T)
        return ToolTarget(position, rotation=frozen(so3.exp(fraction * turn) @ self.R))

    def apart(self, other: ToolTarget) -> tuple[float, float]:
        """Return the distance [m] and the angle [rad] between two targets of one arm.

        The angle is the larger difference of pitch and roll, or that of the rotations.
        """
        distance = math.dist(self.position, other.position)
        if self.is_pitched:
            return distance, max(abs(self.pitch - other.pitch), abs(self.roll - other.roll))
        return distance, so3.angle(self.R, other.R)
