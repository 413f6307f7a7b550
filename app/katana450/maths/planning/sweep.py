"""The motion along a path: the arm at a place, and bounds on the joint turns between two places."""

from __future__ import annotations

import numpy as np

from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.planning.clearance import FINE, Clearance, SweptClearance
from katana450.maths.planning.jet import Jet
from katana450.maths.planning.path import Path, joint_derivatives

SWEEP_PIECES = 512
"""Number of pieces; in each of them the rates of the joints are bounded."""

MAX_DERIVATIVE_RATIO = 2.0
"""Maximum ratio [1] of the third derivative within a piece to that at its ends."""


class Sweep:
    """The motion along one path. Its methods are pure."""

    def __init__(self, path: Path) -> None:
        self._path = path
        even = np.linspace(0.0, 1.0, SWEEP_PIECES + 1)
        self._sigma = np.unique(np.concatenate((even, np.array(path.joins))))
        d = np.abs(joint_derivatives(path, self._sigma))
        h = np.diff(self._sigma)[:, None]
        rate, jerk = (np.maximum(each[:-1], each[1:]) for each in (d[1], d[3]))
        # Between its ends a function is above its chord by at most h^2 / 8 of its second
        # derivative.
        turns = h * (rate + MAX_DERIVATIVE_RATIO * h * h / 8.0 * jerk)
        self._turned = np.vstack((np.zeros(turns.shape[1]), np.cumsum(turns, axis=0)))

    def at(self, sigma: float, fingers: float) -> FloatArray:
        """Return the joints at `sigma` and the fixed angle of the `fingers`, (6,) [rad]."""
        joints = self._path.joints(Jet.variable(sigma))
        return np.array([*(each.c0 for each in joints), fingers])

    def nearest(self, room: SweptClearance, fingers: float) -> Clearance | None:
        """Return the nearest contact on the whole path; None when no parts can meet."""
        return room.nearest(lambda sigma: self.at(sigma, fingers), self.turned)

    def blocked(
        self,
        room: SweptClearance,
        fingers: float,
        low: float = 0.0,
        high: float = 1.0,
        fine: float = FINE,
    ) -> Clearance | None:
        """Return a place from `low` to `high` that is too near, as `SweptClearance.blocked`."""
        return room.blocked(lambda sigma: self.at(sigma, fingers), self.turned, low, high, fine)

    def turned(self, low: float, high: float) -> FloatArray:
        """Return a bound (6,) on the turn of each joint between two places [rad]."""
        return np.append(self._passed(high) - self._passed(low), 0.0)

    def _passed(self, sigma: float) -> FloatArray:
        """Return the bound on the turns (5,) from the start to `sigma`."""
        piece = int(np.searchsorted(self._sigma, sigma, side="right")) - 1
        piece = min(max(piece, 0), len(self._sigma) - 2)
        low, high = self._sigma[piece], self._sigma[piece + 1]
        fraction = (sigma - low) / (high - low)
        before, after = self._turned[piece], self._turned[piece + 1]
        return np.asarray(before + fraction * (after - before))
