"""Whether a way is clear, and where the arm comes nearest to anything: all of it, not samples.

A distance changes by no more than the bodies travel against each other, and they travel no farther
than their joints turn. So a place of the way answers for a piece about it, and where that leaves
something open the piece is halved (Schwarzer, Saha and Latombe, Exact collision checking of robot
paths, WAFR 2002).
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
"""[m] A piece on which no body travels farther is not halved: the least clearance may be nearer by
that much than asked for."""

FRACTION = 0.1
"""[1] How exactly the nearest clearance is found, of itself."""

At = Callable[[float], FloatArray]
"""x (k,) [rad] at some place of a way."""

Turned = Callable[[float, float], FloatArray]
"""(k,) at most how far each joint turns on the way from one place to another [rad]."""


@dataclass(frozen=True, eq=False)
class Clearance:
    """Where on a way two parts come nearest. sigma: the place, from 0 to 1."""

    contact: Contact
    sigma: float


@dataclass(frozen=True, eq=False)
class SweptClearance:
    """What a way has to keep clear of, and by how much.

    world: bodies and pairs. least: (p,) [m] the distance that each pair keeps.
    """

    world: CollisionWorld
    minimum: FloatArray

    @staticmethod
    def about(
        world: CollisionWorld, margin: float, start: FloatArray, end: FloatArray | None = None
    ) -> SweptClearance:
        """Room of `margin` [m] for a way from `start` (k,) to `end` (k,) [rad].

        Pairs that are nearer at the start come no nearer: so a way may lead out of a contact. Those
        that are nearer at the end may be as near as that, but not below STOP.
        """
        minimum = np.full(len(world.first), margin)
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
        """A place on the way from `low` to `high` that is too near, or None; the first it finds.

        fine: pieces on which no body travels farther are not halved [m].
        """
        pieces = [(low, high)]
        while pieces:
            checkpoint()
            low, high = pieces.pop()
            middle = 0.5 * (low + high)
            x = at(middle)
            placed = self.world.at(x)
            travel = self._travel(placed, x, turned, low, high)
            # Where joints turn too far for a bound only the place itself is looked at.
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

    def blocked_line(self, start: FloatArray, end: FloatArray) -> Clearance | None:
        """The same on the straight line from `start` (k,) to `end` (k,) [rad]."""
        way = end - start
        return self.blocked(
            lambda fraction: start + fraction * way, lambda a, b: (b - a) * np.abs(way)
        )

    def nearest(self, at: At, turned: Turned) -> Clearance | None:
        """Where parts come nearest on the whole way, to FRACTION of it; None when none can meet."""
        best: Clearance | None = None
        pieces = [(0.0, 1.0)]
        while pieces:
            checkpoint()
            low, high = pieces.pop()
            middle = 0.5 * (low + high)
            x = at(middle)
            placed = self.world.at(x)
            here = self.world.nearest(x)
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
        """(p,) the most that each pair travels from `x`, in the middle, to any place between.

        None where the joints turn too far for a bound.
        """
        middle = 0.5 * (low + high)
        turns = np.maximum(turned(low, middle), turned(middle, high))
        if float(turns.sum()) > MAX_PATH_LENGTH:
            return None
        return self.world.travel(placed, x, x + turns)
