"""A path around obstacles: two trees of clear postures that grow together, then shortcuts.

Sources: Kuffner and LaValle, RRT-Connect, ICRA 2000; Geraerts and Overmars, Creating high-quality
paths for motion planning, 2007, for shortcuts. Random numbers come from a seed, and effort is
counted in postures, so the same question has the same answer on every machine.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from katana450.errors import BlockedError
from katana450.maths.collision.engine import Contact
from katana450.maths.collision.world import CollisionWorld
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.chain import Chain
from katana450.maths.planning.checkpoint import checkpoint
from katana450.maths.planning.clearance import SweptClearance
from katana450.maths.planning.joint_path import JointPath
from katana450.maths.planning.plan import MARGIN, apart, check_clear

TREE_STEP: Final = 0.3
"""Duration [s] of the motion at full speed from one posture of a tree to the next."""

MAX_POSTURES: Final = 3000
"""Maximum number of drawn postures before the search ends without success: some seconds."""

SHORTCUTS: Final = 150
"""Number of attempts to connect two places of the path by a straight line."""

ROUNDINGS: Final = (1.0, 0.5, 0.25, 0.1, 0.03)
"""Fractions of half a leg that a corner may cut off, the smoothest first."""

SAME_POSTURE_TIME: Final = 1e-3
"""Postures nearer to each other than this [s] are the same."""


@dataclass
class _Tree:
    """A tree of postures (k,) [rad]; each knows the number of its parent."""

    postures: list[FloatArray]
    came_from: list[int] = field(default_factory=lambda: [-1])

    def nearest(self, q: FloatArray, speed: FloatArray) -> int:
        """Return the number of the posture nearest to ``q`` in time."""
        away = np.abs(np.array(self.postures) - q) / speed
        return int(np.einsum("nk,nk->n", away, away).argmin())

    def grown(self, number: int, q: FloatArray) -> int:
        """Add the posture ``q``, reached from posture ``number``, and return its number."""
        self.postures.append(q)
        self.came_from.append(number)
        return len(self.postures) - 1

    def path(self, number: int) -> list[FloatArray]:
        """Return the postures from posture ``number`` back to the root."""
        path = []
        while number >= 0:
            path.append(self.postures[number])
            number = self.came_from[number]
        return path


class _Search:
    """The search for one path between two postures in one world."""

    def __init__(
        self,
        chain: Chain,
        world: CollisionWorld,
        fingers: float,
        start: FloatArray,
        end: FloatArray,
    ) -> None:
        self.chain = chain
        self.fingers = fingers
        x = np.append(start, fingers), np.append(end, fingers)
        self.room = SweptClearance.about(world, MARGIN, *x)
        self.start, self.end = start, end

    def clear(self, a: FloatArray, b: FloatArray) -> bool:
        """Return True if the straight path from `a` to `b` is clear."""
        checkpoint()
        return self.met(a, b) is None

    def met(self, a: FloatArray, b: FloatArray) -> Contact | None:
        """Return the contact on the straight path from `a` to `b`; None when it is clear."""
        contact = self.room.blocked_line(np.append(a, self.fingers), np.append(b, self.fingers))
        return None if contact is None else contact.contact

    def worst(self, q: FloatArray) -> Contact | None:
        """Return the contact at `q` that violates its minimum most; None when it is clear."""
        return None if self.met(q, q) is None else self.room.worst(np.append(q, self.fingers))

    def connected(self, random: np.random.Generator) -> list[FloatArray] | None:
        """Return the vias of a clear path; None when MAX_POSTURES were not enough."""
        speed = self.chain.speed
        trees = _Tree([self.start]), _Tree([self.end])
        for turn in range(MAX_POSTURES):
            growing, other = trees[turn % 2], trees[1 - turn % 2]
            drawn = random.uniform(self.chain.lower, self.chain.upper)
            new = self._extended(growing, growing.nearest(drawn, speed), drawn)
            if new is None:
                continue
            reached = growing.postures[new]
            number: int | None = other.nearest(reached, speed)
            while number is not None and not self.same(other.postures[number], reached):
                number = self._extended(other, number, reached)
            if number is not None:
                path = growing.path(new)[::-1] + other.path(number)[1:]
                return path if turn % 2 == 0 else path[::-1]
        return None

    def _extended(self, tree: _Tree, number: int, towards: FloatArray) -> int | None:
        """Add a step from posture `number`; return None when it is not clear."""
        posture = tree.postures[number]
        step = towards - posture
        fraction = TREE_STEP / float((np.abs(step) / self.chain.speed).max())
        q = towards if fraction >= 1.0 else posture + fraction * step
        return tree.grown(number, q) if self.clear(posture, q) else None

    def same(self, a: FloatArray, b: FloatArray) -> bool:
        """Return True if two postures are next to each other."""
        return bool((np.abs(a - b) <= SAME_POSTURE_TIME * self.chain.speed).all())

    def taut(self, path: list[FloatArray], random: np.random.Generator) -> list[FloatArray]:
        """Return `path` with its detours cut off, never longer in time."""
        for _ in range(SHORTCUTS):
            if len(path) == 2:
                break
            low, high = np.sort(random.uniform(0.0, len(path) - 1.0, 2)).tolist()
            before, after = int(low), int(high)
            if before == after:
                continue
            a = path[before] + (low - before) * (path[before + 1] - path[before])
            b = path[after] + (high - after) * (path[min(after + 1, len(path) - 1)] - path[after])
            around = [a, *path[before + 1 : after + 1], b]
            if self._duration([a, b]) < 0.99 * self._duration(around) and self.clear(a, b):
                path = self._tidied([*path[: before + 1], a, b, *path[after + 1 :]])
        return self._fewer(path)

    def _fewer(self, path: list[FloatArray]) -> list[FloatArray]:
        """Return `path` without the vias that it does not need."""
        number = 1
        while number < len(path) - 1:
            if self.clear(path[number - 1], path[number + 1]):
                del path[number]
            else:
                number += 1
        return path

    def _tidied(self, path: list[FloatArray]) -> list[FloatArray]:
        """Return `path` without vias next to each other or to its end."""
        tidied = path[:1]
        for q in path[1:-1]:
            if not (self.same(tidied[-1], q) or self.same(path[-1], q)):
                tidied.append(q)
        return [*tidied, path[-1]]

    def _duration(self, path: list[FloatArray]) -> float:
        """Return the duration [s] with every leg at full speed."""
        legs = np.abs(np.diff(np.array(path), axis=0)) / self.chain.speed
        return float(legs.max(axis=1).sum())


def collision_free_path(
    chain: Chain,
    start: FloatArray,
    end: FloatArray,
    world: CollisionWorld,
    fingers: float,
    seed: int,
) -> JointPath:
    """Return a clear path from `start` to `end` (n,) [rad] with the fingers at one angle [rad].

    Each corner is as smooth as the free space allows.

    Args:
        chain: the arm.
        start: the first posture (n,) [rad].
        end: the last posture (n,) [rad].
        world: the obstacles.
        fingers: the finger joint [rad].
        seed: the seed of the search.

    Raises:
        BlockedError: an end is too near to an obstacle, or no path was found.
    """
    search = _Search(chain, world, fingers, start, end)
    for name, q in (("start", start), ("end", end)):
        if (contact := search.worst(q)) is not None:
            raise BlockedError(
                f"At the {name}, {{parts}} would {apart(contact.distance)}, and "
                f"{1e3 * MARGIN:g} mm are required. Choose another posture.",
                parts=contact.parts,
            )
    random = np.random.default_rng(seed)
    vias = search.connected(random)
    if vias is None:
        straight = search.met(start, end)
        between = "" if straight is None else " On the straight path {parts} would meet."
        raise BlockedError(
            f"No path around the obstacles was found in {MAX_POSTURES} tries from seed {seed}."
            f"{between} Try another seed, or add a posture in between.",
            parts=() if straight is None else straight.parts,
        )
    vias = search.taut(vias, random)
    for rounding in ROUNDINGS:
        path = JointPath(chain, np.array(vias), np.full(len(vias) - 2, rounding))
        with suppress(BlockedError):
            check_clear(path, world, fingers)
            return path
    raise BlockedError(
        "The path found cannot be followed without stops at its corners. Try another seed."
    )
