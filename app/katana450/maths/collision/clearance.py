"""How much of a step the arm may do, so that it slows before a contact and never makes one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from katana450.maths.collision.contact import Contact
from katana450.maths.collision.world import PATH_LENGTH_FACTOR, CollisionWorld, PlacedWorld
from katana450.maths.geometry.arrays import FloatArray

STOP = 0.005
"""[m] The arm comes no nearer to itself or to anything else."""

MIN_STOP_TIME = 0.04
"""[s] Distance beyond STOP may shrink to nothing in no less time than this, whatever the speed: the
arm slows down as a body in oil, from the farther away the faster it is (Faverjon and Tournassoud,
A local based approach for path planning, ICRA 1987)."""

DISTANCE_ROUNDING = 1e-7
"""[m] Changes of distance below this are the rounding of the search for the nearest points."""

DEPTH_ROUNDING = 1e-5
"""[m] The same for how deep bodies are in each other, which is known less well."""

MIN_TRAVEL = 1e-5
"""[m] A step that moves nothing farther than this is none: the arm has stopped."""

MAX_UNCHECKED_PATH = 1e-3
"""[m] Ways shorter than this are not looked at in between: no part is as thin."""

STEP_ATTEMPTS = 6
"""Fractions of a step that are tried before the arm rather waits."""


MAX_GLANCE_ANGLE = 0.6
"""[rad] Joints that turn more than this together are not judged at a glance."""

STEP_FRACTION = 0.98
"""[1] Fraction of what is left that is tried next: a way that bends seldom fits to the last bit."""


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


def advance(
    world: CollisionWorld,
    x: FloatArray,
    towards: FloatArray,
    dt: float,
    keep: FloatArray | None = None,
) -> Advance:
    """Go from ``x`` (k,) [rad] on the straight line to ``towards``, as far as clearance allows.

    The step is the way of one tick of ``dt`` [s]. For each pair of bodies with the distance d the
    step may take away d - STOP times dt / SETTLING; where d is below STOP already, nothing. So
    whatever leads away from a contact is allowed. Nor may bodies pass each other between the ends
    of a step: a distance changes by no more than the bodies travel, so what the ends leave open is
    looked at in the middle, and again in the halves. keep: (p,) [m] the distance that each pair
    keeps, in place of STOP.
    """
    if (towards == x).all():
        return Advance(x)
    minimum = np.full(len(world.first), STOP) if keep is None else keep
    here = world.at(x)
    travel = world.travel(here, x, towards)
    part = min(dt / MIN_STOP_TIME, 1.0)
    # What is so far away that the whole way does not matter needs no closer look.
    free = minimum + travel / part
    free[travel == 0.0] = -np.inf
    way = _Path(world, x, towards)
    for pair in here.nearer_than(free)[0].tolist():
        before = here.distance(pair)
        if before < free[pair]:
            way.minded.append(
                _ActivePair(pair, float(travel[pair]), before, part, float(minimum[pair]))
            )
    if not way.minded:
        return Advance(towards)
    fraction, held = 1.0, None
    for _ in range(STEP_ATTEMPTS):
        there = way.at(fraction)
        after = [(each, there.distance(each.pair)) for each in way.minded if each.tight(fraction)]
        fit, pressed = min(((each.fit(d), each) for each, d in after), default=(1.0, None))
        if fit < 1.0:
            held = pressed
            fraction *= STEP_FRACTION * fit
        elif passed := next(
            (e for e, d in after if way.passes(e, 0.0, e.before, fraction, d)), None
        ):
            held = passed
            fraction *= 0.5
        else:
            contact = None if held is None else there.contact(held.pair)
            return Advance(way.x(fraction), contact)
        if fraction * float(travel.max()) < MIN_TRAVEL:
            break
    return Advance(x, None if held is None else here.contact(held.pair), stopped=True)


def is_surely_clear(world: CollisionWorld, x: FloatArray, towards: FloatArray) -> bool:
    """Whether nothing comes nearer than STOP on any way from ``x`` to ``towards``, at a glance.

    On the way no joint leaves the span between its two ends. False only says that it has to be
    looked at: the joints may be too far apart for that, or something too near.
    """
    turns = float(np.abs(towards - x).sum())
    if turns >= MAX_GLANCE_ANGLE:
        return False
    here = world.at(x)
    needed = STOP + world.travel(here, x, towards) * (1.0 / (1.0 - turns)) / PATH_LENGTH_FACTOR
    pairs, _ = here.nearer_than(needed)
    return all(here.distance(pair) >= needed[pair] for pair in pairs.tolist())


@dataclass(frozen=True, order=True)
class _ActivePair:
    """A pair of bodies that a step may bring too near.

    pair: its number in the world. travel: at most how far its bodies move against each other on the
    whole way. before: how far apart they are at its start [m]. part: of what is beyond ``keep``
    then, the step may take away so much [1]. keep: the distance they keep [m].
    """

    pair: int
    travel: float
    before: float
    part: float
    keep: float

    @property
    def spare(self) -> float:
        """[m] How much nearer the step may bring them."""
        return self.part * max(self.before - self.keep, 0.0)

    def tight(self, fraction: float) -> bool:
        """Whether that much of the way could be too much."""
        return fraction * self.travel > self.spare

    def fit(self, after: float) -> float:
        """What fraction of a step is allowed that ends with the distance ``after`` [m]."""
        used = self.before - after
        rounding = DISTANCE_ROUNDING if self.before > 0.0 else DEPTH_ROUNDING
        return self.spare / used if used > self.spare + rounding else 1.0


class _Path:
    """A straight way from ``start`` to ``end`` (k,) [rad], and the pairs to mind on it."""

    def __init__(self, world: CollisionWorld, start: FloatArray, end: FloatArray) -> None:
        self.minded: list[_ActivePair] = []
        self._world = world
        self._start = start
        self._end = end
        self._placed: dict[float, PlacedWorld] = {}

    def x(self, fraction: float) -> FloatArray:
        return self._end if fraction == 1.0 else self._start + fraction * (self._end - self._start)

    def at(self, fraction: float) -> PlacedWorld:
        found = self._placed.get(fraction)
        if found is None:
            found = self._placed[fraction] = self._world.at(self.x(fraction))
        return found

    def passes(
        self, minded: _ActivePair, low: float, d_low: float, high: float, d_high: float
    ) -> bool:
        """Whether a pair comes too near between two shares of the way.

        ``d_low``, ``d_high``: how far apart its bodies are at both [m].
        """
        travel = (high - low) * minded.travel
        kept = min(minded.before, minded.keep)
        # Bodies that are in each other have nothing left to pass.
        if minded.before <= 0.0 or travel <= MAX_UNCHECKED_PATH or d_low + d_high - travel >= kept:
            return False
        middle = 0.5 * (low + high)
        d_middle = self.at(middle).distance(minded.pair)
        return (
            d_middle < kept - DISTANCE_ROUNDING
            or self.passes(minded, low, d_low, middle, d_middle)
            or self.passes(minded, middle, d_middle, high, d_high)
        )
