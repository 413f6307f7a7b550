"""The motion of the elbow of seven axes while the tool rests: one tick of it, exactly.

One number moves, the length of the path of the joints. It has the limits of the joint that needs
them first, and the joints are solved for the pose of the tool at every tick. So the tool rests to
rounding, and all joints keep their proportion.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.geometry.curve import JointCurve
from katana450.maths.kinematics.chain import Chain
from katana450.maths.motion.arm_angle import ElbowPath, at_pose, elbow_path, self_motion
from katana450.maths.motion.limiter import STILL, JointMotion, Limiter, Limits

SPEED_PART, RATE_PART, BEND_PART = 0.9, 0.7, 0.1
"""[1] Parts of a joint's limits: of its speed, and of the acceleration that may change the rate of
the elbow and bend its path. The path may bend more at the next place."""

ROOM_PART: Final = 0.85
"""[1] Part of the path to a limit in which the elbow can stop: its length is an estimate."""

LEAST_ROOM: Final = 1e-4
"""[rad] Length of the path to a limit that counts as none."""

MAX_PATH: Final = 100.0
"""[rad] Bound on the length of a path, which leads through all turns of all joints."""


def elbow_moved(
    chain: Chain,
    limits: Limits,
    now: JointMotion,
    T: FloatArray,
    rate: float,
    angle: float,
    dt: float,
) -> JointMotion | None:
    """Return the motion of the joints ``dt`` [s] after ``now``, with the tool at rest at `T`.

    Args:
        chain: the arm, with seven axes.
        limits: those of its joints.
        now: the present motion, in which the tool rests.
        T: (4, 4) pose of the tool in {S}.
        rate: wanted rate of the arm angle [rad/s]; 0 to come to rest.
        angle: turn [rad] of the arm angle after which the elbow comes to rest, not negative.
        dt: duration of the tick [s].

    Returns:
        The motion, or None if the limits of the joints do not allow it. The elbow also comes to
        rest before a limit of a joint, and where it turns no farther.
    """
    path = elbow_path(chain, now.q, rate)
    room = min(ROOM_PART * min(float(path.rooms.min()), path.end), MAX_PATH)
    room = room if room > LEAST_ROOM else 0.0
    with np.errstate(divide="ignore"):
        speed = float(np.min(limits.speed / np.abs(path.v)))
        bend = math.sqrt(BEND_PART * float(np.min(limits.acceleration / np.abs(path.bend))))
    wanted = min(SPEED_PART * speed, bend)
    if path.turn > 0.0:
        wanted, room = min(wanted, abs(rate) / path.turn), min(room, angle / path.turn)
    along, line = _line(path, limits, now, wanted)
    moves = wanted > STILL and room > 0.0
    line = along.towards(line, np.array((room,)), dt) if moves else along.stop(line, dt)
    length, speed, change = (float(values[0]) for values in (line.q, line.qd, line.qdd))
    q = _place(chain, now.q, path, length, T)
    if not chain.within_limits(q):
        return None
    if line.at_rest:
        return JointMotion.rest(chain.clamp(q))
    v = self_motion(chain, q).v
    v = math.copysign(1.0, float(v @ path.v)) * v
    qd, qdd = speed * v, change * v + speed * speed * path.bend
    if (np.abs(qd) > limits.speed).any() or (np.abs(qdd) > limits.acceleration).any():
        return None
    return JointMotion(frozen(chain.clamp(q)), frozen(qd), frozen(qdd))


@dataclass(frozen=True, eq=False)
class ElbowBrake:
    """The brake of an elbow that moves while the tool rests, as `Limiter` has that of each joint.

    Attributes:
        chain: the arm, with seven axes.
        limits: those of its joints.
        T: (4, 4) pose of the tool in {S}.
    """

    chain: Chain
    limits: Limits
    T: FloatArray

    def stopping_range(self, now: JointMotion) -> tuple[FloatArray, FloatArray]:
        """Return the smallest and the largest place (7,) [rad] of each joint until it rests."""
        (path,) = self.stopping_path(now, math.inf, lambda _: 0.0)
        ends, aside = np.array((now.q, path.place(1.0))), path.bend(0.0, 1.0) / 8.0
        return ends.min(axis=0) - aside, ends.max(axis=0) + aside

    def stopping_path(
        self, now: JointMotion, longest: float, length: Callable[[FloatArray], float]
    ) -> list[JointCurve]:
        """Return the braking path to rest in pieces; see `Limiter.stopping_path`.

        Its bend is an estimate: twice that at its begin.
        """
        path = elbow_path(self.chain, now.q, 1.0)
        along, line = _line(path, self.limits, now, STILL)
        end = float(along.stopping_point(line)[0])
        bend = 2.0 * end * end * np.abs(path.bend)
        curve = JointCurve(
            lambda part: _place(self.chain, now.q, path, end * part, self.T),
            lambda low, high: (high - low) ** 2 * bend,
        )
        return curve.pieces(max(1, math.ceil(2.0 * length(end * path.v) / longest)))


def _line(
    path: ElbowPath, limits: Limits, now: JointMotion, speed: float
) -> tuple[Limiter, JointMotion]:
    """Return the limiter of the length of ``path``, and the motion ``now`` on it from 0 on."""
    with np.errstate(divide="ignore"):
        acceleration, jerk = (
            float(np.min(limit / np.abs(path.v))) for limit in (limits.acceleration, limits.jerk)
        )
    bounds = (-MAX_PATH, MAX_PATH, max(speed, STILL), RATE_PART * acceleration, RATE_PART * jerk)
    present = (0.0, float(now.qd @ path.v), float(now.qdd @ path.v))
    return (
        Limiter(Limits(*(np.array((bound,)) for bound in bounds))),
        JointMotion(*(np.array((number,)) for number in present)),
    )


def _place(
    chain: Chain, q: FloatArray, path: ElbowPath, length: float, T: FloatArray
) -> FloatArray:
    """Return the joint angles (7,) [rad] after ``length`` [rad] of ``path`` from `q` (7,)."""
    return at_pose(chain, q + length * path.v + 0.5 * length * length * path.bend, T)
