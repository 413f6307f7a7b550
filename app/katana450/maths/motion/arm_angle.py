"""The arm angle of seven axes: the place of the elbow about the line from shoulder to wrist.

With the tool at rest such an arm still has one motion. It turns the upper arm, and the elbow with
it, about that line. The shoulder is where axis 2 passes axis 1, the elbow where axis 4 passes axis
3, the wrist where axis 6 passes axis 5, and the upper arm the link that carries axis 4.

Source: Kreutz-Delgado, Long and Seraji, Kinematic analysis of 7-DOF manipulators, The International
Journal of Robotics Research 11 (1992).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import lru_cache
from typing import Final, NamedTuple

import numpy as np

from katana450.maths.geometry import screws, se3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.forward import (
    forward,
    jacobian_body,
    jacobian_space,
    joint_frames,
)
from katana450.maths.kinematics.velocity import characteristic_length

AXES: Final = 7
"""Number of axes of an arm with an arm angle."""

LEAST_REGULAR: Final = 0.01
"""Singular value [1] below which the tool at rest leaves the joints more than one motion."""

LEAST_TURN: Final = 0.02
"""[1] Turn of the upper arm in a unit motion of the joints below which the elbow does not move."""

PROBE: Final = 1e-4
"""[rad] Length of the motion of the joints by which derivatives are measured."""

STEP: Final = 0.02
"""[rad] Step of the arm angle between two postures of `elbow_postures`."""


class SelfMotion(NamedTuple):
    """The motion of the joints at a posture that leaves the tool at rest.

    Attributes:
        v: (7,) unit motion of the joints that increases the arm angle.
        turn: change of the arm angle [1] in it, not negative.
        least: smallest singular value [1]; in a singularity it is 0, and ``v`` is one of many.
    """

    v: FloatArray
    turn: float
    least: float


class ElbowPath(NamedTuple):
    """The self-motion in one direction, and how far it leads; lengths are those in joint space.

    Attributes:
        v: (7,) unit motion of the joints.
        bend: (7,) its change along the path [1/rad].
        turn: change of the arm angle [1] in ``v``, without its sign.
        rooms: (7,) length [rad] until each joint is at its limit.
        end: length [rad] until the elbow turns no farther, or a singularity is near.
    """

    v: FloatArray
    bend: FloatArray
    turn: float
    rooms: FloatArray
    end: float


def has_arm_angle(chain: Chain) -> bool:
    """Return whether the elbow of the arm can move with the tool at rest."""
    return chain.n == AXES and not any(chain.slides)


def self_motion(chain: Chain, q: FloatArray) -> SelfMotion:
    """Return the motion of the joints at `q` (7,) [rad] that leaves the tool at rest."""
    J = jacobian_space(chain, q)
    scaled = np.concatenate((J[:3], J[3:] / characteristic_length(chain)))
    _, values, Vt = np.linalg.svd(scaled)
    v = Vt[-1]
    turn = float(_shoulder_to_wrist(chain, q) @ J[:3, :3] @ v[:3])
    return SelfMotion(-v if turn < 0.0 else v, abs(turn), float(values[-1]))


def elbow_path(chain: Chain, q: FloatArray, sign: float) -> ElbowPath:
    """Return the path of the elbow from `q` (7,) [rad] to larger arm angles, or smaller ones.

    sign: positive for larger ones.
    """
    motion = self_motion(chain, q)
    v = math.copysign(1.0, sign) * motion.v
    later = self_motion(chain, q + PROBE * v)
    bend = (math.copysign(1.0, sign) * later.v - v) / PROBE
    ends = [math.inf]
    for size, size_later, least in (
        (motion.turn, later.turn, LEAST_TURN),
        (motion.least, later.least, LEAST_REGULAR),
    ):
        if size_later < size:
            ends.append(PROBE * max(size - least, 0.0) / (size - size_later))
    if motion.least < LEAST_REGULAR or float(later.v @ motion.v) < 0.0:
        ends.append(0.0)
    rooms = np.minimum(_length_to(chain.upper - q, v, bend), _length_to(q - chain.lower, -v, -bend))
    return ElbowPath(v, bend, motion.turn, rooms, min(ends))


def _length_to(room: FloatArray, v: FloatArray, bend: FloatArray) -> FloatArray:
    """Return the lengths (7,) of a path on which joints turn by ``room`` (7,); infinite if never.

    They turn by v s + bend s^2 / 2 on a path of the length s.
    """
    room = np.maximum(room, 0.0)
    square = v * v + 2.0 * bend * room
    divisor = v + np.sqrt(np.maximum(square, 0.0))
    reached = (square >= 0.0) & (divisor > 0.0)
    lengths: FloatArray = np.full(AXES, math.inf)
    return np.divide(2.0 * room, divisor, out=lengths, where=reached)


def at_pose(chain: Chain, q: FloatArray, T: FloatArray) -> FloatArray:
    """Return the joint angles (7,) [rad] nearest to `q`, which is off by little, for the pose `T`.

    The error that is left grows with the square of that of `q`.
    """
    V_body = se3.log(se3.inverse(forward(chain, q)) @ T)
    return np.asarray(q + np.linalg.pinv(jacobian_body(chain, q)) @ V_body)


def elbow_turn(chain: Chain, q: FloatArray, to: FloatArray) -> float:
    """Return the turn [rad] of the arm angle by a small motion from `q` (7,) [rad] to ``to``."""
    middle = 0.5 * (q + to)
    J = jacobian_space(chain, middle)
    return float(_shoulder_to_wrist(chain, middle) @ J[:3, :3] @ (to - q)[:3])


def elbow_points(chain: Chain, q: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the shoulder, the elbow and the wrist, each (3,) [m] in {S}, at `q` (7,) [rad]."""
    frames = joint_frames(chain, q)[[0, 2, 4]]
    points = zip(frames, _points(chain), strict=True)
    shoulder, elbow, wrist = (T[:3, :3] @ point + T[:3, 3] for T, point in points)
    return shoulder, elbow, wrist


def elbow_postures(chain: Chain, q: FloatArray, by: float) -> Iterator[FloatArray]:
    """Yield the joint angles (7,) [rad] at steps of the arm angle from `q` (7,) to a turn ``by``.

    The tool rests, but for the error of the method of Runge and Kutta, below 1e-6 m. The last is at
    ``by`` [rad]; it is missing, with those before it, where the elbow turns no farther.
    """
    count = int(np.ceil(abs(by) / STEP))
    h = by / max(count, 1)
    yield q
    for _ in range(count):
        rates: list[FloatArray] = []
        for part in (0.0, 0.5, 0.5, 1.0):
            after = q + part * h * rates[-1] if rates else q
            motion = self_motion(chain, after)
            if motion.turn < LEAST_TURN or motion.least < LEAST_REGULAR:
                return
            rates.append(motion.v / motion.turn)
        q = q + h / 6.0 * (rates[0] + 2.0 * (rates[1] + rates[2]) + rates[3])
        yield q


def _shoulder_to_wrist(chain: Chain, q: FloatArray) -> FloatArray:
    """Return the direction (3,) in {S} from the shoulder to the wrist; 0 where they coincide."""
    shoulder, _, wrist = elbow_points(chain, q)
    line = wrist - shoulder
    length = float(np.linalg.norm(line))
    return line / length if length > 0.0 else line


@lru_cache(maxsize=16)
def _points(chain: Chain) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the shoulder, the elbow and the wrist at q = 0, in {S} [m]."""
    shoulder, elbow, wrist = (_nearest(chain.S[:, k], chain.S[:, k - 1]) for k in (1, 3, 5))
    return shoulder, elbow, wrist


def _nearest(axis: FloatArray, other: FloatArray) -> FloatArray:
    """Return the point (3,) of ``axis`` nearest to another; of parallel ones, to the origin."""
    point = screws.point_on(axis)
    normal = np.cross(axis[:3], other[:3])
    size = float(normal @ normal)
    if size == 0.0:
        return point
    apart = screws.point_on(other) - point
    return np.asarray(point + float(np.cross(apart, other[:3]) @ normal) / size * axis[:3])
