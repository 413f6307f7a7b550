"""A serial arm in screw theory: a home pose, its joint axes and their limits."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass, field
from typing import Final

import numpy as np
import numpy.typing as npt

from katana450 import tolerances
from katana450.caching import cached_property
from katana450.errors import InputError, RobotDescriptionError
from katana450.maths.geometry import screws, se3
from katana450.maths.geometry.arrays import FloatArray, finite_array, real_array

_SWEEPS: Final = 50
"""Number of times that the points on all axes are moved for `Chain.reach`."""


@dataclass(frozen=True, eq=False)
class Chain:
    """A chain of joints that turn, or slide, in the fixed frame {S}.

    Arrays are copied and read-only. Raises RobotDescriptionError when the values do not describe a
    chain.

    Attributes:
        M: home configuration T_S_tool (4, 4) at q = 0.
        S: screw axes (omega, v) (6, n) in {S} at q = 0.
        lower, upper: joint limits (n,) [rad]; all angles are lengths [m] where a joint slides.
        speed: maximum joint speeds (n,) [rad/s].
        names: the n joint names.
    """

    M: FloatArray
    S: FloatArray
    lower: FloatArray
    upper: FloatArray
    speed: FloatArray
    names: tuple[str, ...]
    # exp(hat(S_i) q) = I + sin q * X_i + (1 - cos q) * X_i^2 for a pure rotation; (n, 4, 4) each.
    generators: FloatArray = field(init=False, repr=False)
    generators_squared: FloatArray = field(init=False, repr=False)

    def __post_init__(self) -> None:
        n = len(self.names)
        try:
            self._set("M", se3.validated(self.M, "the home configuration M"))
            self._set("S", finite_array(self.S, (6, n), "The screw axes S"))
            for name in ("lower", "upper", "speed"):
                self._set(name, finite_array(getattr(self, name), (n,), f"The array '{name}'"))
        except InputError as error:
            raise RobotDescriptionError(
                f"The description of the arm is invalid. {error}"
            ) from error
        if n == 0:
            raise RobotDescriptionError("The arm has no joints; name at least one.")
        object.__setattr__(self, "names", tuple(self.names))
        for i, label in enumerate(self._labels()):
            length = float(np.linalg.norm(self.axes[:, i]))
            travel = screws.pitch(self.S[:, i])
            if abs(length - 1.0) > tolerances.SCREW:
                raise RobotDescriptionError(
                    f"The direction of {label} has length {length:.9g}; it must be 1."
                )
            if abs(travel) > tolerances.SCREW:
                raise RobotDescriptionError(
                    f"The screw of {label} advances by {travel:.3g} m/rad; "
                    "only joints that turn or slide are supported."
                )
            if not self.lower[i] < self.upper[i]:
                raise RobotDescriptionError(
                    f"The limits of {label} are {self.lower[i]:g} to {self.upper[i]:g} rad; "
                    "the lower must be below the upper."
                )
            if not self.speed[i] > 0.0:
                raise RobotDescriptionError(
                    f"The speed limit of {label} is {self.speed[i]:g} rad/s; it must be above 0."
                )
        X = np.array([se3.hat(self.S[:, i]) for i in range(n)])
        self._set("generators", X)
        self._set("generators_squared", X @ X)

    def _set(self, name: str, value: FloatArray) -> None:
        value.setflags(write=False)
        object.__setattr__(self, name, value)

    def _labels(self) -> list[str]:
        return [f"axis {i + 1} ({name})" for i, name in enumerate(self.names)]

    @property
    def n(self) -> int:
        """The number of joints."""
        return len(self.names)

    @cached_property
    def slides(self) -> tuple[bool, ...]:
        """Flags (n,) of the prismatic joints."""
        return tuple(not axis.any() for axis in self.S[:3].T)

    @cached_property
    def axes(self) -> FloatArray:
        """(3, n) Directions in {S} about which the joints turn, or along which they slide."""
        return np.where(self.slides, self.S[3:], self.S[:3])

    def sines(self, q: FloatArray) -> FloatArray:
        """Return the factors (..., n) of the generators in the motion by `q` (..., n).

        They are the sines of angles, and the lengths by which joints slide.
        """
        return np.where(self.slides, q, np.sin(q)) if any(self.slides) else np.sin(q)

    @cached_property
    def reach(self) -> float:
        """An upper bound [m] on the distance of the tool point from the start of axis 1.

        A point on each axis keeps its distances from those on the axes beside it. The sum of these
        distances is a bound, and the points are those with the least sum: each lies where a string
        between its neighbours would pass the axis.
        """
        axes = self.axes.T
        points = [screws.point_on(S) for S in self.S.T] + [self.M[:3, 3]]
        for _ in range(_SWEEPS):
            for i in range(1, self.n):
                sides = np.array((points[i - 1], points[i + 1])) - points[i]
                along = sides @ axes[i]
                away = np.linalg.norm(sides - along[:, None] * axes[i], axis=1)
                weights = away[::-1] if away.any() else np.ones(2)
                points[i] = points[i] + axes[i] * float(along @ weights / weights.sum())
        travel = np.maximum(np.abs(self.lower), np.abs(self.upper)) @ self.slides
        return math.fsum(map(math.dist, points, points[1:])) + float(travel)

    def with_tool(self, M: npt.ArrayLike) -> Chain:
        """Return the same arm with another tool: `M` (4, 4) is the tool's pose in {S} at q = 0."""
        return dataclasses.replace(self, M=np.asarray(M))

    def check_q(self, q: npt.ArrayLike) -> FloatArray:
        """Return a float copy (n,) of `q` [rad]; raise InputError that names the axis at fault."""
        result = real_array(q, (self.n,), "The joint vector")
        if not np.isfinite(result).all():
            for label, angle in zip(self._labels(), result, strict=True):
                if not np.isfinite(angle):
                    raise InputError(
                        f"The joint vector has {angle} for {label}; give a finite angle."
                    )
        return result

    def within_limits(self, q: npt.ArrayLike, slack: float = tolerances.LIMIT_SLACK) -> bool:
        """Return True if `q` (n,) [rad] is inside its limits, or over by at most `slack` [rad]."""
        q = self.check_q(q)
        return bool(((q >= self.lower - slack) & (q <= self.upper + slack)).all())

    def clamp(self, q: npt.ArrayLike) -> FloatArray:
        """Return `q` (n,) [rad] with every angle set to the nearest one inside its limits."""
        return np.minimum(np.maximum(self.check_q(q), self.lower), self.upper)
