"""Which parts of an arm may meet, found out instead of listed."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from katana450.maths.collision.linkage import Linkage
from katana450.maths.collision.world import CollisionWorld, Part
from katana450.maths.geometry.arrays import FloatArray

SAMPLES = 1000
"""Postures tried."""

DESIGN_OVERLAP_SAMPLES = 50
"""Parts that are in each other in this many postures, the first ones, are so by their design."""

MEETING_DISTANCE = 0.01
"""[m] Parts that never come nearer cannot meet: twice what the arm keeps, for between the samples
they may be somewhat nearer."""

SEED = 450

OVERDRAW_FRACTION = 0.5
"""Fraction of a range that postures are drawn beyond each of its ends and brought back: parts often
come nearest where joints are at their limits, and so each joint is at one in half the postures."""


def pairs_that_meet(
    linkage: Linkage, parts: Sequence[Part], lower: FloatArray, upper: FloatArray
) -> list[tuple[int, int]]:
    """Indices of the parts that may meet between the limits ``lower`` and ``upper`` (k,) [rad].

    Left out are neighbours, whose one joint keeps them apart by its limits (as it does two fingers
    driven together), parts that no posture tried brings near each other, and parts that are in each
    other in every posture.
    """
    candidates = [
        (a, b)
        for a, b in combinations(range(len(parts)), 2)
        if len(linkage.variables_between(parts[a].mover, parts[b].mover)) > 1
    ]
    world = CollisionWorld(linkage, parts, candidates)
    numbers = {pair: number for number, pair in enumerate(candidates)}
    a, b = world.part_of[world.first], world.part_of[world.second]
    owner = np.array(
        [numbers[pair] for pair in zip(a.tolist(), b.tolist(), strict=True)], dtype=int
    )
    deep = np.zeros(len(candidates), dtype=int)
    near = np.zeros(len(candidates), dtype=bool)
    beyond = OVERDRAW_FRACTION * (upper - lower)
    drawn = np.random.default_rng(SEED).uniform(
        lower - beyond, upper + beyond, (SAMPLES, len(lower))
    )
    postures = np.clip(drawn, lower, upper)
    for number, x in enumerate(postures):
        placed = world.at(x)
        known = near if number >= DESIGN_OVERLAP_SAMPLES else np.zeros_like(near)
        inside = np.zeros_like(near)
        for pair in placed.nearer_than(np.where(known[owner], -np.inf, MEETING_DISTANCE))[
            0
        ].tolist():
            which = owner[pair]
            distance = placed.distance(pair)
            near[which] |= distance < MEETING_DISTANCE
            inside[which] |= distance < 0.0
        deep += inside
    return [
        pair
        for pair, meets, times in zip(candidates, near, deep, strict=True)
        if meets and times < DESIGN_OVERLAP_SAMPLES
    ]
