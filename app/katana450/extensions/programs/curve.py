"""Curves of the tool: its point, pitch and roll as functions of one parameter.

Each curve is a formula of sigma, which runs from 0 to 1, and is evaluated on jets. Every place on
it is therefore exact, and so are its derivatives. Lengths in m, angles in rad, frame {S}.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from katana450.caching import cached_property
from katana450.errors import InputError
from katana450.maths.geometry.arrays import FloatArray, finite_array, frozen
from katana450.maths.kinematics.tool import ToolTarget
from katana450.maths.planning.jet import Jet, sin_cos

Profile = Callable[[Jet], Jet]
"""An angle along a curve [rad], as a function of sigma."""


class ToolCoordinates(NamedTuple):
    """The five freedoms of the tool as jets: the tool point x, y, z in {S}, pitch and roll."""

    x: Jet
    y: Jet
    z: Jet
    pitch: Jet
    roll: Jet


class Curve(Protocol):
    """The tool along a path."""

    @property
    def joins(self) -> tuple[float, ...]:
        """The places between 0 and 1 where one formula ends and another begins, in rising order."""
        ...

    def at(self, sigma: Jet) -> ToolCoordinates:
        """Return the tool at `sigma`, one place or many."""
        ...


@dataclass(frozen=True)
class Linear:
    """An angle that changes evenly from `start` to `end` [rad]; constant where they are equal."""

    start: float
    end: float

    def __post_init__(self) -> None:
        finite_array((self.start, self.end), (2,), "The ends of an angle's profile")

    def __call__(self, sigma: Jet) -> Jet:
        """Return the angle [rad] at `sigma`."""
        return self.start + (self.end - self.start) * sigma


@dataclass(frozen=True, eq=False)
class ToolLine:
    """A straight path from one target to another, on which pitch and roll turn evenly.

    With both targets at one point the tool only turns, as when a cup is emptied.
    """

    start: ToolTarget
    end: ToolTarget

    def __post_init__(self) -> None:
        for name, target in (("start", self.start), ("end", self.end)):
            numbers = np.append(target.position, (target.pitch, target.roll))
            finite_array(numbers, (5,), f"The {name} of a line")

    @property
    def joins(self) -> tuple[float, ...]:
        """No joins: the line is one formula."""
        return ()

    def at(self, sigma: Jet) -> ToolCoordinates:
        """Return the tool at `sigma`, one place or many."""
        x, y, z = (
            a + (b - a) * sigma
            for a, b in zip(self.start.position.tolist(), self.end.position.tolist(), strict=True)
        )
        pitch = Linear(self.start.pitch, self.end.pitch)(sigma)
        return ToolCoordinates(x, y, z, pitch, Linear(self.start.roll, self.end.roll)(sigma))


@dataclass(frozen=True, eq=False)
class ToolArc:
    """A turn of the tool point by `angle` [rad] about an axis, also by more than a whole circle.

    Attributes:
        start: first point (3,) [m].
        centre, axis: a point (3,) on the axis [m] and its direction (3,).
        angle: the angle of the turn [rad].
        pitch, roll: pitch and roll of the tool along the arc.
        climb: motion along the axis over the whole turn [m].
    """

    start: FloatArray
    centre: FloatArray
    axis: FloatArray
    angle: float
    pitch: Profile
    roll: Profile
    climb: float = 0.0

    def __post_init__(self) -> None:
        for name, what in (("start", "start"), ("centre", "centre"), ("axis", "axis")):
            value = finite_array(getattr(self, name), (3,), f"The {what} of an arc")
            object.__setattr__(self, name, frozen(value))
        finite_array((self.angle, self.climb), (2,), "Angle and climb of an arc")
        length = math.hypot(*self.axis)
        if length == 0.0:
            raise InputError("The axis of an arc is zero; give it a direction.")
        object.__setattr__(self, "axis", frozen(self.axis / length))

    @property
    def joins(self) -> tuple[float, ...]:
        """No joins: the arc is one formula."""
        return ()

    def at(self, sigma: Jet) -> ToolCoordinates:
        """Return the tool at `sigma`, one place or many."""
        s, c = sin_cos(self.angle * sigma)
        x, y, z = (c * u + s * v + (f + k * sigma) for u, v, f, k in self._terms)
        return ToolCoordinates(x, y, z, self.pitch(sigma), self.roll(sigma))

    @cached_property
    def _terms(self) -> list[list[float]]:
        """The terms of x, y, z: with the cosine, with the sine, constant, with sigma."""
        arm = self.start - self.centre
        along = (arm @ self.axis) * self.axis
        # The quarter turn of a radius has its length, so this is a circle to rounding.
        terms = arm - along, np.cross(self.axis, arm), self.centre + along, self.climb * self.axis
        rows: list[list[float]] = np.stack(terms, axis=1).tolist()
        return rows
