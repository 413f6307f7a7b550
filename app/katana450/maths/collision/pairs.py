"""The pairs of parts of an arm that may meet, found by sampling postures."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from katana450.maths.collision.linkage import Linkage
from katana450.maths.collision.world import CollisionWorld, Part
from katana450.maths.geometry.arrays import FloatArray

SAMPLES = 1000
"""Number of sampled postures."""

DESIGN_OVERLAP_SAMPLES = 50
"""Parts that overlap in this many of the first postures overlap by design."""

MEETING_DISTANCE = 0.01
"""Parts that never come nearer than this [m] cannot meet. It is twice the distance that the arm
keeps, because between the samples the parts may be somewhat nearer.
"""

SEED = 450

OVERDRAW_FRACTION = 0.5
"""Fraction of a range by which postures are drawn beyond each of its ends and clipped. Parts often
come nearest where joints are at their limits, so each joint is at a limit in half the postures.
"""


def pairs_that_meet(
    linkage: Linkage, parts: Sequence[Part], lower: FloatArray, upper: FloatArray
) -> list[tuple[int, int]]:
    """Return indices of the parts that may meet between ``lower`` and ``upper`` (k,) [rad].

    Three kinds of pairs are excluded: neighbours, whose one joint keeps them apart by its limits
    (as it does two fingers that are driven together); parts that no sampled posture brings near
    each other; and parts that overlap in every posture.
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
