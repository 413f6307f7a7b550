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

from katana450.maths.collision.clearance import MIN_CLEARANCE, rounding_of
from katana450.maths.collision.engine import Contact
from katana450.maths.collision.world import MAX_PATH_LENGTH, CollisionWorld, PlacedWorld
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.planning.checkpoint import checkpoint
from katana450.maths.planning.jet import Jet
from katana450.maths.planning.path import Path, joint_derivatives

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

SWEEP_PIECES = 512
"""Number of pieces; in each of them the rates of the joints are bounded."""

MAX_DERIVATIVE_RATIO = 2.0
"""Maximum ratio [1] of the third derivative within a piece to that at its ends."""


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
        Pairs that are nearer at the end may be as near as there, but not below MIN_CLEARANCE.
        """
        minimum = world.kept(margin)
        for x, lowest in ((start, -np.inf), (end, MIN_CLEARANCE)):
            if x is None:
                continue
            placed = world.at(x)
            for pair in placed.nearer_than(margin)[0].tolist():
                distance = placed.distance(pair)
                nearer = distance - rounding_of(distance)
                minimum[pair] = min(minimum[pair], max(nearer, lowest))
        return SweptClearance(world, minimum)

    def blocked(
        self,
        posture_at: At,
        turned: Turned,
        low: float = 0.0,
        high: float = 1.0,
        fine: float = FINE,
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
            x = posture_at(middle)
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

    def nearest(self, posture_at: At, turned: Turned) -> Clearance | None:
        """Return the nearest place of the whole path, to FRACTION; None when no parts can meet."""
        best: Clearance | None = None
        pieces = [(0.0, 1.0)]
        while pieces:
            checkpoint()
            low, high = pieces.pop()
            middle = 0.5 * (low + high)
            x = posture_at(middle)
            placed = self.world.at(x)
            clearance = placed.nearest()
            if clearance is None:
                return None
            if best is None or clearance.distance < best.contact.distance:
                best = Clearance(clearance, middle)
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


class Sweep:
    """The motion along one path. Its methods are pure."""

    def __init__(self, path: Path) -> None:
        self._path = path
        even = np.linspace(0.0, 1.0, SWEEP_PIECES + 1)
        self._sigma = np.unique(np.concatenate((even, np.array(path.joins))))
        d = np.abs(joint_derivatives(path, self._sigma))
        h = np.diff(self._sigma)[:, None]
        rate, jerk = (np.maximum(derivative[:-1], derivative[1:]) for derivative in (d[1], d[3]))
        # Between its ends a function is above its chord by at most h^2 / 8 of its second
        # derivative.
        turns = h * (rate + MAX_DERIVATIVE_RATIO * h * h / 8.0 * jerk)
        self._turned = np.vstack((np.zeros(turns.shape[1]), np.cumsum(turns, axis=0)))

    def at(self, sigma: float, fingers: float) -> FloatArray:
        """Return the joints at `sigma` and the fixed angle of the `fingers`, (6,) [rad]."""
        joints = self._path.joints(Jet.variable(sigma))
        return np.array([*(joint.c0 for joint in joints), fingers])

    def nearest(self, room: SweptClearance, fingers: float) -> Clearance | None:
        """Return the nearest contact on the whole path; None when no parts can meet."""
        return room.nearest(lambda sigma: self.at(sigma, fingers), self.turned)

    def blocked(
        self,
        room: SweptClearance,
        fingers: float,
        low: float = 0.0,
        high: float = 1.0,
        fine: float = FINE,
    ) -> Clearance | None:
        """Return a place from `low` to `high` that is too near, as `SweptClearance.blocked`."""
        return room.blocked(lambda sigma: self.at(sigma, fingers), self.turned, low, high, fine)

    def turned(self, low: float, high: float) -> FloatArray:
        """Return a bound (6,) on the turn of each joint between two places [rad]."""
        return np.append(self._passed(high) - self._passed(low), 0.0)

    def _passed(self, sigma: float) -> FloatArray:
        """Return the bound on the turns (5,) from the start to `sigma`."""
        piece = int(np.searchsorted(self._sigma, sigma, side="right")) - 1
        piece = min(max(piece, 0), len(self._sigma) - 2)
        low, high = self._sigma[piece], self._sigma[piece + 1]
        fraction = (sigma - low) / (high - low)
        before, after = self._turned[piece], self._turned[piece + 1]
        return np.asarray(before + fraction * (after - before))
