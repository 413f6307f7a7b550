"""Straight ways of the joints from via to via, their corners rounded."""

from __future__ import annotations

import math
from bisect import bisect_right
from dataclasses import dataclass, field

import numpy as np

from app import tolerances
from app.errors import InputError
from app.geometry.arrays import FloatArray, finite_array, frozen
from app.kinematics.arm import arm_of
from app.kinematics.chain import Chain
from app.planning.jet import Jet
from app.planning.posture import FiveJets, ThreeJets, tool_point

SAME = 1e-9
"""[rad] Vias nearer to each other are one."""

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
"""From the control points of a Bezier curve of degree 5 to its coefficients, lowest power first."""

STRETCH = 2.5
"""[1] How much of sigma a corner takes, to its reach along either leg, for its ends to be passed as
quickly as the legs are."""


@dataclass(frozen=True, eq=False)
class JointPath:
    """From via to via on straight lines in joint space, round each corner on a quintic.

    A corner is a Bezier curve of degree 5 whose control points lie on the two legs, three evenly
    spaced on each, the last of the one and the first of the other in the via: so it leaves and
    meets the legs with their rates and without acceleration, and stays in the triangle that it cuts
    off (Farin, Curves and Surfaces for CAGD, 2002, ch. 5). With its vias inside the limits the path
    is. Inner vias are passed by, the nearer the smaller the blend.

    chain: the arm with its tool. vias: (m, 5) [rad], the first and last are start and end. blend:
    (m - 2,) how much of half of its shorter leg each corner cuts off, above 0 up to 1.
    """

    chain: Chain
    vias: FloatArray
    blend: FloatArray = field(default_factory=lambda: np.empty(0))
    _starts: list[float] = field(init=False, repr=False)
    _terms: FloatArray = field(init=False, repr=False)
    _total: float = field(init=False, repr=False)

    def __post_init__(self) -> None:
        vias = np.array([self.chain.check_q(q) for q in self.vias])
        if len(vias) < 2 or (np.abs(np.diff(vias, axis=0)).max(axis=1) <= SAME).any():
            raise InputError("A path needs two vias at least, each of them elsewhere.")
        for number, q in enumerate(vias):
            if not self.chain.within_limits(q):
                beyond = np.maximum(self.chain.lower - q, q - self.chain.upper)
                axis = int(beyond.argmax())
                raise InputError(
                    f"Via {number + 1} has axis {axis + 1} at {math.degrees(q[axis]):.1f} deg, "
                    f"{math.degrees(beyond[axis]):.2g} deg beyond its limit."
                )
        object.__setattr__(self, "vias", frozen(vias))
        blend = finite_array(self.blend, (len(vias) - 2,), "The blend of the corners")
        if not ((blend > 0.0) & (blend <= 1.0)).all():
            raise InputError(f"A blend is above 0 and up to 1, not {blend.tolist()}.")
        object.__setattr__(self, "blend", frozen(blend))
        self._lay()

    @property
    def start(self) -> FloatArray:
        """(5,) where it begins [rad]."""
        return frozen(self.vias[0])

    @property
    def end(self) -> FloatArray:
        """(5,) where it ends [rad]."""
        return frozen(self.vias[-1])

    @property
    def joins(self) -> tuple[float, ...]:
        """Where legs and corners meet."""
        return tuple(start / self._total for start in self._starts[1:])

    def joints(self, sigma: Jet) -> FiveJets:
        """The joint angles [rad] at `sigma`, one place or many (N,)."""
        t = self._total * sigma
        if isinstance(t.c0, float):
            piece = max(bisect_right(self._starts, t.c0) - 1, 0)
            local, terms = t - self._starts[piece], self._terms[piece].T.tolist()
        else:
            pieces = np.maximum(np.searchsorted(self._starts, t.c0, side="right") - 1, 0)
            local = t - np.array(self._starts)[pieces]
            terms = self._terms[pieces].transpose(2, 1, 0)
        one, two, three, four, five = (_polynomial(row, local) for row in terms)
        return one, two, three, four, five

    def point(self, sigma: Jet) -> ThreeJets:
        """The tool point [m], in {C}."""
        arm = arm_of(self.chain)
        one, two, three, four, five = (
            sign * q + shift
            for q, sign, shift in zip(self.joints(sigma), arm.signs, arm.shifts, strict=True)
        )
        return tool_point(arm, (one, two, three, four, five))

    def _lay(self) -> None:
        """Legs and corners as polynomials, each from 0 of its own share of sigma."""
        legs = np.diff(self.vias, axis=0)
        # As long as a leg takes at full speed, so that none is run through in no time.
        lengths = (np.abs(legs) / self.chain.speed).max(axis=1)
        rates = legs / lengths[:, None]
        cut = np.zeros(len(self.vias))
        cut[1:-1] = 0.5 * self.blend * np.minimum(lengths[:-1], lengths[1:])
        starts, terms, at = [], [], 0.0
        for leg, (rate, length) in enumerate(zip(rates, lengths.tolist(), strict=True)):
            straight = length - cut[leg] - cut[leg + 1]
            if straight > tolerances.ROUNDING * length:
                line = np.zeros((6, len(rate)))
                line[0], line[1] = self.vias[leg] + cut[leg] * rate, rate
                starts.append(at)
                terms.append(line)
                at += float(straight)
            if leg + 1 < len(legs):
                reach, via = cut[leg + 1], self.vias[leg + 1]
                before, after = via - reach * rate, via + reach * rates[leg + 1]
                points = (before, 0.5 * (before + via), via, via, 0.5 * (via + after), after)
                lasts = STRETCH * float(reach)
                starts.append(at)
                terms.append((QUINTIC @ np.array(points)) / lasts ** np.arange(6.0)[:, None])
                at += lasts
        object.__setattr__(self, "_starts", starts)
        object.__setattr__(self, "_terms", frozen(terms))
        object.__setattr__(self, "_total", at)


def _polynomial(terms: list[float] | FloatArray, t: Jet) -> Jet:
    """By Horner's rule; `terms` of the lowest power first, floats or (6, N)."""
    found = Jet.constant(terms[5])
    for term in (terms[4], terms[3], terms[2], terms[1], terms[0]):
        found = found * t + term
    return found
