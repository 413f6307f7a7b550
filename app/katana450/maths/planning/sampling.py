"""A path around obstacles: two trees of clear postures that grow together, then shortcuts.

The path can also be kept on one branch, whose edges are then obstacles.

Sources: Kuffner and LaValle, RRT-Connect, ICRA 2000; Geraerts and Overmars, Creating high-quality
paths for motion planning, 2007, for shortcuts. Random numbers come from a seed, and effort is
counted in postures, so the same question has the same answer on every machine.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Final

import numpy as np

from katana450.errors import BlockedError
from katana450.maths.collision.contact import Contact
from katana450.maths.collision.world import CollisionWorld
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.arm import Five, arm_of
from katana450.maths.kinematics.branch import Branch
from katana450.maths.kinematics.chain import Chain
from katana450.maths.planning.checkpoint import checkpoint
from katana450.maths.planning.clearance import SweptClearance
from katana450.maths.planning.joint_path import JointPath
from katana450.maths.planning.plan import MARGIN, apart, check_clear

EDGE: Final = 1e-10
"""Distance [m] beyond the edge of a branch, or sine [1] of the elbow, that is only rounding."""

MAX_PIECES: Final = 4000
"""Maximum number of pieces of a line. A line along the edge needs more and is rejected."""


@dataclass(frozen=True)
class BranchRegion:
    """The postures of `chain` on `branch`, with its edges."""

    chain: Chain
    branch: Branch

    def holds(self, q: FloatArray) -> bool:
        """Return True if the posture `q` (5,) [rad] is on the branch."""
        alpha = arm_of(self.chain).angles(q)
        return self._outward(alpha) >= -EDGE and self._bend(alpha[2]) >= -EDGE

    def holds_line(self, a: FloatArray, b: FloatArray) -> bool:
        """Return True if every posture on the line from `a` to `b` (5,) [rad] is on the branch.

        The result is proven, not sampled. Between two places at a distance h the outward distance
        is at least the smaller of its two values, less h^2 / 8 times the maximum of its second
        derivative.
        """
        arm = arm_of(self.chain)
        start, end = arm.angles(a), arm.angles(b)
        if not self._holds_elbow(start[2], end[2]):
            return False
        curvature = self._curvature(a, b) / 8.0

        def at(s: float) -> float:
            one, two, three, four, five = (x + s * (y - x) for x, y in zip(start, end, strict=True))
            return self._outward((one, two, three, four, five))

        pieces = [(0.0, at(0.0), 1.0, at(1.0))]
        if min(pieces[0][1], pieces[0][3]) < -EDGE:
            return False
        for _ in range(MAX_PIECES):
            if not pieces:
                return True
            low, low_value, high, high_value = pieces.pop()
            if min(low_value, high_value) - curvature * (high - low) ** 2 >= -EDGE:
                continue
            middle = 0.5 * (low + high)
            value = at(middle)
            if value < -EDGE:
                return False
            pieces += [(low, low_value, middle, value), (middle, value, high, high_value)]
        return False

    def holds_corner(self, a: FloatArray, via: FloatArray, b: FloatArray) -> bool:
        """Return True if a rounded corner at `via` from `a` to `b` (5,) [rad] is on the branch.

        The corner is anywhere in the triangle of the three postures. The bound is the same as for
        a line, with half the square of the longest side.
        """
        if not (self.holds(a) and self.holds(via) and self.holds(b)):
            return False
        arm = arm_of(self.chain)
        lowest = min(self._outward(arm.angles(q)) for q in (a, via, b))
        sides = ((a, via), (via, b), (a, b))
        return lowest - 0.5 * max(self._curvature(*side) for side in sides) >= -EDGE

    def _curvature(self, a: FloatArray, b: FloatArray) -> float:
        """Return the maximum second derivative [m] of the outward distance from `a` to `b`."""
        arm = arm_of(self.chain)
        _, d2, d3, d4, _ = (y - x for x, y in zip(arm.angles(a), arm.angles(b), strict=True))
        return arm.l1 * d2**2 + arm.l2 * (d2 + d3) ** 2 + arm.l3 * (d2 + d3 + d4) ** 2

    def _holds_elbow(self, start: float, end: float) -> bool:
        """Return True if axis 3 keeps its side all the way between two canonical angles [rad]."""
        middle = 0.5 * (start + end)
        # Both ends are in the same half turn, which begins at a multiple of pi.
        for half in {math.floor((middle + side) / math.pi) for side in (-EDGE, EDGE)}:
            low, high = half * math.pi - EDGE, (half + 1) * math.pi + EDGE
            inside = low <= min(start, end) and max(start, end) <= high
            if inside and (half % 2 == 0) == (self.branch.elbow == "up"):
                return True
        return False

    def _outward(self, alpha: Five) -> float:
        """Return the distance [m] of {K} from axis 1, positive on the side of the branch."""
        arm = arm_of(self.chain)
        _, two, three, four, _ = alpha
        r = (
            arm.a
            + arm.l1 * math.cos(two)
            + arm.l2 * math.cos(two + three)
            + arm.l3 * math.cos(two + three + four)
        )
        return r if self.branch.shoulder == "front" else -r

    def _bend(self, alpha3: float) -> float:
        return math.sin(alpha3) if self.branch.elbow == "up" else -math.sin(alpha3)


TREE_STEP: Final = 0.3
"""Duration [s] of the motion at full speed from one posture of a tree to the next."""

MAX_POSTURES: Final = 3000
"""Maximum number of drawn postures before the search ends without success: some seconds."""

MAX_DRAWS: Final = 50
"""Maximum number of draws of one posture on a branch."""

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
    """The search for one path between two postures in one world, or without one."""

    def __init__(
        self,
        chain: Chain,
        world: CollisionWorld | None,
        fingers: float,
        start: FloatArray,
        end: FloatArray,
        region: BranchRegion | None,
    ) -> None:
        self.chain = chain
        self.fingers = fingers
        self.region = region
        x = np.append(start, fingers), np.append(end, fingers)
        self.room = None if world is None else SweptClearance.about(world, MARGIN, *x)
        self.start, self.end = start, end

    def clear(self, a: FloatArray, b: FloatArray) -> bool:
        """Return True if the straight path from `a` to `b` is clear, and on the branch."""
        checkpoint()
        return self._holds(a, b) and self.met(a, b) is None

    def _holds(self, a: FloatArray, b: FloatArray) -> bool:
        return self.region is None or self.region.holds_line(a, b)

    def met(self, a: FloatArray, b: FloatArray) -> Contact | None:
        """Return the contact on the straight path from `a` to `b`; None when it is clear."""
        if self.room is None:
            return None
        contact = self.room.blocked_line(np.append(a, self.fingers), np.append(b, self.fingers))
        return None if contact is None else contact.contact

    def worst(self, q: FloatArray) -> Contact | None:
        """Return the contact at `q` that violates its minimum most; None when it is clear."""
        contact, room = self.met(q, q), self.room
        return None if contact is None or room is None else room.worst(np.append(q, self.fingers))

    def connected(self, random: np.random.Generator) -> list[FloatArray] | None:
        """Return the vias of a clear path; None when MAX_POSTURES were not enough."""
        speed = self.chain.speed
        trees = _Tree([self.start]), _Tree([self.end])
        for turn in range(MAX_POSTURES):
            growing, other = trees[turn % 2], trees[1 - turn % 2]
            drawn = self._drawn(random)
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

    def _drawn(self, random: np.random.Generator) -> FloatArray:
        """Return a random posture inside the limits, as a rule on the branch."""
        drawn = random.uniform(self.chain.lower, self.chain.upper)
        for _ in range(MAX_DRAWS):
            if self.region is None or self.region.holds(drawn):
                break
            drawn = random.uniform(self.chain.lower, self.chain.upper)
        return drawn

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
        """Return `path` without vias next to each other or to its end.

        Of two vias next to each other the one stays that keeps the path on the branch.
        """
        tidied = path[:1]
        for q, after in pairwise(path[1:]):
            near = self.same(tidied[-1], q) or self.same(path[-1], q)
            if near and self._holds(tidied[-1], after):
                continue
            if near and len(tidied) > 1 and self._holds(tidied[-2], q):
                tidied.pop()
            tidied.append(q)
        return [*tidied, path[-1]]

    def _duration(self, path: list[FloatArray]) -> float:
        """Return the duration [s] with every leg at full speed."""
        legs = np.abs(np.diff(np.array(path), axis=0)) / self.chain.speed
        return float(legs.max(axis=1).sum())


def collision_free_paths(
    chain: Chain,
    start: FloatArray,
    end: FloatArray,
    world: CollisionWorld | None,
    fingers: float,
    seed: int,
    branch: Branch | None = None,
) -> list[JointPath]:
    """Return clear paths from `start` to `end` (5,) [rad] with the fingers at one angle [rad].

    There is one path, except where a `branch` is so narrow that the arm has to stop in between.

    Args:
        chain: the arm.
        start: the first posture (5,) [rad].
        end: the last posture (5,) [rad].
        world: the obstacles; None for no obstacles.
        fingers: the finger joint [rad].
        seed: the seed of the search.
        branch: the branch that the path stays on; None to allow all.

    Raises:
        BlockedError: an end is too near to an obstacle, or no path was found.
    """
    region = None if branch is None else BranchRegion(chain, branch)
    search = _Search(chain, world, fingers, start, end, region)
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
    blends = [
        0.0
        if region and (search.same(before, via) or search.same(via, after))
        else _largest_blend(region, before, via, after)
        for before, via, after in zip(vias, vias[1:], vias[2:], strict=False)
    ]
    # The arm stops at a corner that no rounding keeps on the branch, and beside another via.
    stops = [0, *(n for n, blend in enumerate(blends, 1) if blend == 0.0), len(vias) - 1]
    return [
        _rounded(chain, vias[a : b + 1], np.array(blends[a : b - 1]), world, fingers)
        for a, b in pairwise(stops)
    ]


def _rounded(
    chain: Chain,
    vias: list[FloatArray],
    blend: FloatArray,
    world: CollisionWorld | None,
    fingers: float,
) -> JointPath:
    """Return the path along `vias`, each corner as smooth as `blend` and the free space allow."""
    for rounding in ROUNDINGS:
        path = JointPath(chain, np.array(vias), np.minimum(blend, rounding))
        try:
            if world is not None:
                check_clear(path, world, fingers)
        except BlockedError:
            continue
        return path
    raise BlockedError(
        "The path found cannot be followed without stops at its corners. Try another seed."
    )


def _largest_blend(
    region: BranchRegion | None, before: FloatArray, via: FloatArray, after: FloatArray
) -> float:
    """Return the largest of ROUNDINGS that keeps a corner on the branch; 0 if none does."""
    for blend in ROUNDINGS:
        # A corner cuts off at most this fraction of each leg.
        cut = 0.5 * blend
        ends = via + cut * (before - via), via + cut * (after - via)
        if region is None or region.holds_corner(ends[0], via, ends[1]):
            return blend
    return 0.0
