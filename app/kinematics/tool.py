"""A target with as many numbers as the arm has axes."""

from __future__ import annotations

import math
from dataclasses import dataclass

from app import tolerances
from app.geometry import se3, so3
from app.geometry.arrays import FloatArray, frozen
from app.kinematics.branch import Branch
from app.kinematics.chain import Chain
from app.kinematics.forward import forward
from app.kinematics.freedoms import pitch_and_roll
from app.kinematics.turns import wrapped


@dataclass(frozen=True, eq=False)
class ToolTarget:
    """The five freedoms of the arm's tool: ``position`` (3,) [m] in {S}, pitch and roll [rad].

    Pitch is theta2 + theta3 + theta4, the angle below the horizontal; roll is theta5. Which way the
    tool points sideways is the arm's to give: it lies in the vertical plane through axis 1.
    """

    position: FloatArray
    pitch: float
    roll: float

    @staticmethod
    def at(chain: Chain, q: FloatArray) -> ToolTarget:
        """Where the tool is with the joints at `q` (5,) [rad]."""
        return ToolTarget(frozen(forward(chain, q)[:3, 3]), *pitch_and_roll(chain, q))

    def facing(self, branch: Branch, theta1: float) -> float:
        """The theta1 [rad] in (-pi, pi] of a straight arm whose plane has the position on `branch`.

        Over axis 1 every plane has it: then the one the arm stands in, `theta1`.
        """
        x, y = float(self.position[0]), float(self.position[1])
        if math.hypot(x, y) <= tolerances.ON_AXIS:
            return theta1
        azimuth = math.atan2(y, x)
        if branch.shoulder == "front":
            return azimuth
        return azimuth - math.copysign(math.pi, azimuth)

    def pose(self, chain: Chain, theta1: float) -> FloatArray:
        """T_S_tool (4, 4) of a straight arm that stands in the plane at `theta1` [rad]."""
        R = so3.rotation_z(theta1) @ so3.rotation_y(self.pitch) @ so3.rotation_x(self.roll)
        return se3.from_rotation_translation(R @ chain.M[:3, :3], self.position)

    def turned_round(self) -> ToolTarget:
        """The same pose in space as the other shoulder counts it, with axis 1 half a turn on."""
        return ToolTarget(
            self.position, wrapped(math.pi - self.pitch), wrapped(self.roll + math.pi)
        )

    def towards(self, other: ToolTarget, share: float) -> ToolTarget:
        """The target that `share` (0 to 1) of the straight way to `other` leads to."""
        return ToolTarget(
            frozen(self.position + share * (other.position - self.position)),
            self.pitch + share * (other.pitch - self.pitch),
            self.roll + share * (other.roll - self.roll),
        )
