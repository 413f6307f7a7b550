"""Limits on a step near obstacles: the arm slows before a contact and never makes one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from katana450.maths.collision.contact import Contact
from katana450.maths.collision.world import PATH_LENGTH_FACTOR, CollisionWorld, PlacedWorld
from katana450.maths.geometry.arrays import FloatArray

MIN_CLEARANCE = 0.005
"""Distance [m] that the arm keeps from itself and from everything else."""

MIN_STOP_TIME = 0.04
"""Minimum time [s] in which the distance beyond MIN_CLEARANCE may shrink to zero, at any speed. The
arm slows down like a body in oil, and begins farther away the faster it is (Faverjon and
Tournassoud, A local based approach for path planning, ICRA 1987).
"""

DISTANCE_ROUNDING = 1e-7
"""Changes of distance [m] below this are rounding of the search for the nearest points."""

DEPTH_ROUNDING = 1e-5
"""The same bound [m] for the depth of overlapping bodies, which is less accurate."""

MIN_TRAVEL = 1e-5
"""A step that moves nothing farther than this [m] counts as no step: the arm has stopped."""

MAX_UNCHECKED_PATH = 1e-3
"""Paths shorter than this [m] are not checked in between: no part is as thin."""

STEP_ATTEMPTS = 6
"""Number of fractions of a step that are tried before the arm waits."""


def rounding_of(distance: float) -> float:
    """Return the bound [m] on the rounding of ``distance`` [m].

    Bodies that touch overlap on one processor and are 1e-17 m apart on another: their rounding is
    that of depths.
    """
    return DISTANCE_ROUNDING if distance > DISTANCE_ROUNDING else DEPTH_ROUNDING


MAX_GLANCE_ANGLE = 0.6
"""Sum of joint turns [rad] above which `is_surely_clear` gives no answer."""

STEP_FRACTION = 0.98
"""Fraction [1] of the remaining step that is tried next: a bent path seldom fits exactly."""


@dataclass(frozen=True, eq=False)
class Advance:
    """The allowed part of a step.

    Attributes:
        x: the end (k,) of the step [rad or m].
        contact: the parts that limit the step, at its end; None when the whole step is allowed.
        stopped: True if no part of the step is allowed.
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
    """Move from ``x`` (k,) [rad or m] straight to ``towards``, as far as clearance allows.

    The step is the path of one tick of ``dt`` [s]. For a pair of bodies at the distance d, the step
    may reduce d - MIN_CLEARANCE by the fraction dt / MIN_STOP_TIME. For a nearer pair it may not
    reduce the distance; motion away from a contact is always allowed. Bodies must not pass each
    other between the ends of a step either. A distance changes by no more than the bodies travel,
    so a case that the ends leave open is checked in the middle, and again in the halves. ``keep``
    (p,) [m] is the distance that each pair keeps, in place of MIN_CLEARANCE or that of close pairs.
    """
    if (towards == x).all():
        return Advance(x)
    minimum = world.kept(MIN_CLEARANCE) if keep is None else keep
    start = world.at(x)
    travel = world.travel(start, x, towards)
    part = min(dt / MIN_STOP_TIME, 1.0)
    # Pairs so far apart that the whole path does not matter need no closer check.
    free = minimum + travel / part
    free[travel == 0.0] = -np.inf
    path = _Path(world, x, towards)
    for pair in start.nearer_than(free)[0].tolist():
        before = start.distance(pair)
        if before < free[pair]:
            path.active.append(
                _ActivePair(pair, float(travel[pair]), before, part, float(minimum[pair]))
            )
    if not path.active:
        return Advance(towards)
    fraction, held = 1.0, None
    for _ in range(STEP_ATTEMPTS):
        end = path.at(fraction)
        after = [
            (active, end.distance(active.pair)) for active in path.active if active.tight(fraction)
        ]
        fit, tightest = min(((active.fit(d), active) for active, d in after), default=(1.0, None))
        if fit < 1.0:
            held = tightest
            fraction *= STEP_FRACTION * fit
        elif passed := next(
            (e for e, d in after if path.passes(e, 0.0, e.before, fraction, d)), None
        ):
            held = passed
            fraction *= 0.5
        else:
            contact = None if held is None else end.contact(held.pair)
            return Advance(path.x(fraction), contact)
        if fraction * float(travel.max()) < MIN_TRAVEL:
            break
    return Advance(x, None if held is None else start.contact(held.pair), stopped=True)


def is_surely_clear(world: CollisionWorld, x: FloatArray, towards: FloatArray) -> bool:
    """Return True if a bound shows that no path from ``x`` to ``towards`` comes too near.

    On the path every joint stays between its two ends. False means only that a full check is
    needed: the joints may be too far apart for the bound, or a part too near.
    """
    turns = world.linkage.turned(towards - x)
    if turns >= MAX_GLANCE_ANGLE:
        return False
    placed = world.at(x)
    needed = (
        world.kept(MIN_CLEARANCE)
        + world.travel(placed, x, towards) * (1.0 / (1.0 - turns)) / PATH_LENGTH_FACTOR
    )
    pairs, _ = placed.nearer_than(needed)
    return all(placed.distance(pair) >= needed[pair] for pair in pairs.tolist())


@dataclass(frozen=True, order=True)
class _ActivePair:
    """A pair of bodies that a step may bring too near.

    Attributes:
        pair: the number of the pair in the world.
        travel: bound on the relative motion of its bodies on the whole path [m].
        before: distance of the bodies at the start [m].
        part: fraction [1] of the distance beyond ``keep`` that the step may use.
        keep: the distance to keep [m].
    """

    pair: int
    travel: float
    before: float
    part: float
    keep: float

    @property
    def spare(self) -> float:
        """The distance [m] by which the step may bring the bodies nearer."""
        return self.part * max(self.before - self.keep, 0.0)

    def tight(self, fraction: float) -> bool:
        """Return True if this fraction of the path may bring the bodies too near."""
        return fraction * self.travel > self.spare

    def fit(self, after: float) -> float:
        """Return the allowed fraction of a step that ends with the distance ``after`` [m]."""
        used = self.before - after
        return self.spare / used if used > self.spare + rounding_of(self.before) else 1.0


class _Path:
    """A straight path from ``start`` to ``end`` (k,) [rad or m], and the pairs to check on it."""

    def __init__(self, world: CollisionWorld, start: FloatArray, end: FloatArray) -> None:
        self.active: list[_ActivePair] = []
        self._world = world
        self._start = start
        self._end = end
        self._placed: dict[float, PlacedWorld] = {}

    def x(self, fraction: float) -> FloatArray:
        """Return the place at ``fraction`` of the path."""
        return self._end if fraction == 1.0 else self._start + fraction * (self._end - self._start)

    def at(self, fraction: float) -> PlacedWorld:
        """Return the world at ``fraction`` of the path."""
        placed = self._placed.get(fraction)
        if placed is None:
            placed = self._placed[fraction] = self._world.at(self.x(fraction))
        return placed

    def passes(
        self, active: _ActivePair, low: float, d_low: float, high: float, d_high: float
    ) -> bool:
        """Return True if a pair comes too near between the fractions ``low`` and ``high``.

        ``d_low``, ``d_high``: distance of its bodies at both [m].
        """
        travel = (high - low) * active.travel
        clearance = min(active.before, active.keep)
        # Bodies that overlap cannot pass each other.
        if (
            active.before <= 0.0
            or travel <= MAX_UNCHECKED_PATH
            or d_low + d_high - travel >= clearance
        ):
            return False
        middle = 0.5 * (low + high)
        d_middle = self.at(middle).distance(active.pair)
        return (
            d_middle < clearance - DISTANCE_ROUNDING
            or self.passes(active, low, d_low, middle, d_middle)
            or self.passes(active, middle, d_middle, high, d_high)
        )
