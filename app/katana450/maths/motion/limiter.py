"""Setpoints that a real arm can follow to a goal: bounded speed, acceleration and jerk.

Each step is planned from the present motion to rest at the goal (Berscheid and Kroeger,
"Jerk-limited real-time trajectory generation with arbitrary target states", RSS 2021, as in the
library ruckig), and its first ``dt`` is taken. A goal may therefore change at any tick, and every
state can be stopped.

Joints that each accelerate as hard as they can move the tool off its line and turn it. In
``in_proportion`` one number, from 0 for the present twist to 1 for the wanted one, follows a ramp
of bounded acceleration and jerk instead. The bounds are those of the joint that needs them first.
What the joints need to keep a twist while their posture changes is added to it. Angles in rad,
times in s, arrays with one value per joint.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from ruckig import (
    ControlInterface,
    InputParameter,
    Result,
    Ruckig,
    RuckigError,
    Synchronization,
    Trajectory,
)

from katana450.errors import InputError
from katana450.maths.geometry.arrays import FloatArray, finite_array, frozen
from katana450.maths.geometry.curve import JointCurve

LINE_TOLERANCE = 1e-6
"""Fraction of the limits: a motion that deviates less from the line to its goal is on the line."""

LIMIT_TOLERANCE = 1e-9
"""Tolerance [rad] at a limit: a plan that ends there may miss it by rounding."""

VALID_RESULTS = (Result.Working, Result.Finished)

BOUND_BRAKE_FRACTION = 0.7
"""Fraction of acceleration and jerk with which a joint led along a bound brakes."""

MIN_SPEED_FRACTION = 1e-3
"""Minimum fraction of the speed; anything slower is effectively a hold."""


@dataclass(frozen=True, eq=False)
class Limits:
    """The limits of each joint; all arrays (n,).

    Raises InputError for limits that are not finite, not positive or not in order.

    Attributes:
        lower, upper: limits of position [rad].
        speed: maximum speed [rad/s].
        acceleration: maximum acceleration [rad/s^2].
        jerk: maximum jerk [rad/s^3].
    """

    lower: FloatArray
    upper: FloatArray
    speed: FloatArray
    acceleration: FloatArray
    jerk: FloatArray

    def __post_init__(self) -> None:
        n = np.size(self.lower)
        for name in ("lower", "upper", "speed", "acceleration", "jerk"):
            value = frozen(finite_array(getattr(self, name), (n,), f"The limit {name!r}"))
            object.__setattr__(self, name, value)
        if not (self.lower < self.upper).all():
            raise InputError("Every lower limit must be below the upper one.")
        for name in ("speed", "acceleration", "jerk"):
            if not (getattr(self, name) > 0.0).all():
                raise InputError(f"Every limit of {name} must be above 0.")


@dataclass(frozen=True, eq=False)
class JointMotion:
    """Positions, rates and accelerations of the joints: q, qd, qdd, (n,) [rad, rad/s, rad/s^2]."""

    q: FloatArray
    qd: FloatArray
    qdd: FloatArray

    @staticmethod
    def rest(q: FloatArray) -> JointMotion:
        """Return the motion at rest at ``q`` (n,) [rad]."""
        zero = frozen(np.zeros(len(q)))
        return JointMotion(frozen(q), zero, zero)

    @property
    def at_rest(self) -> bool:
        """True if all rates and accelerations are zero."""
        return not (self.qd.any() or self.qdd.any())


class Limiter:
    """Steps of one arm's motion. Its methods are pure; use it from one thread only."""

    def __init__(self, limits: Limits) -> None:
        self.limits = limits
        n = len(limits.lower)
        self._ruckig = Ruckig(n)
        self._trajectory = Trajectory(n)
        self._input = InputParameter(n)
        self._line_ruckig = Ruckig(1)
        self._line_trajectory = Trajectory(1)
        self._line = InputParameter(1)
        self._line.target_velocity = self._line.target_acceleration = [0.0]
        self._input.target_acceleration = [0.0] * n
        self._input.max_acceleration = limits.acceleration.tolist()
        self._input.max_jerk = limits.jerk.tolist()

    def towards(
        self, now: JointMotion, goal: FloatArray, dt: float, fraction: float = 1.0
    ) -> JointMotion:
        """Return the motion after ``dt`` [s] that leads to rest at ``goal`` (n,) inside the limits.

        All joints arrive together. A motion that heads straight for the goal, as one from rest
        does, stays on the straight line to it. A motion towards another goal bends over to it.
        ``fraction`` scales the maximum speed, above 0 and up to 1. From rest inside the limits no
        step leaves them, however often the goal changes.
        """
        if dt <= 0.0 or (now.at_rest and (now.q == goal).all()):
            return now
        along = self._along(now, goal, dt, fraction)
        if along is not None:
            return along
        self._start(now, ControlInterface.Position, fraction)
        self._input.target_position = goal.tolist()
        self._input.target_velocity = [0.0] * len(goal)
        for synchronization in (Synchronization.Time, Synchronization.No):
            self._input.synchronization = synchronization
            if self._planned() and self._inside():
                return self._at(dt, goal)
        # Even unsynchronized joints would leave their limits, so the motion is too fast: stop
        # first.
        return self.stop(now, dt)

    def at_rate(self, now: JointMotion, qd: FloatArray, dt: float) -> JointMotion:
        """Return the motion after ``dt`` [s] on its path to the joint rates ``qd`` (n,) [rad/s].

        The joints reach the rates together, which keeps the direction. A joint that could then not
        stop before its limit brakes as hard as possible, and the others continue unsynchronized.
        """
        if dt <= 0.0:
            return now
        wanted = np.clip(qd, -self.limits.speed, self.limits.speed)
        synchronization = Synchronization.Phase
        for _ in range(len(wanted) + 1):
            next_rates = self._rates(now, wanted, dt, synchronization)
            stopping_point = self.stopping_point(next_rates)
            beyond = (stopping_point < self.limits.lower) | (stopping_point > self.limits.upper)
            if not beyond.any():
                return next_rates
            wanted = np.where(beyond, 0.0, wanted)
            synchronization = Synchronization.No
        return self.stop(now, dt)

    def stoppable(self, q: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the minimum and maximum rates (n,) [rad/s] from which the joints can stop.

        ``q`` (n,) [rad] is the present place. Braking takes v^2 / 2a + v a / 2j, or v^(3/2) /
        j^(1/2) where the jerk alone bounds it.
        """
        a, j = (
            BOUND_BRAKE_FRACTION * self.limits.acceleration,
            BOUND_BRAKE_FRACTION * self.limits.jerk,
        )
        rooms = np.maximum((q - self.limits.lower, self.limits.upper - q), 0.0)
        soft = a * a / (2.0 * j)
        long = np.sqrt(soft * soft + 2.0 * a * rooms) - soft
        minimum, maximum = np.where(rooms > 4.0 * soft * soft / a, long, np.cbrt(j * rooms * rooms))
        return -minimum, maximum

    def pause(self, now: JointMotion, goal: FloatArray, dt: float) -> JointMotion:
        """Return the motion after ``dt`` [s] that brakes on the path to ``goal``.

        It can continue on the path later.
        """
        if dt <= 0.0 or now.at_rest:
            return now
        line = self._line_to(now, goal, 1.0)
        if line is not None:
            self._line.control_interface = ControlInterface.Velocity
            if _planned(self._line_ruckig, self._line, self._line_trajectory):
                return self._on_line(now, line, dt)
        return self.stop(now, dt)

    def stop(self, now: JointMotion, dt: float) -> JointMotion:
        """Return the motion after ``dt`` [s] when every joint brakes as hard as possible."""
        if dt <= 0.0 or now.at_rest:
            return now
        return self._rates(now, np.zeros(len(now.q)), dt, Synchronization.No)

    def stopping_point(self, now: JointMotion) -> FloatArray:
        """Return the place (n,) [rad] where the joints come to rest when they brake now."""
        if now.at_rest:
            return now.q
        self._brake(now)
        q, _, _ = self._trajectory.at_time(self._trajectory.duration)
        return np.array(q)

    def stopping_path(
        self, now: JointMotion, longest: float, length: Callable[[FloatArray], float]
    ) -> list[JointCurve]:
        """Return the braking path from the present place to rest, in pieces; none at rest.

        In each piece the joints move by at most ``longest`` [rad]. ``length`` returns how much a
        change (n,) of all joints counts. The pieces are valid only until the next call of this
        limiter.
        """
        if now.at_rest:
            return []
        self._brake(now)
        state_at, duration = self._trajectory.at_time, self._trajectory.duration
        jerk = self.limits.jerk
        maximum = np.maximum(self.limits.acceleration, np.abs(now.qdd))

        def bend(low: float, high: float) -> FloatArray:
            # From both ends the acceleration rises by no more than the jerk allows.
            h = (high - low) * duration
            first, last = (np.abs(state_at(part * duration)[2]) for part in (low, high))
            return np.asarray(h * h * np.minimum(maximum, 0.5 * (first + last + h * jerk)))

        curve = JointCurve(lambda part: np.array(state_at(part * duration)[0]), bend)
        # Each joint either continues in its direction or returns to it: twice the distance is
        # enough.
        count = math.ceil(2.0 * length(curve.place(1.0) - now.q) / longest)
        return curve.pieces(max(1, count))

    def stopping_range(self, now: JointMotion) -> tuple[FloatArray, FloatArray]:
        """Return the smallest and the largest place (n,) [rad] of each joint until it rests.

        A joint that slows down too hard to end that at rest turns back.
        """
        if now.at_rest:
            return now.q, now.q
        self._brake(now)
        extrema = self._trajectory.position_extrema
        return np.array([x.min for x in extrema]), np.array([x.max for x in extrema])

    def braking(self, now: JointMotion) -> tuple[Callable[[float], JointMotion], float]:
        """Return the braking motion by time from now [s], and its duration [s].

        The function is valid only until the next call of this limiter.
        """
        self._brake(now)
        state_at = self._trajectory.at_time
        return lambda t: JointMotion(*map(np.array, state_at(t))), self._trajectory.duration

    def fastest(self, now: JointMotion) -> FloatArray:
        """Return the maximum rates (n,) [rad/s] while braking from now on: they may still rise."""
        rise = now.qdd * np.abs(now.qdd) / (2.0 * self.limits.jerk)
        return np.maximum(np.abs(now.qd), np.abs(now.qd + rise))

    def stopping_time(self, now: JointMotion) -> float:
        """Return the time [s] until the joints come to rest when they brake now."""
        if now.at_rest:
            return 0.0
        self._brake(now)
        return float(self._trajectory.duration)

    def _along(
        self, now: JointMotion, goal: FloatArray, dt: float, fraction: float
    ) -> JointMotion | None:
        """Return the step on the straight line to ``goal``; None when the motion is not on it."""
        line = self._line_to(now, goal, fraction)
        if line is None:
            return None
        self._line.control_interface = ControlInterface.Position
        if not _planned(self._line_ruckig, self._line, self._line_trajectory):
            return None
        (extrema,) = self._line_trajectory.position_extrema
        if not all(self._holds(now.q + end * line) for end in (extrema.min, extrema.max)):
            return None
        if self._line_trajectory.duration <= dt:
            return JointMotion.rest(goal)
        return self._on_line(now, line, dt)

    def _line_to(self, now: JointMotion, goal: FloatArray, fraction: float) -> FloatArray | None:
        """Return the direction (n,) to ``goal`` and prepare the plan along the line.

        None means that the motion is not on the line.
        """
        offset = goal - now.q
        length = float(np.linalg.norm(offset))
        if length == 0.0:
            return None
        d = offset / length
        limits, line = self.limits, self._line
        v, a = float(now.qd @ d), float(now.qdd @ d)
        deviation = max(
            float(np.max(np.abs(now.qd - v * d) / limits.speed)),
            float(np.max(np.abs(now.qdd - a * d) / limits.acceleration)),
        )
        if deviation > LINE_TOLERANCE:
            return None
        # A joint that hardly takes part bounds nothing.
        with np.errstate(divide="ignore", over="ignore"):
            of_axis = 1.0 / np.abs(d)
            speed, acceleration, jerk = (
                float(np.min(limit * of_axis))
                for limit in (limits.speed, limits.acceleration, limits.jerk)
            )
        line.current_position, line.target_position = [0.0], [length]
        line.current_velocity, line.current_acceleration = [v], [a]
        line.max_velocity = [max(fraction, MIN_SPEED_FRACTION) * speed]
        line.max_acceleration, line.max_jerk = [acceleration], [jerk]
        return np.asarray(d)

    def _on_line(self, now: JointMotion, line: FloatArray, dt: float) -> JointMotion:
        (s,), (v,), (a,) = self._line_trajectory.at_time(dt)
        q = np.clip(now.q + s * line, self.limits.lower, self.limits.upper)
        if self._line_trajectory.duration <= dt:
            return JointMotion.rest(q)
        return JointMotion(frozen(q), frozen(v * line), frozen(a * line))

    def _holds(self, q: FloatArray) -> bool:
        limits = self.limits
        return bool(
            (q >= limits.lower - LIMIT_TOLERANCE).all()
            and (q <= limits.upper + LIMIT_TOLERANCE).all()
        )

    def _brake(self, now: JointMotion) -> None:
        self._aim_at_rates(now, [0.0] * len(now.q), Synchronization.No)

    def _rates(
        self,
        now: JointMotion,
        qd: FloatArray,
        dt: float,
        synchronization: Synchronization,
    ) -> JointMotion:
        self._aim_at_rates(now, qd.tolist(), synchronization)
        return self._at(dt, None, to_rest=not qd.any())

    def _aim_at_rates(
        self, now: JointMotion, qd: list[float], synchronization: Synchronization
    ) -> None:
        self._start(now, ControlInterface.Velocity, 1.0)
        self._input.target_velocity = qd
        for choice in (synchronization, Synchronization.No):
            self._input.synchronization = choice
            if self._planned():
                return
        raise ArithmeticError("The limiter found no braking motion. This is a bug.")

    def _start(self, now: JointMotion, interface: ControlInterface, fraction: float) -> None:
        self._input.control_interface = interface
        self._input.current_position = now.q.tolist()
        self._input.current_velocity = now.qd.tolist()
        self._input.current_acceleration = now.qdd.tolist()
        self._input.max_velocity = (max(fraction, MIN_SPEED_FRACTION) * self.limits.speed).tolist()

    def _planned(self) -> bool:
        return _planned(self._ruckig, self._input, self._trajectory)

    def _inside(self) -> bool:
        extrema = self._trajectory.position_extrema
        return all(
            lower - LIMIT_TOLERANCE <= value.min and value.max <= upper + LIMIT_TOLERANCE
            for value, lower, upper in zip(
                extrema, self.limits.lower.tolist(), self.limits.upper.tolist(), strict=True
            )
        )

    def _at(self, dt: float, goal: FloatArray | None, *, to_rest: bool = False) -> JointMotion:
        ends = self._trajectory.duration <= dt
        q, qd, qdd = (np.array(values) for values in self._trajectory.at_time(dt))
        if goal is not None and ends:
            return JointMotion.rest(goal)
        np.clip(q, self.limits.lower, self.limits.upper, out=q)
        if ends and to_rest:
            return JointMotion.rest(q)
        if ends:
            qdd[:] = 0.0
        return JointMotion(frozen(q), frozen(qd), frozen(qdd))


def _planned(ruckig: Ruckig, wanted: InputParameter, trajectory: Trajectory) -> bool:
    """Return True if ruckig found a ``trajectory`` for ``wanted``."""
    try:
        return ruckig.calculate(wanted, trajectory) in VALID_RESULTS
    except RuckigError:
        return False


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
