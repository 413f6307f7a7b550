"""A plan under way: the setpoint is on it, and one number says where."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.motion.limiter import JointMotion
from katana450.maths.planning.plan import Plan, Segment


@dataclass(frozen=True, eq=False)
class Following:
    """Where on a plan the arm is, and where along it it goes.

    It is a mode of the session: the goal is where the plan ends, or another place on it.

    Attributes:
        plan: what is followed.
        number: of the segment the arm is on, from 0.
        pace: tau in that segment [s], and its first two derivatives by time, (1,) each.
        towards: tau of the plan to come to rest at [s]: its end, its start for the way back, or any
            in between.
    """

    plan: Plan
    number: int
    pace: JointMotion
    towards: float

    @staticmethod
    def begin(plan: Plan) -> Following:
        """At the start of ``plan``, about to follow it to its end."""
        return Following(plan, 0, JointMotion.rest(np.zeros(1)), plan.span)

    @property
    def segment(self) -> Segment:
        """The one the arm is on."""
        return self.plan.segments[self.number]

    @property
    def local(self) -> float:
        """Tau in that segment [s]."""
        return float(self.pace.q[0])

    @property
    def aim(self) -> float:
        """Tau in that segment to come to rest at next: its end where the way leads beyond it."""
        begin, end = self.plan.begins[self.number : self.number + 2]
        span = self.segment.scaling.span
        if self.towards >= end:
            return span
        return min(max(self.towards - begin, 0.0), span)

    @property
    def tau(self) -> float:
        """Where the arm is on the plan [s]."""
        return self.plan.begins[self.number] + self.local

    @property
    def fraction(self) -> float:
        """How much of the plan lies behind the arm, from 0 to 1."""
        return min(self.tau / self.plan.span, 1.0)

    @property
    def goal(self) -> FloatArray:
        """(5,) the joints where it comes to rest [rad]."""
        if self.towards <= 0.0:
            return self.plan.start
        return self.plan.end if self.towards >= self.plan.span else self.plan.q(self.towards)

    @property
    def there(self) -> bool:
        """Whether it is at rest where it was to go."""
        return self.pace.at_rest and self.local == self.aim and self._beyond == 0

    @property
    def _beyond(self) -> int:
        """Whether the aim lies in a later segment (1), an earlier one (-1) or this (0)."""
        begin, end = self.plan.begins[self.number : self.number + 2]
        return int(self.towards > end) - int(self.towards < begin)

    def at(self, tau: float) -> Following:
        """At rest at ``tau`` of the same segment [s]."""
        return replace(self, pace=JointMotion.rest(np.array([tau])))

    def turned_over(self) -> Following:
        """On the next segment where the way leads beyond this one and it is done."""
        if not self.pace.at_rest or self.local != self.aim or self._beyond == 0:
            return self
        after = replace(self, number=self.number + self._beyond)
        return after.at(0.0 if self._beyond > 0 else after.segment.scaling.span)

    def motion(self) -> JointMotion:
        """The joints on the plan, and how they move."""
        if self.there:
            return JointMotion.rest(self.goal)
        moving = self.segment.at(self.local)
        if self.pace.at_rest:
            return JointMotion.rest(moving.q)
        v, a = float(self.pace.qd[0]), float(self.pace.qdd[0])
        qdd = v * v * moving.second + a * moving.first
        return JointMotion(moving.q, frozen(v * moving.first), frozen(qdd))
