"""Directions of a tool with four axes, in the upright plane of the arm."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from katana450.extensions.general_arms.closed_form import ClosedForm
from katana450.extensions.reachability.pose_solver import BoolArray, PoseSolver
from katana450.maths.geometry import so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.forward import forward

UPRIGHT: Final = 1e-6
"""[1] Cosine between axes 1 and 4 up to which the plane of the arm is upright."""

FACING: Final = 2
"""Number of branches whose shoulder faces the tool point; they come first."""


@dataclass(frozen=True, eq=False)
class PlaneDirections:
    """The directions that are tried for one arm.

    Attributes:
        form: its closed form.
        solver: the test of poses.
        turns: (2, K) the turn about axis 4 [rad] that gives each direction: if the shoulder faces
            the point, and if it has its back to it.
    """

    form: ClosedForm
    solver: PoseSolver
    turns: FloatArray

    @classmethod
    def of(
        cls, form: ClosedForm, solver: PoseSolver, steps: int, home: FloatArray
    ) -> PlaneDirections | None:
        """Return ``steps`` directions in a turn, and as the last that at ``home`` (4,) [rad].

        None for an arm whose plane is not upright.
        """
        chain = form.chain
        up, across = chain.S[:3, 0], chain.S[:3, 3]
        if abs(float(up @ across)) > UPRIGHT:
            return None
        outward = np.cross(up, across)
        # A turn about axis 4 adds to an angle in this plane.
        plane = np.stack((outward, np.cross(across, outward)))
        seen = plane @ chain.M[:3, :3]
        # The axis of the tool that lies in the plane; of two the first.
        axis = int(np.round(np.linalg.norm(seen, axis=0), 6).argmax())
        start = math.atan2(seen[1, axis], seen[0, axis])
        T = forward(chain, home)
        at_home = plane @ so3.exp(-float(home[0]) * up) @ T[:3, axis]
        there = math.atan2(at_home[1], at_home[0])
        away = np.array(form.solve(T, home.tolist())) - home
        away -= math.tau * np.round(away / math.tau)
        if int(np.abs(away).max(axis=1).argmin()) >= FACING:
            there = math.pi - there
        angles = np.append(np.linspace(0.0, math.tau, steps, endpoint=False), there)
        # Seen from the back of the arm, outward is opposite.
        return cls(form, solver, np.stack((angles - start, math.pi - angles - start)))

    def possible(self, p: FloatArray) -> BoolArray:
        """Return (N, K) whether each direction is possible at `p` (N, 3) [m] in {S}."""
        chain, count = self.form.chain, self.turns.shape[1]
        T = np.zeros((len(p), count, 4, 4))
        T[..., 3, 3] = 1.0
        T[..., :3, 3] = p[:, None]
        T[:, 0, :3, :3] = chain.M[:3, :3]
        # The point alone decides axis 1, apart from the side that faces it.
        pans = self.form.solve_batch(T[:, 0])[:, ::FACING, 0]
        found = np.zeros((len(p), count), dtype=np.bool)
        for pan, turns in zip(pans.T, self.turns, strict=True):
            turned = np.array([so3.exp(turn * chain.S[:3, 3]) for turn in turns])
            panned = np.array([so3.exp(angle * chain.S[:3, 0]) for angle in pan]).reshape(-1, 3, 3)
            T[..., :3, :3] = panned[:, None] @ (turned @ chain.M[:3, :3])
            found |= self.solver.taken(T.reshape(-1, 4, 4)).reshape(len(p), count)
        return found
