"""A way of the joints without time: their angles as a function of sigma, from 0 to 1."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.chain import Chain
from katana450.maths.planning.jet import Jet
from katana450.maths.planning.posture import FiveJets, ThreeJets


class Path(Protocol):
    """The joints along a way, twice smooth: their third derivative is bounded.

    chain: the arm with the tool whose point counts.
    """

    @property
    def chain(self) -> Chain: ...

    @property
    def start(self) -> FloatArray:
        """(5,) where it begins [rad]."""
        ...

    @property
    def end(self) -> FloatArray:
        """(5,) where it ends [rad]."""
        ...

    @property
    def joins(self) -> tuple[float, ...]:
        """Where between 0 and 1 the third derivative leaps, growing."""
        ...

    def joints(self, sigma: Jet) -> FiveJets:
        """The joint angles [rad] at `sigma`, one place or many (N,)."""
        ...

    def point(self, sigma: Jet) -> ThreeJets:
        """The tool point [m], in a frame that stands still."""
        ...


def joint_derivatives(path: Path, sigma: FloatArray) -> FloatArray:
    """(4, N, 5) the joint angles at `sigma` (N,) and their first three derivatives by it."""
    return _stacked(path.joints(Jet.variable(sigma)), sigma)


def point_derivatives(path: Path, sigma: FloatArray) -> FloatArray:
    """(4, N, 3) the same of the tool point [m]."""
    return _stacked(path.point(Jet.variable(sigma)), sigma)


def _stacked(jets: tuple[Jet, ...], sigma: FloatArray) -> FloatArray:
    found = np.empty((4, len(sigma), len(jets)))
    for number, jet in enumerate(jets):
        for order, values in enumerate(jet.derivatives()):
            found[order, :, number] = values
    return found
