"""Limits on a step near obstacles: the arm slows before a contact and never makes one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from katana450.maths.collision.engine import Contact
from katana450.maths.collision.world import PATH_LENGTH_FACTOR, CollisionWorld, PlacedWorld
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.geometry.curve import JointCurve

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

MAX_PLACES = 100
"""Number of places on a curve that are checked before it counts as not clear."""

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
    curve: JointCurve | None = None,
) -> Advance:
    """Move from ``x`` (k,) [rad or m] straight to ``towards``, as far as clearance allows.

    The step is the path of one tick of ``dt`` [s]. For a pair of bodies at the distance d, the step
    may reduce d - MIN_CLEARANCE by the fraction dt / MIN_STOP_TIME. For a nearer pair it may not
    reduce the distance; motion away from a contact is always allowed. Bodies must not pass each
    other between the ends of a step either. A distance changes by no more than the bodies travel,
    so a case that the ends leave open is checked in the middle, and again in the halves. ``keep``
    (p,) [m] is the distance that each pair keeps, in place of MIN_CLEARANCE or that of close pairs.
    A ``curve`` from ``x`` to ``towards`` is allowed if it and the straight path are; no part of it
    is allowed by itself.
    """
    change = np.abs(towards - x) + (0.0 if curve is None else 0.5 * curve.bend(0.0, 1.0))
    if not change.any():
        return Advance(x)
    minimum = world.kept(MIN_CLEARANCE) if keep is None else keep
    start = world.at(x)
    travel = (
        world.travel(start, x, towards) if curve is None else path_lengths(world, start, x, change)
    )
    part = min(dt / MIN_STOP_TIME, 1.0)
    # Pairs so far apart that the whole path does not matter need no closer check.
    free = minimum + travel / part
    free[travel == 0.0] = -np.inf
    path = _Path(world, x, towards)
    near = start.nearer_than(free)[0].tolist()
    distances = {pair: d for pair in near if (d := start.distance(pair)) < free[pair]}
    if not (near := list(distances)):
        return Advance(towards)
    bent = None
    if curve is not None:
        bent = _BentPath(world, curve, (x, start), (towards, path.at(1.0)), distances, minimum)
        # The straight path is no nearer than the bound on the curve, so it needs no other pairs.
        if not (near := bent.open_pairs(0.0, 1.0, near)):
            return Advance(towards)
        travel = world.travel(start, x, towards)
    path.active = [
        _ActivePair(pair, float(travel[pair]), distances[pair], part, float(minimum[pair]))
        for pair in near
    ]
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
        elif held is None and bent is not None:
            contact = bent.contact(near)
            return Advance(towards) if contact is None else Advance(x, contact, stopped=True)
        else:
            contact = None if held is None else end.contact(held.pair)
            return Advance(path.x(fraction), contact)
        if fraction * float(travel.max()) < MIN_TRAVEL:
            break
    return Advance(x, None if held is None else start.contact(held.pair), stopped=True)


def is_surely_clear(world: CollisionWorld, x: FloatArray, reach: FloatArray) -> bool:
    """Return True if a bound shows that no path from ``x`` (k,) [rad or m] comes too near.

    reach: (k,) the farthest that each variable is from ``x`` on the path. False means only that a
    full check is needed: the joints may go too far for the bound, or a part may be too near.
    """
    turns = world.linkage.turned(reach)
    if turns >= MAX_GLANCE_ANGLE:
        return False
    placed = world.at(x)
    needed = (
        world.kept(MIN_CLEARANCE)
        + world.travel(placed, x, x + reach) * (1.0 / (1.0 - turns)) / PATH_LENGTH_FACTOR
    )
    pairs, _ = placed.nearer_than(needed)
    return all(placed.distance(pair) >= needed[pair] for pair in pairs.tolist())


def path_lengths(
    world: CollisionWorld, placed: PlacedWorld, x: FloatArray, change: FloatArray
) -> FloatArray:
    """Return `CollisionWorld.travel` for a ``change`` (k,) of any size, which may be infinite."""
    turns = world.linkage.turned(change)
    if turns >= 1.0:
        return np.full(len(world.first), np.inf)
    return world.travel(placed, x, x + change) * max(1.0, 1.0 / (1.0 - turns) / PATH_LENGTH_FACTOR)


def _least(before: float, after: float, length: float, pull: float) -> float:
    """Return a lower bound [m] on the distance of two bodies between two places.

    Args:
        before: the distance at the first [m].
        after: the distance at the other [m].
        length: bound on the relative motion of the bodies between them [m].
        pull: bound on their relative acceleration, times the square of the time between them [m].
    """
    least = 0.5 * (before + after - length)
    if least <= 0.0:
        return least
    # The lowest point of the parabola, unless it is at an end.
    sag, slope = 0.5 * (length * length / least + pull), abs(after - before)
    dip = 0.25 * (sag - slope) ** 2 / sag if slope < sag else 0.0
    return max(least, min(before, after) - dip)


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


class _BentPath:
    """A curve, and the pairs to check on it.

    A pair that begins with its minimum keeps it, up to DISTANCE_ROUNDING. A nearer one comes no
    nearer.

    Let s from 0 to 1 lead from one place to another. A variable's rate differs from its mean by at
    most half of its bend. So a point of one body moves relative to one of another at the rate L =
    ``travel`` at most, and their distance f has f'' <= C = L^2 / f + A. Here A bounds their
    acceleration. Turns at the rates w_i about axes at the distances r_i give a point the rate L =
    sum w_i r_i, and the acceleration (2 sum w_i) L + sum r_i w_i' at most. The distance d of the
    bodies is the smallest f. So d - C s^2 / 2 is concave, and d is above the parabola with the
    second derivative C through both ends. If that is too near, the halves are looked at.
    """

    def __init__(
        self,
        world: CollisionWorld,
        curve: JointCurve,
        start: tuple[FloatArray, PlacedWorld],
        end: tuple[FloatArray, PlacedWorld],
        distances: Mapping[int, float],
        minimum: FloatArray,
    ) -> None:
        """Create the path.

        Args:
            world: the bodies.
            curve: the curve.
            start: the variables (k,) at its start [rad or m], and the world there.
            end: those at its end.
            distances: the distance [m] at its start of each pair that may come too near.
            minimum: the distance (p,) [m] that each pair keeps.
        """
        self._world = world
        self._curve = curve
        self._minimum = minimum
        self._places = {0.0: start, 1.0: end}
        # A distance within the rounding counts as the minimum, or each piece would take as much.
        self._clearances = {
            pair: d if d < minimum[pair] - DISTANCE_ROUNDING else float(minimum[pair])
            for pair, d in distances.items()
        }

    def _at(self, part: float) -> tuple[FloatArray, PlacedWorld]:
        if part not in self._places:
            x = self._curve.place(part)
            self._places[part] = x, self._world.at(x)
        return self._places[part]

    def open_pairs(self, low: float, high: float, pairs: Sequence[int]) -> list[int]:
        """Return those of ``pairs`` that may come too near between two fractions."""
        (x, first), (end, last) = self._at(low), self._at(high)
        bend = self._curve.bend(low, high)
        change = np.abs(end - x) + 0.5 * bend
        travel = path_lengths(self._world, first, x, change)
        # On the way a radius r_i grows by ``travel`` at most, and the bend is twice the change.
        pull = 4.0 * self._world.linkage.turned(change) * travel
        pull += self._world.travel(first, x, x + bend)
        near = []
        for pair in pairs:
            clearance, before = self._clearances[pair], first.distance(pair)
            length = float(travel[pair])
            if before >= clearance + length:
                continue
            after = last.distance(pair)
            shortest = MIN_TRAVEL if clearance == self._minimum[pair] else MAX_UNCHECKED_PATH
            least = after if length <= shortest else _least(before, after, length, pull[pair])
            if least < clearance - DISTANCE_ROUNDING:
                near.append(pair)
        return near

    def contact(self, pairs: Sequence[int]) -> Contact | None:
        """Return a contact of ``pairs``; None if the path is clear of them.

        A path that needs more than MAX_PLACES places to show this is not clear.
        """
        # Bodies that overlap cannot pass each other.
        pieces = [(0.0, 1.0, [pair for pair in pairs if self._clearances[pair] > 0.0])]
        while pieces:
            low, high, pairs = pieces.pop()
            near = self.open_pairs(low, high, pairs)
            end = self._at(high)[1]
            for pair in pairs:
                clearance = self._clearances[pair]
                if end.distance(pair) < clearance - rounding_of(clearance):
                    return end.contact(pair)
            if near and len(self._places) >= MAX_PLACES:
                return end.contact(near[0])
            if near:
                middle = 0.5 * (low + high)
                pieces += ((middle, high, near), (low, middle, near))
        return None
