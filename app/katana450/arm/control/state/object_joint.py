"""The joint of a drawer or a door, as the objects that are its parts know it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from katana450.maths.geometry import se3
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.physics.joint import BodyJoint


@dataclass(frozen=True, eq=False)
class ObjectJoint:
    """The joint of a part. All parts of one body move together, such as a drawer and its handle.

    Attributes:
        body: name of the body.
        joint: its joint.
        T_zero: (4, 4) pose of the part in the base frame while the joint is at zero [m].
    """

    body: str
    joint: BodyJoint
    T_zero: FloatArray

    def __post_init__(self) -> None:
        T = se3.validated(self.T_zero, f"The pose of a part of {self.body!r}")
        object.__setattr__(self, "T_zero", frozen(T))

    @property
    def key(self) -> tuple[object, ...]:
        """A hashable value that is equal for equal joints."""
        return self.body, self.joint, self.T_zero.tobytes()

    @property
    def T_body_part(self) -> FloatArray:
        """Pose (4, 4) of the part in the frame of its body; see ``RigidBody`` [m]."""
        return np.asarray(self._T_zero_body(-1.0) @ self.T_zero)

    def _T_zero_body(self, sign: float) -> FloatArray:
        return se3.from_rotation_translation(np.eye(3), sign * np.array(self.joint.point))

    def pose(self, position: float) -> FloatArray:
        """Return the pose (4, 4) of the part in the base frame at ``position`` [m or rad]."""
        return frozen(self.joint.motion(position) @ self.T_zero)

    def position(self, T: FloatArray) -> float:
        """Return the position [m or rad] of the joint at which the part is nearest to ``T``.

        T: (4, 4) pose in the base frame.
        """
        return self.joint.position(T @ se3.inverse(self.T_zero))

    def body_pose(self, T: FloatArray) -> FloatArray:
        """Return the pose (4, 4) of the body while the part is at ``T`` (4, 4)."""
        return frozen(self.joint.motion(self.position(T)) @ self._T_zero_body(1.0))
