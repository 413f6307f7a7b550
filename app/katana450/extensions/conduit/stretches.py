"""The conduit that carries the arm's cables from link to link, as curves between its fittings.

Each stretch hangs between two links with one joint between them, so its shape depends on that
joint's angle alone. It is computed once for a row of angles and interpolated linearly between them.
"""

from __future__ import annotations

import functools
import json
import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from katana450.arm.robot.link import Link
from katana450.arm.robot.robot import Robot
from katana450.caching import cached_property
from katana450.errors import InputError, RobotDescriptionError
from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import FloatArray, finite_array

CONDUITS = "conduits.json"
"""File beside the URDF that describes where the conduit is held."""

ANGLES = 49
"""Number of angles for which a stretch is computed, about five degrees apart."""

PIECES = 24
"""Pieces of each half of a curve; a piece is shorter than the distance of the ribs."""

FULLNESS = 1.15
"""Ratio of the tangents at the ends of a half to its chord: between taut and slack."""

HALVINGS = 24
"""Steps of the bisection for the bulge of the middle; the error is less than a micrometre."""


SLACK_EXPONENT = 6.0
"""Order of the norm of slack and taut length: how sharply a slack curve becomes a taut one."""

STRETCH_FRACTION = 0.25
"""Fraction of its length by which a conduit with ribs can be stretched or compressed."""


@dataclass(frozen=True, eq=False)
class End:
    """The fixed end of a stretch: point (3,) [m] and unit tangent (3,) in the frame of a link."""

    link: str
    point: FloatArray
    tangent: FloatArray


class Hinge(NamedTuple):
    """The one joint between two links.

    Attributes:
        joint: its name.
        axis: (3,) in its own frame.
        lower, upper: limits [rad].
        T_start_joint: (4, 4) from the first link's frame to the joint's at zero [m].
        T_joint_end: (4, 4) from the joint's frame to the second link's [m].
    """

    joint: str
    axis: FloatArray
    lower: float
    upper: float
    T_start_joint: FloatArray
    T_joint_end: FloatArray


@dataclass(frozen=True, eq=False)
class ConduitStretch:
    """One free run of conduit.

    Attributes:
        start, end: its ends; the tangents lead from the first to the second.
        radius, length: [m], the length at rest.
        hinge: the joint between the two links.
        winds: whether the conduit lies around the axis of that joint. Its ribs are then stretched
            and compressed, by at most STRETCH_FRACTION.
    """

    start: End
    end: End
    radius: float
    length: float
    hinge: Hinge
    winds: bool

    @property
    def angles(self) -> FloatArray:
        """(ANGLES,) angles [rad] of the joint for which the stretch is computed."""
        return np.linspace(self.hinge.lower, self.hinge.upper, ANGLES)

    def between(self, angle: float) -> tuple[int, float]:
        """Return the index of the last of ``angles`` before ``angle`` [rad], and the remainder.

        The remainder is a fraction 0..1 of the step to the next angle.
        """
        lower, upper = self.hinge.lower, self.hinge.upper
        row = (min(max(angle, lower), upper) - lower) / (upper - lower) * (ANGLES - 1)
        low = min(int(row), ANGLES - 2)
        return low, row - low

    def courses(self, angles: Iterable[float], count: int) -> tuple[FloatArray, FloatArray]:
        """Return ``count`` points (A, n, 3) [m] evenly along the stretch, and unit tangents.

        One row for each of the A ``angles`` [rad] of its joint, in the frame of the first end's
        link. Tangents have the same shape as points.
        """
        rows = np.array([sum(self.between(angle)) for angle in angles])
        curves = _between(self._curves, rows, 0)
        spots = np.linspace(0.0, curves.shape[1] - 1.0, 2 * count + 1)[1::2]
        steps = np.diff(curves, axis=1)
        # Interpolate between the middles of pieces; otherwise the ribs tilt where pieces meet.
        leading = _between(steps, np.clip(spots - 0.5, 0.0, steps.shape[1] - 1.0), 1)
        leading /= np.linalg.norm(leading, axis=2, keepdims=True)
        return _between(curves, spots, 1), leading

    @cached_property
    def _curves(self) -> FloatArray:
        """(ANGLES, n, 3) points evenly along the conduit [m], for each of ``angles``."""
        hinge, angles = self.hinge, self.angles
        turns = [se3.from_rotation_translation(so3.exp(hinge.axis * a), ZERO) for a in angles]
        T = hinge.T_start_joint @ np.array(turns) @ hinge.T_joint_end
        q = T[:, :3, :3] @ self.end.point + T[:, :3, 3]
        b = T[:, :3, :3] @ self.end.tangent
        p, a = (np.broadcast_to(v, q.shape) for v in (self.start.point, self.start.tangent))
        if self.winds:
            return _even(self._wound(p, a, q, b, angles))
        chord = q - p
        outward = _across(a - b, chord)
        return _even(_of_length(self.length, p, a, q, b, outward, lambda curve: curve))

    def _wound(
        self, p: FloatArray, a: FloatArray, q: FloatArray, b: FloatArray, angles: FloatArray
    ) -> FloatArray:
        """Return curves around the joint's axis: plain curves in radius, arc and height."""
        frame = _frame_along(self.hinge.T_start_joint[:3, :3] @ self.hinge.axis)
        origin = self.hinge.T_start_joint[:3, 3]
        mean = float(np.linalg.norm(((p[0] - origin) @ frame)[:2]))

        def unrolled(point: FloatArray, tangent: FloatArray) -> tuple[FloatArray, FloatArray]:
            local, along = (point - origin) @ frame, tangent @ frame
            r = np.hypot(local[:, 0], local[:, 1])
            phi = np.arctan2(local[:, 1], local[:, 0])
            x, y = local[:, 0] / r, local[:, 1] / r
            direction = (x * along[:, 0] + y * along[:, 1], x * along[:, 1] - y * along[:, 0])
            return np.stack((r, phi, local[:, 2]), 1), np.stack((*direction, along[:, 2]), 1)

        def rolled(curve: FloatArray) -> FloatArray:
            r, phi, z = curve[..., 0], curve[..., 1] / mean, curve[..., 2]
            return origin + np.stack((r * np.cos(phi), r * np.sin(phi), z), -1) @ frame.T

        (first, a_lead), (last, b_lead) = unrolled(p, a), unrolled(q, b)
        # The angle follows that of the joint for more than half a turn in both directions.
        start = last[:, 1] - angles
        last[:, 1] = start - math.tau * np.round((start - first[:, 1]) / math.tau) + angles
        first[:, 1] *= mean
        last[:, 1] *= mean
        outward = np.broadcast_to((1.0, 0.0, 0.0), first.shape)
        minimum = (1.0 - STRETCH_FRACTION) * self.length
        return rolled(_of_length(minimum, first, a_lead, last, b_lead, outward, rolled))


ZERO = np.zeros(3)


def _of_length(
    length: float,
    p: FloatArray,
    a: FloatArray,
    q: FloatArray,
    b: FloatArray,
    outward: FloatArray,
    shown: Callable[[FloatArray], FloatArray],
) -> FloatArray:
    """Return curves (A, n, 3) from p to q whose middle bulges outward until they have ``length``.

    An almost taut curve is lengthened a little, so that its bulge does not vanish abruptly.
    ``shown`` maps the curves to the coordinates in which their length is measured.
    """

    def length_with(bulge: FloatArray) -> FloatArray:
        curve = shown(_arch(p, a, q, b, bulge[:, None] * outward))
        return np.asarray(np.linalg.norm(np.diff(curve, axis=1), axis=2).sum(axis=1))

    taut = length_with(np.zeros(len(p)))
    wanted = (taut**SLACK_EXPONENT + length**SLACK_EXPONENT) ** (1.0 / SLACK_EXPONENT)
    low, high = np.zeros(len(p)), wanted
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        short = length_with(middle) < wanted
        low, high = np.where(short, middle, low), np.where(short, high, middle)
    return _arch(p, a, q, b, low[:, None] * outward)


def _arch(
    p: FloatArray, a: FloatArray, q: FloatArray, b: FloatArray, bulge: FloatArray
) -> FloatArray:
    """Return two cubic Hermite pieces (A, n, 3) that meet at the middle, moved by ``bulge``."""
    middle = 0.5 * (p + q) + bulge
    chord = q - p
    direction = chord / np.linalg.norm(chord, axis=1, keepdims=True)
    first = FULLNESS * np.linalg.norm(middle - p, axis=1, keepdims=True)
    last = FULLNESS * np.linalg.norm(q - middle, axis=1, keepdims=True)
    one = _hermite(p, first * a, middle, first * direction)
    two = _hermite(middle, last * direction, q, last * b)
    return np.concatenate((one[:, :-1], two), axis=1)


def _hermite(p: FloatArray, a: FloatArray, q: FloatArray, b: FloatArray) -> FloatArray:
    t = np.linspace(0.0, 1.0, PIECES + 1)[None, :, None]
    p, a, q, b = (v[:, None] for v in (p, a, q, b))
    return np.asarray(
        (2 * t**3 - 3 * t**2 + 1) * p
        + (t**3 - 2 * t**2 + t) * a
        + (3 * t**2 - 2 * t**3) * q
        + (t**3 - t**2) * b
    )


def _even(curves: FloatArray) -> FloatArray:
    """Return the same curves with their points evenly spaced."""
    n = curves.shape[1]
    result = np.empty_like(curves)
    for curve, even in zip(curves, result, strict=True):
        along = np.concatenate(([0.0], np.cumsum(np.linalg.norm(np.diff(curve, axis=0), axis=1))))
        spots = np.linspace(0.0, along[-1], n)
        for k in range(3):
            even[:, k] = np.interp(spots, along, curve[:, k])
    return result


def _between(rows: FloatArray, spots: FloatArray, axis: int) -> FloatArray:
    """Interpolate ``rows`` linearly at ``spots`` (n,), which are indices along ``axis`` from 0."""
    low = np.minimum(spots.astype(int), rows.shape[axis] - 2)
    fraction = np.expand_dims(spots - low, (1, 2) if axis == 0 else (0, 2))
    first, second = rows.take(low, axis), rows.take(low + 1, axis)
    return np.asarray(first + fraction * (second - first))


def _across(v: FloatArray, chord: FloatArray) -> FloatArray:
    """Return unit vectors (A, 3): the components of ``v`` perpendicular to ``chord``."""
    along = chord / np.linalg.norm(chord, axis=1, keepdims=True)
    rest = v - (v * along).sum(axis=1, keepdims=True) * along
    return np.asarray(rest / np.linalg.norm(rest, axis=1, keepdims=True))


def _frame_along(axis: FloatArray) -> FloatArray:
    """Return a rotation matrix (3, 3) whose z axis is along ``axis``."""
    x = np.eye(3)[int(np.abs(axis).argmin())]
    y = np.cross(axis, x)
    y /= np.linalg.norm(y)
    return np.stack((np.cross(y, axis), y, axis), axis=1)


def read_stretches(path: Path, find: Callable[[str, str], Hinge]) -> tuple[ConduitStretch, ...]:
    """Read the stretches in a file of conduits, JSON with lengths in m.

    Args:
        path: the file; without it there are no stretches.
        find: returns the one joint between two links; raises KeyError if there is not exactly one.

    Raises:
        RobotDescriptionError: the file is invalid or describes another arm.
    """
    if not path.is_file():
        return ()
    try:
        stretches = json.loads(path.read_text(encoding="utf-8"))["conduits"]
        return tuple(_stretch(element, find) for element in stretches)
    except (InputError, KeyError, TypeError, ValueError) as error:
        raise RobotDescriptionError(f"{path} does not describe conduits: {error!r}.") from error


def _stretch(element: Any, find: Callable[[str, str], Hinge]) -> ConduitStretch:
    start, end = (
        End(
            str(one["link"]),
            finite_array(one["point"], (3,), "The point of a conduit"),
            finite_array(one["tangent"], (3,), "The tangent of a conduit"),
        )
        for one in element["ends"]
    )
    hinge = find(start.link, end.link)
    radius, length = float(element["radius"]), float(element["length"])
    if not 0.0 < radius < length < math.inf:
        raise ValueError(f"the radius {radius} m is not between 0 and the length {length} m")
    return ConduitStretch(start, end, radius, length, hinge, winds=element["winds"] == hinge.joint)


def stretches_of(robot: Robot) -> tuple[ConduitStretch, ...]:
    """Return the stretches in the file CONDUITS beside that of ``robot``; none without such a file.

    Raises RobotDescriptionError if the file is invalid or describes another arm.
    """
    if robot.path is None:
        return ()
    return read_stretches(robot.path.parent / CONDUITS, lambda *ends: _hinge(robot, *ends))


def _hinge(robot: Robot, start: str, end: str) -> Hinge:
    """Return the one joint between two links. Raises KeyError if there is not exactly one."""
    arm, by_name = robot.require_arm(), {link.name: link for link in robot.links}
    chain = arm.chain
    path: list[Link] = []
    name: str | None = end
    while name != start:
        if name is None:
            raise KeyError(f"{end} is not a descendant of {start}")
        path.insert(0, by_name[name])
        name = path[0].parent
    joints = [link.joint.name if link.joint is not None else "" for link in path]
    driven = [i for i, joint in enumerate(joints) if joint in chain.names]
    if len(driven) != 1:
        raise KeyError(f"there are {len(driven)} driven joints between {start} and {end}, not one")
    (index,) = driven
    before, after = (
        functools.reduce(np.matmul, (link.at_rest(arm.resting) for link in some), np.eye(4))
        for some in (path[: index + 1], path[index + 1 :])
    )
    joint = path[index].joint
    assert joint is not None
    number = chain.names.index(joint.name)
    lower, upper = float(chain.lower[number]), float(chain.upper[number])
    return Hinge(joint.name, joint.axis, lower, upper, before, after)
