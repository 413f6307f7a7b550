"""The one kind of arm the closed forms cover, and its lengths, read off a chain."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from app import tolerances
from app.errors import RobotDescriptionError
from app.geometry import screws
from app.geometry.arrays import FloatArray
from app.geometry.vectors import Vector, vector
from app.kinematics.chain import Chain


@dataclass(frozen=True)
class Axis:
    """A joint axis at q = 0 in {S}: unit direction `omega` and a point `r` [m] on it."""

    omega: Vector
    r: Vector


@dataclass(frozen=True)
class FiveAxisArm:
    """A 5R arm in the paper's Fig. 2: axes z, y, y, y, x, stretched along +x of {S} at q = 0.

    l1: shoulder (axes 1 and 2 cross) to elbow (axis 3). l2: elbow to wrist (axes 4 and 5 cross).
    l3: wrist to tool point; all [m]. axes: the five joint axes. wrist, tool: those points at q = 0
    in {S} [m].
    """

    l1: float
    l2: float
    l3: float
    axes: tuple[Axis, Axis, Axis, Axis, Axis]
    wrist: Vector
    tool: Vector


def _refuse(what: str, value: float, unit: str) -> None:
    if abs(value) > tolerances.ARM_GEOMETRY:
        raise RobotDescriptionError(
            f"The closed-form kinematics do not cover this arm: {what} by {value:.3g} {unit}."
        )


_DIRECTIONS = {"z": (0.0, 0.0, 1.0), "y": (0.0, 1.0, 0.0), "x": (1.0, 0.0, 0.0)}


def _check_directions(chain: Chain) -> None:
    for i, name in enumerate("zyyyx"):
        off = float(np.linalg.norm(chain.S[:3, i] - _DIRECTIONS[name]))
        _refuse(f"axis {i + 1} must point along +{name} of {{S}} and is off", off, "rad")
    off = float(np.linalg.norm(chain.M[:3, 0] - _DIRECTIONS["x"]))
    _refuse("the tool's x axis must lie along axis 5 and is off", off, "rad")


def _check_crossings(points: FloatArray, tool: FloatArray) -> None:
    _refuse("axis 1 must pass through the origin of {S} and misses it", _size(points[0]), "m")
    _refuse("axis 2 must cross axis 1 in the origin of {S} and misses it", _size(points[1]), "m")
    _refuse("axis 3 must be level with axis 2 at q = 0 and is off", float(points[2][2]), "m")
    _refuse("axis 4 must be level with axis 2 at q = 0 and is off", float(points[3][2]), "m")
    _refuse("axis 5 must cross axis 4 and the x axis of {S} and misses them", _size(points[4]), "m")
    _refuse("the tool point must lie on axis 5 and is off", _size(tool[1:]), "m")


def _size(v: FloatArray) -> float:
    return float(np.linalg.norm(v))


@lru_cache(maxsize=16)
def arm_of(chain: Chain) -> FiveAxisArm:
    """The arm `chain` describes, checked once a chain.

    Raises RobotDescriptionError that names the axis at fault and by how much.
    """
    if chain.n != 5:
        raise RobotDescriptionError(
            f"The closed-form kinematics need five joints; this arm has {chain.n}."
        )
    _check_directions(chain)
    points = np.array([screws.point_on(chain.S[:, i]) for i in range(5)])
    tool = chain.M[:3, 3]
    _check_crossings(points, tool)
    elbow, wrist, tip = float(points[2][0]), float(points[3][0]), float(tool[0])
    lengths = (elbow, wrist - elbow, tip - wrist)
    for name, length in zip(("elbow", "wrist", "tool point"), lengths, strict=True):
        if length <= tolerances.ARM_GEOMETRY:
            raise RobotDescriptionError(
                f"The {name} must lie farther out along x than the joint before it at q = 0; "
                f"it lies {length:.6g} m from it."
            )
    if not (-np.pi <= chain.lower[2] <= 0.0 <= chain.upper[2] <= np.pi):
        raise RobotDescriptionError(
            f"The limits of axis 3 are {chain.lower[2]:g} to {chain.upper[2]:g} rad; they must "
            "hold the stretched arm (0) and stay within one turn (-pi to pi)."
        )
    one, two, three, four, five = (
        Axis(vector(chain.S[:3, i]), vector(points[i])) for i in range(5)
    )
    return FiveAxisArm(*lengths, (one, two, three, four, five), vector(points[3]), vector(tool))
