"""The moving groups of an arm as a tree of turning and sliding joints, and their poses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from katana450.maths.geometry import so3
from katana450.maths.geometry.arrays import FloatArray

PARALLEL_SINE = 1e-9
"""[1] Sine of an angle up to which an axis has a direction."""

GROUND = 0
"""Index of the group that stands still: the root link and all that is fixed to it."""


@dataclass(frozen=True, eq=False)
class RigidGroup:
    """Bodies that move as one piece about one joint.

    Attributes:
        parent: index of the parent group, smaller than its own.
        T_parent_mover: pose (4, 4) while its joint is at zero [m].
        axis: unit direction (3,) of the joint in its own frame, through its origin.
        variable: index in x of the variable that drives the joint.
        factor, offset: the joint's value is factor * x[variable] + offset [rad or m].
        slides: True if the group moves along the axis instead of turning about it.
    """

    parent: int
    T_parent_mover: FloatArray
    axis: FloatArray
    variable: int
    factor: float = 1.0
    offset: float = 0.0
    slides: bool = False


class Linkage:
    """Rigid groups numbered from 1, parents first, driven by x (k,) [rad; m for sliding joints].

    Attributes:
        sliding: indices (s,) of the groups that slide.
        parent: parent (m,) of each group; the ground is its own.
        carries: (m, m) bool, True where the joint of the second group moves the first.
    """

    def __init__(self, movers: Sequence[RigidGroup]) -> None:
        m = len(movers) + 1
        self.count = m
        self.parent = np.array([GROUND, *(mover.parent for mover in movers)])
        self.variable = np.array([0, *(mover.variable for mover in movers)])
        self.factor = np.array([0.0, *(mover.factor for mover in movers)])
        self.offset = np.array([0.0, *(mover.offset for mover in movers)])
        self.axis = np.array([np.zeros(3), *(mover.axis for mover in movers)])
        self.sliding = np.array([n for n, mover in enumerate(movers, 1) if mover.slides], dtype=int)
        self.carries = np.zeros((m, m), dtype=bool)
        self._chained = [
            (number, p) for number, p in enumerate(self.parent.tolist()) if p != GROUND
        ]
        # For turning joints T_parent_mover @ exp(hat(axis) angle) = A + sin angle * B + cos angle *
        # C, for sliding joints A + value * B.
        self.T_parent_mover = A = np.array([np.eye(4), *(mover.T_parent_mover for mover in movers)])
        hats = np.zeros((m, 4, 4))
        for number, mover in enumerate(movers, 1):
            self.carries[number] = self.carries[mover.parent]
            self.carries[number, number] = True
            if mover.slides:
                hats[number, :3, 3] = mover.axis
            else:
                hats[number, :3, :3] = so3.hat(mover.axis)
        B = A @ hats
        C = -B @ hats
        self._terms = np.stack((A - C, B, C), axis=1).reshape(m, 3, 16)

    def poses(self, x: FloatArray) -> FloatArray:
        """Return the poses T_base_mover (m, 4, 4) of all groups at ``x`` (k,)."""
        angles = self.factor * x[self.variable] + self.offset
        fractions = np.ones((self.count, 1, 3))
        np.sin(angles, out=fractions[:, 0, 1])
        np.cos(angles, out=fractions[:, 0, 2])
        if self.sliding.size:
            fractions[self.sliding, 0, 1] = angles[self.sliding]
        T = list((fractions @ self._terms).reshape(-1, 4, 4))
        for number, parent in self._chained:
            T[number] = T[parent] @ T[number]
        return np.array(T)

    def turned(self, change: FloatArray) -> float:
        """Return the largest sum [rad] of the turns between the ground and a group.

        The joints of other branches do not move a body, so their turns are not added.
        ``change``: (k,) difference of two places x; sliding joints count with 1 rad per metre.
        """
        return float((self.carries @ np.abs(self.factor * change[self.variable])).max())

    def turning_about(self, direction: FloatArray) -> npt.NDArray[np.int64]:
        """Return for each group (m,) the first group on the way to it from the ground.

        It is GROUND if that group does not turn about ``direction`` (3,), a unit vector.
        """
        T = self.poses(np.zeros(int(self.variable.max()) + 1))
        axes = np.einsum("mij,mj->mi", T[:, :3, :3], self.axis)
        turns = np.linalg.norm(np.cross(axes, direction), axis=1) <= PARALLEL_SINE
        turns[[GROUND, *self.sliding]] = False
        first = np.zeros(self.count, dtype=np.int64)
        for group, parent in enumerate(self.parent.tolist()):
            first[group] = first[parent] if parent != GROUND else group if turns[group] else GROUND
        return first

    def variables_between(self, a: int, b: int) -> frozenset[int]:
        """Return the indices of x that change the pose of group ``b`` relative to group ``a``."""
        joints = self.carries[a] ^ self.carries[b]
        return frozenset(int(variable) for variable in self.variable[joints])
