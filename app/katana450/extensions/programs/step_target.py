"""The target of a step of a script."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.branch import AnyBranch


class Angles(NamedTuple):
    """Angles of the tool [rad]; None to keep one.

    They are pitch and roll of a five-axis arm. Of other arms they are the roll, pitch and yaw of
    the page: those of the tool frame in the frame of the script.
    """

    pitch: float | None = None
    roll: float | None = None
    yaw: float | None = None

    def or_else(self, other: Angles) -> Angles:
        """Return it with those of ``other`` where it has None."""
        return Angles(*(b if a is None else a for a, b in zip(self, other, strict=True)))


KEPT = Angles()
"""No angles: the orientation stays."""


@dataclass(frozen=True, eq=False)
class StepTarget:
    """The target of a step, by joints or by the pose of the tool.

    Attributes:
        joints: (n,) [rad]; None if the target is a pose.
        position: (3,) [m], in {S} or, with ``in_base``, in the base frame; None to keep it.
        angles: the orientation of the tool.
        branch: None for any, the present one first.
        in_base: whether ``position`` and ``angles`` are in the base frame.
    """

    joints: FloatArray | None = None
    position: FloatArray | None = None
    angles: Angles = KEPT
    branch: AnyBranch | None = None
    in_base: bool = False
