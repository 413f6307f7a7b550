"""A joint path that keeps the tool of any arm on a curve of poses."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final

import numpy as np

from katana450.errors import InputError
from katana450.extensions.programs.pose_curve import PoseCurve
from katana450.maths.geometry import so3
from katana450.maths.geometry.arrays import FloatArray, finite_array, frozen
from katana450.maths.kinematics.batch import forward_batch
from katana450.maths.kinematics.chain import Chain
from katana450.maths.planning.jet import Jet
from katana450.maths.planning.path import CurvePath
from katana450.maths.planning.polyline import PiecewisePolynomial
from katana450.maths.planning.posture import JointJets

SEPTIC: Final = np.array(
    [
        [35.0, -15.0, 2.5, -1.0 / 6.0],
        [-84.0, 39.0, -7.0, 0.5],
        [70.0, -34.0, 6.5, -0.5],
        [-20.0, 10.0, -2.0, 1.0 / 6.0],
    ]
)
"""The map from what a cubic lacks of value and three derivatives at 1 to the next four powers."""


class Pieces(PiecewisePolynomial):
    """Polynomials of seventh degree between places of sigma from 0 to 1."""

    def __init__(self, places: FloatArray, terms: FloatArray) -> None:
        """Take places (K,) and the terms (K - 1, 8, n) of each piece, from 0 of its own part."""
        self._starts: list[float] = places[:-1].tolist()
        self._terms = terms
        self._total = 1.0


@dataclass(frozen=True, eq=False)
class PosePath(CurvePath):
    """The joints that keep the tool on ``curve``.

    At `places` the joint angles and their first three derivatives are exact. Between two places
    each angle is the polynomial of seventh degree that they define; `CurveSearch` chooses the
    places so that it is off by less than 1e-10 rad.

    Attributes:
        chain: the arm with its tool.
        curve: the path of the tool.
        places: (K,) rising from 0 to 1.
        terms: (K - 1, 8, n) coefficients of each piece, from its own start, lowest power first.
        narrow: places at which joints turn so fast that the timing must look closely.
    """

    chain: Chain
    curve: PoseCurve
    places: FloatArray
    terms: FloatArray
    narrow: tuple[float, ...] = ()
    _pieces: Pieces = field(init=False, repr=False)

    def __post_init__(self) -> None:
        count = np.size(self.places)
        places = finite_array(self.places, (count,), "The places of a path")
        terms = finite_array(self.terms, (count - 1, 8, self.chain.n), "The terms of a path")
        if count < 2 or places[0] != 0.0 or places[-1] != 1.0 or (np.diff(places) <= 0.0).any():
            raise InputError("The places of a path must rise from 0 to 1.")
        object.__setattr__(self, "places", frozen(places))
        object.__setattr__(self, "terms", frozen(terms))
        object.__setattr__(self, "_pieces", Pieces(self.places, self.terms))

    @property
    def joins(self) -> tuple[float, ...]:
        """The joins of the curve, and the places at which the timing must look closely."""
        return tuple(sorted({*self.curve.joins, *self.narrow}))

    def joints(self, sigma: Jet) -> JointJets:
        """Return the joint angles [rad] at `sigma`, one place or many (N,)."""
        return self._pieces.at(sigma)

    @property
    def start(self) -> FloatArray:
        """The joint angles (n,) [rad] at the start."""
        return frozen(self.terms[0, 0])

    @property
    def end(self) -> FloatArray:
        """The joint angles (n,) [rad] at the end."""
        return frozen([each.c0 for each in self.joints(Jet.variable(1.0))])

    def turned_off(self, sigma: FloatArray, q: FloatArray) -> FloatArray:
        """Return the angles (N,) [rad] between the tool at `q` (N, n) and at ``sigma`` (N,)."""
        wanted = self.curve.at(Jet.variable(sigma)).T
        if self.chain.n < 6:
            axis = self.chain.S[:3, 0]
            wanted[:, :3, :3] = [
                so3.exp(axis * angle) @ R
                for angle, R in zip(q[:, 0].tolist(), wanted[:, :3, :3], strict=True)
            ]
        pairs = zip(forward_batch(self.chain, q), wanted, strict=True)
        return np.array([so3.angle(one[:3, :3], other[:3, :3]) for one, other in pairs])


def septics(places: FloatArray, left: FloatArray, right: FloatArray) -> FloatArray:
    """Return the terms (K - 1, 8, n) of the polynomials of seventh degree between ``places`` (K,).

    ``left``, ``right``: (4, K - 1, n) value and three derivatives at the ends of each piece.
    """
    h = np.diff(places)[:, None]
    powers = h ** np.arange(8.0)[:, None, None]
    factors = np.array((1.0, 1.0, 2.0, 6.0))[:, None, None]
    low = left * powers[:4] / factors
    cubic = low[0] + low[1] + low[2] + low[3]
    lacking = np.stack(
        (
            right[0] - cubic,
            h * right[1] - (low[1] + 2.0 * low[2] + 3.0 * low[3]),
            h**2 * right[2] - (2.0 * low[2] + 6.0 * low[3]),
            h**3 * right[3] - 6.0 * low[3],
        )
    )
    high = np.einsum("ij,jkn->ikn", SEPTIC, lacking)
    found: FloatArray = (np.concatenate((low, high)) / powers).transpose(1, 0, 2)
    return found
