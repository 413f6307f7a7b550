"""The target of a drag of an arm whose tool can have every orientation."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from katana450.caching import cached_property
from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import FloatArray, frozen


@dataclass(frozen=True, eq=False)
class ToolPose:
    """A pose of the tool: its point ``position`` (3,) [m] and rotation ``R`` (3, 3), in {S}.

    For an arm with fewer than six axes ``R`` is the rotation with axis 1 at zero. So the tool keeps
    it in the frame that turns with axis 1, like the pitch of a five-axis arm; the turn of axis 1
    follows from the position.
    """

    position: FloatArray
    R: FloatArray

    @staticmethod
    def of(T: FloatArray) -> ToolPose:
        """Return the pose `T` (4, 4)."""
        return ToolPose(frozen(T[:3, 3]), frozen(T[:3, :3]))

    @cached_property
    def T(self) -> FloatArray:
        """The pose as T_S_tool (4, 4)."""
        return se3.from_rotation_translation(self.R, self.position)

    def moved(self, position: FloatArray) -> ToolPose:
        """Return the pose with another `position` (3,)."""
        return replace(self, position=position)

    def towards(self, other: ToolPose, fraction: float) -> ToolPose:
        """Return the pose at `fraction` (0 to 1) of the straight path to `other`.

        The tool turns about one axis.
        """
        turn = so3.log(other.R @ self.R.T)
        return ToolPose(
            frozen(self.position + fraction * (other.position - self.position)),
            frozen(so3.exp(fraction * turn) @ self.R),
        )

    def apart(self, other: ToolPose) -> tuple[float, float]:
        """Return the distance [m] and the angle [rad] between two poses."""
        return math.dist(self.position, other.position), so3.angle(self.R, other.R)
