"""Straight joint paths from via to via, with rounded corners."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from katana450.errors import InputError
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.kinematics.chain import Chain
from katana450.maths.planning.jet import Jet
from katana450.maths.planning.polyline import PiecewisePolynomial, Polyline
from katana450.maths.planning.posture import (
    JointJets,
    ThreeJets,
    point_by_exponentials,
)

VIA_TOLERANCE = 1e-9
"""Vias nearer to each other than this [rad] are the same."""


class PolynomialPath:
    """A joint path whose joint angles are piecewise polynomials of sigma."""

    chain: Chain
    _line: PiecewisePolynomial

    @property
    def joins(self) -> tuple[float, ...]:
        """The places where pieces meet."""
        return self._line.joins

    def joints(self, sigma: Jet) -> JointJets:
        """Return the joint angles [rad] at `sigma`, one place or many (N,)."""
        return tuple(self._line.at(sigma))

    def point(self, sigma: Jet) -> ThreeJets:
        """Return the tool point [m] in {S}."""
        return point_by_exponentials(self.chain, self.joints(sigma))


@dataclass(frozen=True, eq=False)
class JointPath(PolynomialPath):
    """Straight lines in joint space from via to via, with corners rounded as in `Polyline`.

    The path is inside the limits, because its vias must be. Raises InputError for a via beyond a
    limit, and for vias that coincide.

    Attributes:
        chain: the arm with its tool.
        vias: (m, n) [rad], the first and last are start and end.
        blend: fraction (m - 2,) of half of its shorter leg that each corner cuts off, above 0 up to
            1.
    """

    chain: Chain
    vias: FloatArray
    blend: FloatArray = field(default_factory=lambda: np.empty(0))
    _line: Polyline = field(init=False, repr=False)

    def __post_init__(self) -> None:
        vias = np.array([self.chain.check_q(q) for q in self.vias])
        if len(vias) < 2 or (np.abs(np.diff(vias, axis=0)).max(axis=1) <= VIA_TOLERANCE).any():
            raise InputError("A path needs at least two vias, each different from the one before.")
        for number, q in enumerate(vias):
            if not self.chain.within_limits(q):
                beyond = np.maximum(self.chain.lower - q, q - self.chain.upper)
                axis = int(beyond.argmax())
                raise InputError(
                    f"Place {number + 1} of the path has axis {axis + 1} at "
                    f"{math.degrees(q[axis]):.1f} deg, "
                    f"{math.degrees(beyond[axis]):.4g} deg beyond its limit."
                )
        # A leg is as long as its duration at full speed, so that no leg has length 0.
        lengths = (np.abs(np.diff(vias, axis=0)) / self.chain.speed).max(axis=1)
        line = Polyline(frozen(vias), lengths, self.blend)
        object.__setattr__(self, "vias", line.vias)
        object.__setattr__(self, "blend", line.blend)
        object.__setattr__(self, "_line", line)

    @property
    def start(self) -> FloatArray:
        """The joint angles (n,) [rad] at the start."""
        return frozen(self.vias[0])

    @property
    def end(self) -> FloatArray:
        """The joint angles (n,) [rad] at the end."""
        return frozen(self.vias[-1])
