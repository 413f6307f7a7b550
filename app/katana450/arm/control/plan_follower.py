"""The step of one tick along a plan: tau moves, and the joints are where the plan has them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from katana450.arm.control.following import Following
from katana450.maths.collision.clearance import STOP
from katana450.maths.collision.contact import Contact
from katana450.maths.collision.world import CollisionWorld
from katana450.maths.motion.limiter import Limiter, Limits
from katana450.maths.planning.clearance import SweptClearance
from katana450.maths.planning.plan import Segment
from katana450.maths.planning.scaling import Scaling

MAX_UNCHECKED_PATH = 1e-3
"""[m] Ways shorter than this are not looked at in between: no part is as thin."""

SAME_PLACE = 1e-4
"""[m or 1] A body that is no farther from where a plan has it may be taken to be there: plans keep
MARGIN, 1 mm more than has to be."""

SAME_FINGERS_TURN, SAME_FINGERS_SLIDE = 5e-3, 5e-4
"""[rad, m] Of the fingers: half a millimetre at the pads."""

PROBE = 0.02
"""[1] Of a segment: an arm that waits goes on once the way is clear so far."""


class PlanFollower:
    """Moves one arm along plans. Its methods are pure; it is for one thread."""

    def __init__(self, world: CollisionWorld | None, *, slides: bool = False) -> None:
        """``world``: what must not be touched. ``slides``: whether the fingers slide, not turn."""
        self._world = world
        self._same_fingers = SAME_FINGERS_SLIDE if slides else SAME_FINGERS_TURN
        self._limiters: dict[Scaling, Limiter] = {}
        # What of a segment is known to be clear with the fingers as they are: no state, but facts.
        self._known: tuple[Segment, float, float, float] | None = None

    def ahead(self, now: Following, dt: float, fraction: float) -> Following:
        """``dt`` [s] on, no faster than ``fraction`` of what the plan allows."""
        here = now.turned_over()
        pace = self._limiter(here).towards(here.pace, np.array([here.aim]), dt, fraction)
        return replace(here, pace=pace)

    def braking(self, now: Following, dt: float) -> Following:
        """``dt`` [s] on when it brakes along the plan; ``now`` itself at rest."""
        if now.pace.at_rest:
            return now
        return replace(now, pace=self._limiter(now).stop(now.pace, dt))

    def stopping_point(self, now: Following) -> Following:
        """At rest where it would be if it braked now."""
        (end,) = self._limiter(now).stopping_point(now.pace).tolist()
        return now.at(min(max(end, 0.0), now.segment.scaling.span))

    def stopping_time(self, now: Following) -> float:
        """[s] until then."""
        return self._limiter(now).stopping_time(now.pace)

    def met(self, now: Following, ahead: Following, fingers: float) -> Contact | None:
        """What is too near on the way to ``ahead`` and on to rest; None when nothing is."""
        # Segments meet at rest, so on a new one the arm has not left its end yet.
        here = now if now.number == ahead.number else ahead
        return self._met(here, self.stopping_point(ahead), fingers)

    def may_go_on(self, now: Following, fingers: float) -> bool:
        """Whether the way of an arm that waits is clear again, at its beginning."""
        here = now.turned_over()
        reach = PROBE * here.segment.scaling.span
        probe = min(max(here.aim, here.local - reach), here.local + reach)
        return self._met(here, here.at(probe), fingers) is None

    def _met(self, here: Following, stopping_point: Following, fingers: float) -> Contact | None:
        plan, segment = here.plan, here.segment
        world = self._world
        if world is None or (
            plan.clear_of is not None
            and abs(plan.fingers - fingers) <= self._same_fingers
            and plan.clear_of.differs_by(world.fingerprint) <= SAME_PLACE
        ):
            return None
        start, end = (segment.scaling.pace(each.local).sigma for each in (here, stopping_point))
        low, high = min(start, end), max(start, end)
        known = self._known
        if known is None or known[:2] != (segment, fingers) or not known[2] <= start <= known[3]:
            known = (segment, fingers, start, start)
        if known[2] <= low and high <= known[3]:
            return None
        room = SweptClearance.about(world, STOP, segment.sweep.at(start, fingers))
        for a, b in ((low, known[2]), (known[3], high)):
            found = (
                segment.sweep.blocked(room, fingers, a, b, MAX_UNCHECKED_PATH) if a < b else None
            )
            if found is not None:
                return found.contact
        # What leads out of a contact is clear from here alone.
        if float(room.minimum.min()) >= STOP:
            self._known = (segment, fingers, min(low, known[2]), max(high, known[3]))
        return None

    def _limiter(self, now: Following) -> Limiter:
        """Of tau along the segment."""
        scaling = now.segment.scaling
        if scaling not in self._limiters:
            a, j = np.array([scaling.acceleration]), np.array([scaling.jerk])
            limits = Limits(np.zeros(1), np.array([scaling.span]), np.ones(1), a, j)
            # One plan at a time: what was followed before is not needed again.
            self._limiters = {scaling: Limiter(limits)}
        return self._limiters[scaling]
