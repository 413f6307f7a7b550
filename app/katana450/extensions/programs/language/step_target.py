"""The target of a step of a script, and the frame of its points."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from katana450.maths.geometry import se3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.branch import AnyBranch

METRES = 2.0
"""[mm] Coordinates that are all smaller look like metres."""


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


@dataclass(frozen=True, eq=False)
class ScriptFrame:
    """The frame in which a script gives points [mm].

    Attributes:
        name: its name in a script.
        T: (4, 4) pose of the shoulder frame {S} in it [m].
    """

    name: str
    T: FloatArray

    @classmethod
    def of(cls, T_base_shoulder: FloatArray, *, in_base: bool) -> ScriptFrame:
        """Return the base frame, or the shoulder frame {S}."""
        return cls("base", T_base_shoulder) if in_base else cls("shoulder", np.eye(4))

    def shown(self, p: FloatArray) -> FloatArray:
        """Return the point (3,) [m] of {S} in this frame [mm]."""
        return 1e3 * (self.T[:3, :3] @ p + self.T[:3, 3])

    def point(self, shown: FloatArray) -> FloatArray:
        """Return the point (3,) [m] in {S} that is ``shown`` (3,) [mm] in this frame."""
        T = se3.inverse(self.T)
        return T[:3, :3] @ (1e-3 * shown) + T[:3, 3]

    def looks_like_metres(self, p: FloatArray) -> bool:
        """Return whether somebody seems to have given the point (3,) [m] of {S} in metres."""
        return float(np.abs(self.shown(p)).max()) < METRES

    def words(self, p: FloatArray) -> str:
        """Return the point (3,) [m] of {S} in words."""
        # Rounded first, and 0 added, so that there is no -0.0.
        x, y, z = (np.round(self.shown(p), 1) + 0.0).tolist()
        return f"({x:.1f}, {y:.1f}, {z:.1f}) mm in the {self.name} frame"
