"""How much of a step the arm may do, so that it slows before a contact and never makes one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from app.collision.contact import Contact
from app.collision.world import IndexArray, Placed, World
from app.geometry.arrays import FloatArray

STOP = 0.005
"""[m] The arm comes no nearer to itself or to anything else."""

SETTLING = 0.04
"""[s] Distance beyond STOP may shrink to nothing in no less time than this, whatever the speed: the
arm slows down as a body in oil, from the farther away the faster it is (Faverjon and Tournassoud,
A local based approach for path planning, ICRA 1987)."""

SAME = 1e-7
"""[m] Changes of distance below this are the rounding of the search for the nearest points."""

SAME_DEPTH = 1e-5
"""[m] The same for how deep bodies are in each other, which is known less well."""

CREEP = 1e-5
"""[m] A step that moves nothing farther than this is none: the arm has stopped."""

GRAZE = 1e-3
"""[m] Ways shorter than this are not looked at in between: no part is as thin."""

TRIES = 6
"""Shares of a step that are tried before the arm rather waits."""


SHY = 0.98
"""[1] Share of what is left that is tried next: a way that bends seldom fits to the last bit."""


@dataclass(frozen=True, eq=False)
class Advance:
    """What of a step is done.

    Attributes:
        x: (k,) where it ends [rad].
        contact: the parts that held it back, as near as they are then; None when all was done.
        stopped: whether nothing was done of it.
    """

    x: FloatArray
    contact: Contact | None = None
    stopped: bool = False


def advance(world: World, x: FloatArray, towards: FloatArray, dt: float) -> Advance:
    """Go from ``x`` (k,) [rad] on the straight line to ``towards``, as far as clearance allows.

    The step is the way of one tick of ``dt`` [s]. For each pair of bodies with the distance d the
    step may take away d - STOP times dt / SETTLING; where d is below STOP already, nothing. So
    whatever leads away from a contact is allowed. Nor may bodies pass each other between the ends
    of a step: a distance changes by no more than the bodies travel, so what the ends leave open is
    looked at in the middle, and again in the halves.
    """
    if (towards == x).all():
        return Advance(x)
    here = world.at(x)
    travel = world.travel(here, x, towards)
    part = min(dt / SETTLING, 1.0)
    # What is so far away that the whole way does not matter needs no closer look.
    free = STOP + travel / part
    watched, _ = here.nearer_than(np.where(travel > 0.0, free, -np.inf))
    before = here.distances(watched)
    close = before < free[watched]
    if not close.any():
        return Advance(towards)
    way = _Way(world, x, towards, watched[close], travel[watched[close]], before[close])
    spare = part * np.maximum(way.before - STOP, 0.0)
    rounding = np.where(way.before > 0.0, SAME, SAME_DEPTH)
    share, held, contact = 1.0, -1, None
    for _ in range(TRIES):
        # With less of the way to go fewer pairs can use up what they have to spare.
        tight = np.nonzero(share * way.travel > spare)[0]
        there = way.at(share)
        after = there.distances(way.pairs[tight])
        used = way.before[tight] - after
        over = used > spare[tight] + rounding[tight]
        if over.any():
            fits = spare[tight][over] / used[over]
            held = int(tight[over][fits.argmin()])
            share *= SHY * float(fits.min())
        elif (passed := way.passing(tight, 0.0, way.before[tight], share, after)) >= 0:
            held = passed
            share *= 0.5
        else:
            contact = None if held < 0 else there.contact(int(way.pairs[held]))
            return Advance(towards if share == 1.0 else way.x(share), contact)
        if share * float(way.travel.max()) < CREEP:
            break
    return Advance(x, here.contact(int(way.pairs[held])), stopped=True)


@dataclass(frozen=True, eq=False)
class _Way:
    """A straight way from ``start`` to ``end`` (k,) [rad], and the pairs of bodies to mind on it.

    pairs: (p,) their indices in the world. travel, before: (p,) at most how far the bodies of each
    move against each other on the whole way, and how far apart they are at its start [m].
    """

    world: World
    start: FloatArray
    end: FloatArray
    pairs: IndexArray
    travel: FloatArray
    before: FloatArray

    def x(self, share: float) -> FloatArray:
        return self.end if share == 1.0 else self.start + share * (self.end - self.start)

    def at(self, share: float) -> Placed:
        return self.world.at(self.x(share))

    def passing(
        self, mind: IndexArray, low: float, d_low: FloatArray, high: float, d_high: FloatArray
    ) -> int:
        """One of the pairs ``mind`` (m,) that comes too near between two shares of the way, or -1.

        ``d_low``, ``d_high``: (m,) the distances at both [m].
        """
        kept = np.minimum(self.before[mind], STOP)
        travel = (high - low) * self.travel[mind]
        least = 0.5 * (d_low + d_high - travel)
        unsure = (least < np.where(kept > 0.0, 0.5 * kept, kept)) & (travel > GRAZE)
        if not unsure.any():
            return -1
        mind, d_low, d_high, kept = mind[unsure], d_low[unsure], d_high[unsure], kept[unsure]
        middle = 0.5 * (low + high)
        d_middle = self.at(middle).distances(self.pairs[mind])
        near = d_middle < kept - np.where(kept > 0.0, SAME, SAME_DEPTH)
        if near.any():
            return int(mind[near][0])
        first = self.passing(mind, low, d_low, middle, d_middle)
        return first if first >= 0 else self.passing(mind, middle, d_middle, high, d_high)
