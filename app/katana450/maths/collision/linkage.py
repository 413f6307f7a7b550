"""The moving pieces of an arm as a tree of turning and sliding joints, and where each is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from katana450.maths.geometry import so3
from katana450.maths.geometry.arrays import FloatArray

GROUND = 0
"""Index of the piece that stands still: the root link and all that is fixed to it."""


@dataclass(frozen=True, eq=False)
class RigidGroup:
    """Bodies that move as one piece about one joint.

    Attributes:
        parent: index of the piece it hangs on, smaller than its own.
        T_parent_mover: (4, 4) where it is while its joint is at zero [m].
        axis: (3,) unit direction of the joint in its own frame, through its origin.
        variable: index in x of what drives the joint.
        factor, offset: the joint's value is factor * x[variable] + offset [rad or m].
        slides: whether it moves along the axis instead of turning about it.
    """

    parent: int
    T_parent_mover: FloatArray
    axis: FloatArray
    variable: int
    factor: float = 1.0
    offset: float = 0.0
    slides: bool = False


class Linkage:
    """Movers numbered from 1, parents first; x (k,) [rad, or m for what slides] drives them.

    Attributes:
        sliding: (s,) indices of the pieces that slide.
        parent: (m,) of each piece; the ground is its own.
        carries: (m, m) bool, whether the joint of the second moves the first.
    """

    def __init__(self, movers: Sequence[RigidGroup]) -> None:
        m = len(movers) + 1
        self.count = m
        self.parent = np.array([GROUND, *(mover.parent for mover in movers)])
        self.variable = np.array([0, *(mover.variable for mover in movers)])
        self.factor = np.array([0.0, *(mover.factor for mover in movers)])
        self._offset = np.array([0.0, *(mover.offset for mover in movers)])
        self.axis = np.array([np.zeros(3), *(mover.axis for mover in movers)])
        self.sliding = np.array([n for n, mover in enumerate(movers, 1) if mover.slides], dtype=int)
        self.carries = np.zeros((m, m), dtype=bool)
        self._chained = [
            (number, p) for number, p in enumerate(self.parent.tolist()) if p != GROUND
        ]
        # T_parent_mover @ exp(hat(axis) angle) = A + sin angle * B + cos angle * C, and of what
        # slides A + value * B.
        A = np.array([np.eye(4), *(mover.T_parent_mover for mover in movers)])
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
        """T_base_mover (m, 4, 4) of every piece at ``x`` (k,)."""
        angles = self.factor * x[self.variable] + self._offset
        fractions = np.ones((self.count, 1, 3))
        np.sin(angles, out=fractions[:, 0, 1])
        np.cos(angles, out=fractions[:, 0, 2])
        if self.sliding.size:
            fractions[self.sliding, 0, 1] = angles[self.sliding]
        T = list((fractions @ self._terms).reshape(-1, 4, 4))
        for number, parent in self._chained:
            T[number] = T[parent] @ T[number]
        return np.array(T)

    def variables_between(self, a: int, b: int) -> frozenset[int]:
        """Which entries of x change where ``b`` is, seen from ``a``."""
        joints = self.carries[a] ^ self.carries[b]
        return frozenset(int(variable) for variable in self.variable[joints])
