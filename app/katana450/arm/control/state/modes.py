"""The modes of a session: each is one cause that decides where the goal of the arm is.

A session is in exactly one mode. Each mode holds only the fields that it needs, so no data of a
mode outlasts it. The effect of each command in each mode is in ``transitions``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.kinematics.projection import Projection
from katana450.maths.kinematics.tool import ToolTarget
from katana450.maths.kinematics.velocity import JogFrame
from katana450.maths.motion.limiter import JointMotion
from katana450.maths.motion.stream import Stream
from katana450.maths.planning.plan import Plan, Segment


@dataclass(frozen=True, eq=False)
class Following:
    """Place of the arm on a plan. It is a mode of the session: the goal is the end of the plan.

    Attributes:
        plan: the plan.
        number: index of the segment that the arm is on, from 0.
        pace: tau in that segment [s], and its first two derivatives by time, (1,) each.
    """

    plan: Plan
    number: int
    pace: JointMotion

    @staticmethod
    def begin(plan: Plan, tau: float = 0.0) -> Following:
        """Return the place of rest at ``tau`` [s] of ``plan``, on the way to its end."""
        number = plan.segment_at(tau)
        local = np.array([tau - plan.begins[number]])
        return Following(plan, number, JointMotion.rest(local))

    @property
    def segment(self) -> Segment:
        """The segment that the arm is on."""
        return self.plan.segments[self.number]

    @property
    def local(self) -> float:
        """Tau in the present segment [s]."""
        return float(self.pace.q[0])

    @property
    def tau(self) -> float:
        """Tau of the arm on the whole plan [s]."""
        return self.plan.begins[self.number] + self.local

    @property
    def fraction(self) -> float:
        """Fraction of the plan that the arm has completed, from 0 to 1."""
        return min(self.tau / self.plan.span, 1.0)

    @property
    def at_end(self) -> bool:
        """True if the arm is at rest at the end of the segment."""
        return self.pace.at_rest and self.local == self.segment.scaling.span

    @property
    def there(self) -> bool:
        """True if the arm is at rest at the end of the plan."""
        return self.at_end and self.number == len(self.plan.segments) - 1

    def at(self, tau: float) -> Following:
        """Return the place of rest at ``tau`` of the same segment [s]."""
        return replace(self, pace=JointMotion.rest(np.array([tau])))

    def turned_over(self) -> Following:
        """Return the place on the next segment if the present one is done and another follows."""
        if not self.at_end or self.there:
            return self
        return replace(self, number=self.number + 1).at(0.0)

    def motion(self) -> JointMotion:
        """Return the motion of the joints at this place."""
        if self.there:
            return JointMotion.rest(self.plan.end)
        moving = self.segment.at(self.local)
        if self.pace.at_rest:
            return JointMotion.rest(moving.q)
        v, a = float(self.pace.qd[0]), float(self.pace.qdd[0])
        qdd = v * v * moving.second + a * moving.first
        return JointMotion(moving.q, frozen(v * moving.first), frozen(qdd))


@dataclass(frozen=True, eq=False)
class JointTarget:
    """Joint angles ``q`` (n,) [rad or m]."""

    q: FloatArray


@dataclass(frozen=True, eq=False)
class PoseTarget:
    """A full pose ``T`` (4, 4) in {S}."""

    T: FloatArray


Target = JointTarget | ToolTarget | PoseTarget


@dataclass(frozen=True)
class Idle:
    """No target: the arm rests at its goal, or brakes towards it."""


IDLE = Idle()


@dataclass(frozen=True, eq=False)
class Positioning:
    """Travel to a fixed goal, and rest there. The goal is the nearest posture to ``target``.

    Attributes:
        target: the target, or the goal after the end of a drag.
        beyond_gap: the pose nearer to the target of a drag that only a leap would reach, on the
            same branch; None without one.
    """

    target: Target
    beyond_gap: Projection | None = None


@dataclass(frozen=True, eq=False)
class Tracking:
    """A drag: the goal moves along the path of the drag to ``target``, as far as a tick allows.

    Attributes:
        target: the newest target.
        since: the target up to which the goal has followed that path.
        let_go: whether the drag has ended, so that the goal becomes the target at the end of the
            path.
    """

    target: ToolTarget
    since: ToolTarget
    let_go: bool = False


@dataclass(frozen=True, eq=False)
class Jogging:
    """Motion at given rates, for a limited time or until the elbow has turned by an angle.

    Attributes:
        rates: (5,) or (6,) velocity of the tool point [m/s], then pitch and roll or the three
            rotations [rad/s]; (7,) then the arm angle [rad/s].
        frame: the frame of the velocity.
        until: time [s] at which the jog ends unless it is renewed.
        turn: the angle [rad] by which the elbow has yet to turn; None without an angle.
        kept: (4, 4) pose of the tool in {S} while the elbow alone moves; None at first.
    """

    rates: FloatArray
    frame: JogFrame
    until: float
    turn: float | None = None
    kept: FloatArray | None = None

    @property
    def elbow_rate(self) -> float:
        """Rate of the arm angle [rad/s], towards the end of a turn by an angle."""
        rate = float(self.rates[6]) if self.rates.size > 6 else 0.0
        return rate if self.turn is None else math.copysign(rate, self.turn)

    @property
    def keeps_tool(self) -> bool:
        """True if the elbow moves and the tool rests."""
        return self.elbow_rate != 0.0 and not self.rates[:6].any()

    def continued(self, jog: Jogging) -> Jogging:
        """Return ``jog``, given during this one, with the pose of the tool that both keep."""
        return jog if jog.rates[:6].any() else replace(jog, kept=self.kept)

    def ending(self) -> Jogging:
        """Return the jog with zero rates, with which it ends."""
        return replace(self, rates=frozen(np.zeros(self.rates.size)), turn=None)


@dataclass(frozen=True, eq=False)
class Servoing:
    """A stream of joint angles is followed, for JOG_TIME after its newest sample."""

    stream: Stream


Intent = Idle | Positioning | Tracking | Jogging | Servoing
"""A mode that can begin while the arm is still on a plan."""


@dataclass(frozen=True, eq=False)
class Leaving:
    """The arm brakes along its plan until it can leave it without touching anything.

    Attributes:
        along: the place on the plan.
        then: the mode that has superseded the plan.
    """

    along: Following
    then: Intent


Mode = Idle | Positioning | Tracking | Jogging | Servoing | Following | Leaving

MODES = (Idle, Positioning, Tracking, Jogging, Servoing, Following)
"""Columns of the table of transitions. A plan that is being left counts as the mode after it."""
