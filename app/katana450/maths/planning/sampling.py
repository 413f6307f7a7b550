"""A way round: two trees of clear postures that grow towards each other, then drawn taut.

Sources: Kuffner and LaValle, RRT-Connect, ICRA 2000; Geraerts and Overmars, Creating high-quality
paths for motion planning, 2007, for shortcuts. Chance comes from a seed, and effort is counted in
postures, so the same question has the same answer on every machine.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final

import numpy as np

from katana450.errors import BlockedError
from katana450.maths.collision.contact import Contact
from katana450.maths.collision.world import CollisionWorld
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.chain import Chain
from katana450.maths.planning.clearance import SweptClearance
from katana450.maths.planning.joint_path import JointPath
from katana450.maths.planning.plan import MARGIN, check_clear

TREE_STEP: Final = 0.3
"""[s] How long the joints move at full speed from one posture of a tree to the next."""

MAX_POSTURES: Final = 3000
"""Postures drawn before the search is given up: some seconds."""

SHORTCUTS: Final = 150
"""Tries to go straight from one place of the way to another."""

ROUNDINGS: Final = (1.0, 0.5, 0.25, 0.1, 0.03)
"""Fractions of half a leg that a corner may cut off, the smoothest first."""

SAME_POSTURE_TIME: Final = 1e-3
"""[s] What is nearer than this is the same posture."""


@dataclass
class _Tree:
    """Postures (k,) [rad] and the one each was reached from."""

    postures: list[FloatArray]
    came_from: list[int] = field(default_factory=lambda: [-1])

    def nearest(self, q: FloatArray, speed: FloatArray) -> int:
        away = np.abs(np.array(self.postures) - q) / speed
        return int(np.einsum("nk,nk->n", away, away).argmin())

    def grown(self, number: int, q: FloatArray) -> int:
        self.postures.append(q)
        self.came_from.append(number)
        return len(self.postures) - 1

    def way(self, number: int) -> list[FloatArray]:
        """From posture ``number`` back to the root."""
        way = []
        while number >= 0:
            way.append(self.postures[number])
            number = self.came_from[number]
        return way


class _Search:
    """One question: from where to where, in what room."""

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

    def met(self, a: FloatArray, b: FloatArray) -> Contact | None:
        """What is too near on the straight way from `a` to `b`; None when nothing is."""
        found = self.room.blocked_line(np.append(a, self.fingers), np.append(b, self.fingers))
        return None if found is None else found.contact

    def connected(self, random: np.random.Generator) -> list[FloatArray] | None:
        """Vias of a clear way; None when EFFORT was not enough."""
        chain, speed = self.chain, self.chain.speed
        trees = _Tree([self.start]), _Tree([self.end])
        for turn in range(MAX_POSTURES):
            growing, other = trees[turn % 2], trees[1 - turn % 2]
            drawn = random.uniform(chain.lower, chain.upper)
            new = self._extended(growing, growing.nearest(drawn, speed), drawn)
            if new is None:
                continue
            reached = growing.postures[new]
            number: int | None = other.nearest(reached, speed)
            while number is not None and not self._same(other.postures[number], reached):
                number = self._extended(other, number, reached)
            if number is not None:
                way = growing.way(new)[::-1] + other.way(number)[1:]
                return way if turn % 2 == 0 else way[::-1]
        return None

    def _extended(self, tree: _Tree, number: int, towards: FloatArray) -> int | None:
        """A step from posture `number`; None when it is not clear."""
        here = tree.postures[number]
        way = towards - here
        fraction = TREE_STEP / float((np.abs(way) / self.chain.speed).max())
        q = towards if fraction >= 1.0 else here + fraction * way
        return None if self.met(here, q) is not None else tree.grown(number, q)

    def _same(self, a: FloatArray, b: FloatArray) -> bool:
        return bool((np.abs(a - b) <= SAME_POSTURE_TIME * self.chain.speed).all())

    def taut(self, way: list[FloatArray], random: np.random.Generator) -> list[FloatArray]:
        """`way` with its detours cut off, never longer in time."""
        for _ in range(SHORTCUTS):
            if len(way) == 2:
                break
            low, high = np.sort(random.uniform(0.0, len(way) - 1.0, 2)).tolist()
            before, after = int(low), int(high)
            if before == after:
                continue
            a = way[before] + (low - before) * (way[before + 1] - way[before])
            b = way[after] + (high - after) * (way[min(after + 1, len(way) - 1)] - way[after])
            around = [a, *way[before + 1 : after + 1], b]
            if self._long([a, b]) < 0.99 * self._long(around) and self.met(a, b) is None:
                way = self._tidied([*way[: before + 1], a, b, *way[after + 1 :]])
        return self._fewer(way)

    def _fewer(self, way: list[FloatArray]) -> list[FloatArray]:
        """Without the vias that the way does not need."""
        number = 1
        while number < len(way) - 1:
            if self.met(way[number - 1], way[number + 1]) is None:
                del way[number]
            else:
                number += 1
        return way

    def _tidied(self, way: list[FloatArray]) -> list[FloatArray]:
        kept = way[:1]
        for q in way[1:-1]:
            if not self._same(kept[-1], q) and not self._same(way[-1], q):
                kept.append(q)
        return [*kept, way[-1]]

    def _long(self, way: list[FloatArray]) -> float:
        """[s] with every leg at full speed."""
        legs = np.abs(np.diff(np.array(way), axis=0)) / self.chain.speed
        return float(legs.max(axis=1).sum())


def collision_free_path(
    chain: Chain,
    start: FloatArray,
    end: FloatArray,
    world: CollisionWorld,
    fingers: float,
    seed: int,
) -> JointPath:
    """A clear path from `start` to `end` (5,) [rad] with the fingers at one angle [rad].

    Raises BlockedError when an end is too near to something, or none was found.
    """
    search = _Search(chain, world, fingers, start, end)
    for name, q in (("start", start), ("end", end)):
        met = search.met(q, q)
        if met is not None:
            one, other = met.parts
            raise BlockedError(
                f"At the {name} {one} and {other} are {1e3 * met.distance:.1f} mm from each other, "
                "which is too near: choose another posture."
            )
    random = np.random.default_rng(seed)
    way = search.connected(random)
    if way is None:
        straight = search.met(start, end)
        between = (
            "" if straight is None else f" The straight way meets {' and '.join(straight.parts)}."
        )
        raise BlockedError(
            f"No way round was found in {MAX_POSTURES} tries from seed {seed}.{between} "
            "Try another seed, or go by a posture in between."
        )
    way = search.taut(way, random)
    # Each corner as smooth as there is room for.
    blend = np.full(len(way) - 2, ROUNDINGS[0])
    for rounding in ROUNDINGS:
        blend = np.minimum(blend, rounding)
        path = JointPath(chain, np.array(way), blend)
        try:
            check_clear(path, world, fingers)
        except BlockedError:
            continue
        return path
    raise BlockedError(
        "A way round was found, but none that can be run through without a halt. Try another seed."
    )
