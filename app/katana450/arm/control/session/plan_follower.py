"""One tick of motion along a plan: tau advances, and the joints take their places on the plan."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from katana450.arm.control.state.modes import Following
from katana450.maths.collision.clearance import MIN_CLEARANCE
from katana450.maths.collision.engine import Contact
from katana450.maths.collision.world import CollisionWorld
from katana450.maths.motion.limiter import Limiter, Limits
from katana450.maths.planning.clearance import SweptClearance
from katana450.maths.planning.plan import Segment
from katana450.maths.planning.scaling import Scaling

MAX_UNCHECKED_PATH = 1e-3
"""[m] Length of path below which no intermediate posture is checked: every part is thicker."""

MAX_DISPLACEMENT = 1e-4
"""[m or 1] Displacement of a body up to which it counts as unmoved since the planning. Plans keep
MARGIN, which is 1 mm more than necessary."""

MAX_FINGER_TURN, MAX_FINGER_SLIDE = 5e-3, 5e-4
"""[rad, m] Change of the fingers up to which a plan stays valid: half a millimetre at the pads."""

PROBE_FRACTION = 0.02
"""[1] Fraction of a segment that must be clear before a waiting arm continues."""


class PlanFollower:
    """Moves one arm along plans. Its methods are pure. For use in one thread."""

    def __init__(self, world: CollisionWorld | None, *, slides: bool = False) -> None:
        """Create the follower.

        Args:
            world: the collision world; None to check no contacts.
            slides: whether the fingers slide instead of turning.
        """
        self._world = world
        self._max_finger_change = MAX_FINGER_SLIDE if slides else MAX_FINGER_TURN
        self._limiters: dict[Scaling, Limiter] = {}
        # Cache: the part of a segment that is clear with the present finger angle.
        self._known: tuple[Segment, float, float, float] | None = None

    def ahead(self, now: Following, dt: float, fraction: float) -> Following:
        """Return the place after ``dt`` [s], at most at ``fraction`` of the speed of the plan."""
        place = now.turned_over()
        pace = self._limiter(place).towards(
            place.pace, np.array([place.segment.scaling.span]), dt, fraction
        )
        return replace(place, pace=pace)

    def braking(self, now: Following, dt: float) -> Following:
        """Return the place after ``dt`` [s] of braking along the plan; ``now`` itself at rest."""
        if now.pace.at_rest:
            return now
        return replace(now, pace=self._limiter(now).stop(now.pace, dt))

    def stopping_point(self, now: Following) -> Following:
        """Return the place at which a brake that begins now comes to rest."""
        (end,) = self._limiter(now).stopping_point(now.pace).tolist()
        return now.at(min(max(end, 0.0), now.segment.scaling.span))

    def stopping_time(self, now: Following) -> float:
        """Return the time [s] that a brake which begins now takes to come to rest."""
        return self._limiter(now).stopping_time(now.pace)

    def met(self, now: Following, next_place: Following, fingers: float) -> Contact | None:
        """Return the contact on the path to ``next_place`` and on to rest; None if it is clear.

        fingers: the finger joint [rad or m].
        """
        # Segments meet at rest, so an arm on a new segment is still at its end.
        place = now if now.number == next_place.number else next_place
        return self._met(place, self.stopping_point(next_place), fingers)

    def may_go_on(self, now: Following, fingers: float) -> bool:
        """Return whether the first part of the path of a waiting arm is clear again.

        fingers: the finger joint [rad or m].
        """
        place = now.turned_over()
        span = place.segment.scaling.span
        probe = min(span, place.local + PROBE_FRACTION * span)
        return self._met(place, place.at(probe), fingers) is None

    def _met(self, place: Following, stopping_point: Following, fingers: float) -> Contact | None:
        plan, segment = place.plan, place.segment
        world = self._world
        if world is None or (
            plan.clear_of is not None
            and abs(plan.fingers - fingers) <= self._max_finger_change
            and plan.clear_of.differs_by(world.fingerprint) <= MAX_DISPLACEMENT
        ):
            return None
        start, end = (
            segment.scaling.pace(end_place.local).sigma for end_place in (place, stopping_point)
        )
        low, high = min(start, end), max(start, end)
        known = self._known
        if known is None or known[:2] != (segment, fingers) or not known[2] <= start <= known[3]:
            known = (segment, fingers, start, start)
        if known[2] <= low and high <= known[3]:
            return None
        swept = SweptClearance.about(world, MIN_CLEARANCE, segment.sweep.at(start, fingers))
        for a, b in ((low, known[2]), (known[3], high)):
            contact = (
                segment.sweep.blocked(swept, fingers, a, b, MAX_UNCHECKED_PATH) if a < b else None
            )
            if contact is not None:
                return contact.contact
        # A path that leads out of a contact is clear only from here.
        if float(swept.minimum.min()) >= MIN_CLEARANCE:
            self._known = (segment, fingers, min(low, known[2]), max(high, known[3]))
        return None

    def _limiter(self, now: Following) -> Limiter:
        """Return the limiter of tau along the segment."""
        scaling = now.segment.scaling
        if scaling not in self._limiters:
            a, j = np.array([scaling.acceleration]), np.array([scaling.jerk])
            limits = Limits(np.zeros(1), np.array([scaling.span]), np.ones(1), a, j)
            # An arm follows one plan at a time, so earlier limiters are not needed again.
            self._limiters = {scaling: Limiter(limits)}
        return self._limiters[scaling]
