"""Clearance of whole paths, not of samples: whether a path is clear, and its nearest place.

A distance changes by no more than the bodies travel against each other, and that is bounded by the
turns of their joints. A place on a path therefore decides for an interval about it. Where that
leaves a case open, the interval is halved (Schwarzer, Saha and Latombe, Exact collision checking of
robot paths, WAFR 2002).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from katana450.maths.collision.clearance import DEPTH_ROUNDING, DISTANCE_ROUNDING, STOP
from katana450.maths.collision.contact import Contact
from katana450.maths.collision.world import MAX_PATH_LENGTH, CollisionWorld, PlacedWorld
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.planning.checkpoint import checkpoint

FINE = 1e-4
"""An interval on which no body travels farther than this [m] is not halved: the clearance may be
smaller than required by that much.
"""

FRACTION = 0.1
"""Relative accuracy [1] of the nearest clearance."""

At = Callable[[float], FloatArray]
"""A function from a place on a path to x (k,) [rad or m]."""

Turned = Callable[[float, float], FloatArray]
"""A function from two places on a path to a bound (k,) on the turn of each joint between them [rad
or m].
"""


@dataclass(frozen=True, eq=False)
class Clearance:
    """The nearest contact on a path, and its place sigma from 0 to 1."""

    contact: Contact
    sigma: float


@dataclass(frozen=True, eq=False)
class SweptClearance:
    """A collision world, and the distance that a path keeps.

    Attributes:
        world: bodies and pairs.
        minimum: the distance (p,) that each pair keeps [m].
    """

    world: CollisionWorld
    minimum: FloatArray

    @staticmethod
    def about(
        world: CollisionWorld, margin: float, start: FloatArray, end: FloatArray | None = None
    ) -> SweptClearance:
        """Return the room for a path from `start` (k,) to `end` (k,) with `margin` [m].

        Pairs that are nearer at the start come no nearer, so a path may lead out of a contact.
        Pairs that are nearer at the end may be as near as there, but not below STOP.
        """
        minimum = world.kept(margin)
        for x, lowest in ((start, -np.inf), (end, STOP)):
            if x is None:
                continue
            placed = world.at(x)
            for pair in placed.nearer_than(margin)[0].tolist():
                distance = placed.distance(pair)
                rounding = DISTANCE_ROUNDING if distance > 0.0 else DEPTH_ROUNDING
                minimum[pair] = min(minimum[pair], max(distance - rounding, lowest))
        return SweptClearance(world, minimum)

    def blocked(
        self, at: At, turned: Turned, low: float = 0.0, high: float = 1.0, fine: float = FINE
    ) -> Clearance | None:
        """Return a place on the path from `low` to `high` that is too near; None if it is clear.

        The first place found is returned. Intervals on which no body travels farther than `fine`
        [m] are not halved.
        """
        pieces = [(low, high)]
        while pieces:
            checkpoint()
            low, high = pieces.pop()
            middle = 0.5 * (low + high)
            x = at(middle)
            placed = self.world.at(x)
            travel = self._travel(placed, x, turned, low, high)
            # If joints turn too far for a bound, only the place itself is checked.
            reach = np.zeros(len(self.minimum)) if travel is None else travel
            left_open = travel is None
            for pair in placed.nearer_than(self.minimum + reach)[0].tolist():
                distance = placed.distance(pair)
                if distance < self.minimum[pair]:
                    return Clearance(placed.contact(pair), middle)
                left_open |= distance < self.minimum[pair] + reach[pair] and reach[pair] > fine
            if left_open:
                pieces += [(middle, high), (low, middle)]
        return None

    def worst(self, x: FloatArray) -> Contact:
        """Return the contact at `x` (k,), where some pair is too near, that violates most."""
        placed = self.world.at(x)
        pairs = placed.nearer_than(self.minimum)[0]
        beyond = [placed.distance(pair) - self.minimum[pair] for pair in pairs.tolist()]
        return placed.contact(int(pairs[np.argmin(beyond)]))

    def blocked_line(self, start: FloatArray, end: FloatArray) -> Clearance | None:
        """Check the straight line from `start` (k,) to `end` (k,) [rad or m], as `blocked`."""
        line = end - start
        return self.blocked(
            lambda fraction: start + fraction * line, lambda a, b: (b - a) * np.abs(line)
        )

    def nearest(self, at: At, turned: Turned) -> Clearance | None:
        """Return the nearest place of the whole path, to FRACTION; None when no parts can meet."""
        best: Clearance | None = None
        pieces = [(0.0, 1.0)]
        while pieces:
            checkpoint()
            low, high = pieces.pop()
            middle = 0.5 * (low + high)
            x = at(middle)
            placed = self.world.at(x)
            here = placed.nearest()
            if here is None:
                return None
            if best is None or here.distance < best.contact.distance:
                best = Clearance(here, middle)
            travel = self._travel(placed, x, turned, low, high)
            if travel is None:
                pieces += [(low, middle), (middle, high)]
                continue
            wanted = best.contact.distance - max(FRACTION * abs(best.contact.distance), FINE)
            if any(
                placed.distance(pair) < wanted + travel[pair]
                for pair in placed.nearer_than(wanted + travel)[0].tolist()
                if travel[pair] > FINE
            ):
                pieces += [(low, middle), (middle, high)]
        return best

    def _travel(
        self, placed: PlacedWorld, x: FloatArray, turned: Turned, low: float, high: float
    ) -> FloatArray | None:
        """Return a bound (p,) on the travel of each pair from `x`, in the middle, to the interval.

        None means that the joints turn too far for a bound.
        """
        middle = 0.5 * (low + high)
        turns = np.maximum(turned(low, middle), turned(middle, high))
        if float(turns.sum()) > MAX_PATH_LENGTH:
            return None
        return self.world.travel(placed, x, x + turns)
