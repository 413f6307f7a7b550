"""The arm of a robot with its place in the robot: base and fingers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from katana450.arm.control.arm import ArmModel
from katana450.maths.geometry.arrays import FloatArray


@dataclass(frozen=True, eq=False, kw_only=True)
class MountedArm(ArmModel):
    """An arm as part of a robot.

    The control core uses it as an ``ArmModel``. ``ArmModel`` is a separate class because the core
    knows neither base frames nor links.

    Attributes:
        T_base_shoulder: (4, 4) frame {S} in the root link, which stands on the table [m].
        fingers: (factor, offset) of the finger joints, the driven one first:
            value = factor * driven + offset [rad or m].
        resting: value [rad or m] of every movable joint that the arm does not drive.
        notes: sentences for a person on assumptions about the file.
    """

    T_base_shoulder: FloatArray
    fingers: Mapping[str, tuple[float, float]]
    resting: Mapping[str, float]
    notes: tuple[str, ...] = ()

    def moves(self, joint: str) -> bool:
        """Return whether the joint of that name is an axis or a finger."""
        return joint in self.chain.names or joint in self.fingers

    def ready(self, posture: Sequence[float]) -> FloatArray:
        """Return the joint angles (n,) [rad] inside limits in which the arm starts.

        ``posture``: (5,) [rad] of the canonical arm, for an arm of the five-axis family; for the
        Katana these are its joint angles.
        """
        return self.kinematics.ready(posture, self.T_base_shoulder)

    def joint_values(self, q: FloatArray, gripper: float) -> dict[str, float]:
        """Return the value of every movable joint of the robot [rad or m].

        Args:
            q: (n,) angles of the axes [rad].
            gripper: value of the driven finger joint [rad or m].
        """
        values = dict(zip(self.chain.names, (float(angle) for angle in q), strict=True))
        for joint, (factor, offset) in self.fingers.items():
            values[joint] = factor * gripper + offset
        return {**values, **self.resting}
