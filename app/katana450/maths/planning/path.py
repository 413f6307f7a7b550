"""A joint path without time: joint angles as a function of sigma, from 0 to 1."""

from __future__ import annotations

from abc import abstractmethod
from typing import Any, Protocol

import numpy as np

from katana450.caching import cached_property
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.kinematics.chain import Chain
from katana450.maths.planning.jet import Jet
from katana450.maths.planning.posture import JointJets, ThreeJets


class Path(Protocol):
    """A joint path that is twice continuously differentiable and has a bounded third derivative."""

    @property
    def chain(self) -> Chain:
        """The arm, with the tool whose point counts."""
        ...

    @property
    def start(self) -> FloatArray:
        """The joint angles (n,) [rad] at the start."""
        ...

    @property
    def end(self) -> FloatArray:
        """The joint angles (n,) [rad] at the end."""
        ...

    @property
    def joins(self) -> tuple[float, ...]:
        """The places between 0 and 1 where the third derivative leaps, in rising order."""
        ...

    def joints(self, sigma: Jet) -> JointJets:
        """Return the joint angles [rad] at `sigma`, one place or many (N,)."""
        ...

    def point(self, sigma: Jet) -> ThreeJets:
        """Return the tool point [m], in a fixed frame."""
        ...


class CurvePath:
    """A joint path that keeps the tool on a curve; the base of `ToolPath` and `PosePath`.

    Attributes:
        chain: the arm, with the tool.
        curve: the curve; `at` returns x, y and z of the tool point [m] first.
    """

    chain: Chain
    curve: Any

    @property
    def joins(self) -> tuple[float, ...]:
        """The joins of the curve."""
        joins: tuple[float, ...] = self.curve.joins
        return joins

    @abstractmethod
    def joints(self, sigma: Jet) -> JointJets:
        """Return the joint angles [rad] at `sigma`, one place or many (N,)."""

    @abstractmethod
    def turned_off(self, sigma: FloatArray, q: FloatArray) -> FloatArray:
        """Return the angles (N,) [rad] between the tool at `q` (N, n) and at ``sigma`` (N,)."""

    @cached_property
    def start(self) -> FloatArray:
        """The joint angles (n,) [rad] at the start."""
        return frozen([angle.c0 for angle in self.joints(Jet.variable(0.0))])

    @cached_property
    def end(self) -> FloatArray:
        """The joint angles (n,) [rad] at the end."""
        return frozen([angle.c0 for angle in self.joints(Jet.variable(1.0))])

    def point(self, sigma: Jet) -> ThreeJets:
        """Return the tool point in {S} [m]."""
        x, y, z, *_ = self.curve.at(sigma)
        return x, y, z


def joint_derivatives(path: Path, sigma: FloatArray) -> FloatArray:
    """Return the joint angles at `sigma` (N,) and their first three derivatives, (4, N, n)."""
    return _stacked(path.joints(Jet.variable(sigma)), sigma)


def point_derivatives(path: Path | CurvePath, sigma: FloatArray) -> FloatArray:
    """Return the tool point [m] at `sigma` (N,) and its first three derivatives, (4, N, 3)."""
    return _stacked(path.point(Jet.variable(sigma)), sigma)


def _stacked(jets: tuple[Jet, ...], sigma: FloatArray) -> FloatArray:
    stacked = np.empty((4, len(sigma), len(jets)))
    for number, jet in enumerate(jets):
        for order, values in enumerate(jet.derivatives()):
            stacked[order, :, number] = values
    return stacked
