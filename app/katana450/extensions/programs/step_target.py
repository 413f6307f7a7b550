"""The target of a step of a script."""

from __future__ import annotations

from dataclasses import dataclass

from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.branch import Branch


@dataclass(frozen=True, eq=False)
class StepTarget:
    """The target of a step, by joints or by the pose of the tool.

    Attributes:
        joints: (n,) [rad]; None if the target is a pose.
        position: (3,) [m], in {S} or, with ``in_base``, in the base frame; None to keep it.
        pitch: [rad]; None to keep it.
        roll: [rad]; None to keep it.
        branch: None for any, the present one first.
        in_base: whether ``position`` is in the base frame.
    """

    joints: FloatArray | None = None
    position: FloatArray | None = None
    pitch: float | None = None
    roll: float | None = None
    branch: Branch | None = None
    in_base: bool = False
