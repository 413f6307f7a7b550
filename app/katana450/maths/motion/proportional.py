"""Change of the joint rates in proportion, so that the tool keeps the direction of its twist.

Joints that each accelerate as hard as they can move the tool off its line and turn it. Here one
number, from 0 for the present twist to 1 for the wanted one, follows a ramp of bounded acceleration
and jerk. The bounds are those of the joint that needs them first. What the joints need to keep a
twist while their posture changes is added to it.
"""

from __future__ import annotations

import math

import numpy as np

from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.motion.limiter import LIMIT_TOLERANCE, JointMotion, Limiter

BEND_FRACTION = 0.5
"""Maximum fraction [1] of a joint's acceleration that keeping the wanted twist may need. The rest
is for changes of the speed: where the path bends more and more, they are needed in time."""

OLD_FRACTION = 0.5
"""Fraction [1] of a joint's jerk with which the acceleration of an earlier change ends."""

STILL = 1e-6
"""Rate [rad/s] and acceleration [rad/s^2] of a joint that count as rest."""


def in_proportion(
    limiter: Limiter, now: JointMotion, coasting: FloatArray, qd: FloatArray, dt: float
) -> JointMotion | None:
    """Return the motion ``dt`` [s] after ``now`` on its way to the rates ``qd`` (n,) [rad/s].

    A wanted twist that needs too much acceleration is slowed and keeps its direction.

    Args:
        limiter: the limits.
        now: the motion now.
        coasting: rates (n,) [rad/s] after ``dt`` with which the tool would keep its present twist.
        qd: wanted rates after ``dt``.
        dt: the duration of the step [s], above 0.

    Returns:
        The motion, or None if the limits of the joints do not allow this step.
    """
    limits = limiter.limits
    A, J = limits.acceleration, limits.jerk
    drift = (coasting - now.qd) / dt
    # The acceleration that a twist needs grows with the square of its speed.
    bend = float(np.max(np.abs(drift) / A))
    if bend > 1.0:
        return None
    needed, allowed = bend * float(qd @ qd), BEND_FRACTION * float(now.qd @ now.qd)
    change = (qd * math.sqrt(allowed / needed) if needed > allowed > STILL**2 else qd) - coasting
    size = float(np.linalg.norm(change))
    d = change / size if size > 0.0 else np.full(len(qd), len(qd) ** -0.5)
    own = now.qdd - drift
    a = float(own @ d)
    old = own - a * d
    with np.errstate(divide="ignore"):
        old_part = max(0.0, 1.0 - OLD_FRACTION * dt * float(np.min(J / np.abs(old)))) * old
        left, used = A - np.abs(old), np.sign(d) * drift
        faster, slower = (float(np.min(x / np.abs(d))) for x in (left - used, left + used))
        j = float(np.min((J - np.abs(old - old_part) / dt) / np.abs(d)))
    # After this tick and one more, the jerk can still end the acceleration at the wanted speed.
    remaining = size - 0.5 * dt * a
    b = math.copysign(j * (math.sqrt(dt * dt + 2.0 * abs(remaining) / j) - dt), remaining)
    b = min(max(b, -slower, a - j * dt), max(faster, a - j * dt), a + j * dt)
    first, last = a * d + old, b * d + old_part
    q = now.q + dt * (0.5 * (now.qd + coasting) + dt * (first / 3.0 + last / 6.0))
    motion = JointMotion(
        frozen(q), frozen(coasting + 0.5 * dt * (first + last)), frozen(last + drift)
    )
    if not qd.any() and max(np.abs(motion.qd).max(), np.abs(motion.qdd).max()) <= STILL:
        motion = JointMotion.rest(q)
    # Acceleration that is left raises the speed further while it ends.
    fastest = limiter.fastest(motion)
    ends = np.array((q, limiter.stopping_point(motion)))
    possible = (
        ((ends >= limits.lower) & (ends <= limits.upper)).all()
        and (fastest <= limits.speed + LIMIT_TOLERANCE).all()
        and (np.abs(motion.qdd) <= A + LIMIT_TOLERANCE).all()
    )
    return motion if possible else None
