"""A plan under way: the setpoint is on the plan, at a place given by one number."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.motion.limiter import JointMotion
from katana450.maths.planning.plan import Plan, Segment


@dataclass(frozen=True, eq=False)
class Following:
    """Place of the arm on a plan, and the place that it moves to.

    It is a mode of the session: the goal is the end of the plan, or another place on it.

    Attributes:
        plan: the plan.
        number: index of the segment that the arm is on, from 0.
        pace: tau in that segment [s], and its first two derivatives by time, (1,) each.
        towards: tau of the plan at which the arm comes to rest [s]: its end, its start when the arm
            goes back, or any value between.
    """

    plan: Plan
    number: int
    pace: JointMotion
    towards: float

    @staticmethod
    def begin(plan: Plan, tau: float = 0.0) -> Following:
        """Return the place of rest at ``tau`` [s] of ``plan``, on the way to its end."""
        number = plan.segment_at(tau)
        local = np.array([tau - plan.begins[number]])
        return Following(plan, number, JointMotion.rest(local), plan.span)

    @property
    def segment(self) -> Segment:
        """The segment that the arm is on."""
        return self.plan.segments[self.number]

    @property
    def local(self) -> float:
        """Tau in the present segment [s]."""
        return float(self.pace.q[0])

    @property
    def aim(self) -> float:
        """Tau at which the arm next comes to rest in the present segment [s].

        It is the end or the start of the segment if the path leads beyond it.
        """
        begin, end = self.plan.begins[self.number : self.number + 2]
        span = self.segment.scaling.span
        if self.towards >= end:
            return span
        return min(max(self.towards - begin, 0.0), span)

    @property
    def tau(self) -> float:
        """Tau of the arm on the whole plan [s]."""
        return self.plan.begins[self.number] + self.local

    @property
    def fraction(self) -> float:
        """Fraction of the plan that the arm has completed, from 0 to 1."""
        return min(self.tau / self.plan.span, 1.0)

    @property
    def goal(self) -> FloatArray:
        """Joint angles (5,) at which the arm comes to rest [rad]."""
        if self.towards <= 0.0:
            return self.plan.start
        return self.plan.end if self.towards >= self.plan.span else self.plan.q(self.towards)

    @property
    def there(self) -> bool:
        """True if the arm is at rest at its place of rest."""
        return self.pace.at_rest and self.local == self.aim and self._beyond == 0

    @property
    def _beyond(self) -> int:
        """Return 1 if the aim is in a later segment, -1 if in an earlier one, else 0."""
        begin, end = self.plan.begins[self.number : self.number + 2]
        return int(self.towards > end) - int(self.towards < begin)

    def at(self, tau: float) -> Following:
        """Return the place of rest at ``tau`` of the same segment [s]."""
        return replace(self, pace=JointMotion.rest(np.array([tau])))

    def turned_over(self) -> Following:
        """Return the place on the next segment if the present one is done and the path leads on."""
        if not self.pace.at_rest or self.local != self.aim or self._beyond == 0:
            return self
        after = replace(self, number=self.number + self._beyond)
        return after.at(0.0 if self._beyond > 0 else after.segment.scaling.span)

    def motion(self) -> JointMotion:
        """Return the motion of the joints at this place."""
        if self.there:
            return JointMotion.rest(self.goal)
        moving = self.segment.at(self.local)
        if self.pace.at_rest:
            return JointMotion.rest(moving.q)
        v, a = float(self.pace.qd[0]), float(self.pace.qdd[0])
        qdd = v * v * moving.second + a * moving.first
        return JointMotion(moving.q, frozen(v * moving.first), frozen(qdd))
