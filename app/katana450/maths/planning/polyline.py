"""Straight legs from via to via in any coordinates, each corner rounded by a quintic."""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass, field

import numpy as np

from katana450 import tolerances
from katana450.errors import InputError
from katana450.maths.geometry.arrays import FloatArray, finite_array, frozen
from katana450.maths.planning.jet import Jet

QUINTIC = np.array(
    [
        [1.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        [-5.0, 5.0, 0.0, 0.0, 0.0, 0.0],
        [10.0, -20.0, 10.0, 0.0, 0.0, 0.0],
        [-10.0, 30.0, -30.0, 10.0, 0.0, 0.0],
        [5.0, -20.0, 30.0, -20.0, 5.0, 0.0],
        [-1.0, 5.0, -10.0, 10.0, -5.0, 1.0],
    ]
)
"""The map from the control points of a Bezier curve of degree 5 to its coefficients, lowest power
first."""

STRETCH = 2.5
"""Ratio [1] of a corner's length in sigma to its reach along either leg, which makes the speed at
its ends equal to that of the legs."""


class PiecewisePolynomial:
    """Coordinates as polynomials, each on a piece of sigma from 0 to 1."""

    def __init__(self, starts: list[float], terms: FloatArray, total: float) -> None:
        """Take the starts (K,) of the pieces, up to ``total``, and their terms (K, k, n).

        The terms of a piece are those of the powers of its own part, the lowest first.
        """
        self._starts, self._terms, self._total = starts, terms, total

    @property
    def joins(self) -> tuple[float, ...]:
        """The places where pieces meet."""
        return tuple(start / self._total for start in self._starts[1:])

    def at(self, sigma: Jet) -> tuple[Jet, ...]:
        """Return the n coordinates at `sigma`, one place or many (N,)."""
        t = self._total * sigma
        if isinstance(t.c0, float):
            piece = max(bisect_right(self._starts, t.c0) - 1, 0)
            local, terms = t - self._starts[piece], self._terms[piece].T.tolist()
        else:
            pieces = np.maximum(np.searchsorted(self._starts, t.c0, side="right") - 1, 0)
            local = t - np.array(self._starts)[pieces]
            terms = self._terms[pieces].transpose(2, 1, 0)
        return tuple(polynomial(row, local) for row in terms)


@dataclass(frozen=True, eq=False)
class Polyline(PiecewisePolynomial):
    """Straight legs from via to via, with a quintic round each corner.

    A corner is a Bezier curve of degree 5. Its control points lie on the two legs, three evenly
    spaced on each; the last of the first leg and the first of the second leg are the via. It
    therefore leaves and meets the legs with their rates and without acceleration, and stays in the
    triangle that it cuts off (Farin, Curves and Surfaces for CAGD, 2002, ch. 5). The path passes
    beside inner vias, the nearer the smaller the blend.

    Attributes:
        vias: (m, n), the first and last are start and end.
        lengths: length (m - 1,) of each leg in sigma, relative to the others.
        blend: fraction (m - 2,) of half of its shorter leg that each corner cuts off, above 0 up to
            1.
    """

    vias: FloatArray
    lengths: FloatArray
    blend: FloatArray
    _starts: list[float] = field(init=False, repr=False)
    _terms: FloatArray = field(init=False, repr=False)
    _total: float = field(init=False, repr=False)

    def __post_init__(self) -> None:
        blend = finite_array(self.blend, (len(self.vias) - 2,), "The blend of the corners")
        if not ((blend > 0.0) & (blend <= 1.0)).all():
            raise InputError(f"A blend must be above 0 and at most 1, not {blend.tolist()}.")
        object.__setattr__(self, "blend", frozen(blend))
        self._build()

    def _build(self) -> None:
        """Build legs and corners as polynomials, each from 0 of its own part of sigma."""
        vias, lengths = self.vias, self.lengths
        rates = np.diff(vias, axis=0) / lengths[:, None]
        cut = np.zeros(len(vias))
        cut[1:-1] = 0.5 * self.blend * np.minimum(lengths[:-1], lengths[1:])
        starts, terms, station = [], [], 0.0
        for leg, (rate, length) in enumerate(zip(rates, lengths.tolist(), strict=True)):
            straight = length - cut[leg] - cut[leg + 1]
            if straight > tolerances.ROUNDING * length:
                line = np.zeros((6, len(rate)))
                line[0], line[1] = vias[leg] + cut[leg] * rate, rate
                starts.append(station)
                terms.append(line)
                station += float(straight)
            if leg + 1 < len(rates):
                reach, via = cut[leg + 1], vias[leg + 1]
                before, after = via - reach * rate, via + reach * rates[leg + 1]
                points = (before, 0.5 * (before + via), via, via, 0.5 * (via + after), after)
                corner_length = STRETCH * float(reach)
                starts.append(station)
                curve = QUINTIC @ np.array(points)
                terms.append(curve / corner_length ** np.arange(6.0)[:, None])
                station += corner_length
        object.__setattr__(self, "_starts", starts)
        object.__setattr__(self, "_terms", frozen(terms))
        object.__setattr__(self, "_total", station)


def polynomial(terms: list[float] | FloatArray, t: Jet) -> Jet:
    """Return the polynomial of `terms`, the lowest power first, at `t` by Horner's rule."""
    b0, b1, b2, b3 = t.c0, t.c1, t.c2, t.c3
    a0, a1, a2, a3 = terms[-1], 0.0, 0.0, 0.0
    for term in terms[-2::-1]:
        # Without a jet of each product, because this runs for each joint at each place of a path.
        a3 = a0 * b3 + a1 * b2 + a2 * b1 + a3 * b0
        a2 = a0 * b2 + a1 * b1 + a2 * b0
        a1 = a0 * b1 + a1 * b0
        a0 = a0 * b0 + term
    return Jet(a0, a1, a2, a3)
