"""The pairs of parts of any robot that may meet, judged by its posture at rest."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np

from katana450.maths.collision.clearance import MIN_CLEARANCE
from katana450.maths.collision.linkage import GROUND, Linkage
from katana450.maths.collision.world import CollisionWorld, Part
from katana450.maths.geometry.arrays import FloatArray

TOUCH_DISTANCE = 1e-4
"""Parts that are nearer than this [m] at rest touch: STL files round their corners by less."""


class RestPairs(NamedTuple):
    """The pairs of parts of a robot, as indices of parts, judged by its posture at rest.

    Attributes:
        checked: the pairs that may meet.
        close: half of the distance at rest [m] of each of these that is nearer than ``STOP``.
        touching: the pairs that are not checked, because they touch or overlap at rest.
    """

    checked: list[tuple[int, int]]
    close: dict[tuple[int, int], float]
    touching: list[tuple[int, int]]


def pairs_at_rest(
    linkage: Linkage, parts: Sequence[Part], x: FloatArray, home: FloatArray | None = None
) -> RestPairs:
    """Return the pairs of parts that may meet, judged by the posture at rest ``x`` (k,).

    Nothing is sampled, because no number of postures represents those of a hand with many joints.
    Two kinds of pairs are left out, with those that touch at ``x``: parts with one variable between
    them, whose limits keep them apart, and parts between which the tree has no other part. Parts
    that touch at ``x`` are checked nevertheless if they are at least ``STOP`` apart at ``home``
    (k,): an arm that is folded at ``x`` brings parts together that can meet in use.
    """
    above = _parts_above(linkage, parts)
    candidates = [
        (a, b)
        for a, b in combinations(range(len(parts)), 2)
        if len(linkage.variables_between(parts[a].mover, parts[b].mover)) > 1
        and parts[a].mover != above[b]
        and parts[b].mover != above[a]
    ]
    return judged_at_rest(linkage, parts, candidates, x, home)


def judged_at_rest(
    linkage: Linkage,
    parts: Sequence[Part],
    candidates: Sequence[tuple[int, int]],
    x: FloatArray,
    home: FloatArray | None = None,
) -> RestPairs:
    """Return those of ``candidates``, pairs of parts, that may meet; see ``pairs_at_rest``."""
    nearest = _nearest(linkage, parts, candidates, x)
    touching = [pair for pair, distance in nearest.items() if distance < TOUCH_DISTANCE]
    if home is not None and touching:
        then = _nearest(linkage, parts, touching, home)
        touching = [pair for pair, distance in then.items() if distance < MIN_CLEARANCE]
    return RestPairs(
        [pair for pair in candidates if pair not in touching],
        {
            pair: 0.5 * distance
            for pair, distance in nearest.items()
            if TOUCH_DISTANCE <= distance < MIN_CLEARANCE
        },
        touching,
    )


def _nearest(
    linkage: Linkage, parts: Sequence[Part], pairs: Sequence[tuple[int, int]], x: FloatArray
) -> dict[tuple[int, int], float]:
    """Return the distance [m] of each pair at ``x`` (k,), or infinity from ``STOP`` on."""
    world = CollisionWorld(linkage, parts, pairs)
    placed, nearest = world.at(x), dict.fromkeys(pairs, np.inf)
    for pair in placed.nearer_than(MIN_CLEARANCE)[0].tolist():
        owner = int(world.part_of[world.first[pair]]), int(world.part_of[world.second[pair]])
        nearest[owner] = min(nearest[owner], placed.distance(pair))
    return nearest


def _parts_above(linkage: Linkage, parts: Sequence[Part]) -> list[int]:
    """Return for each part the group of the next parts towards the root; its own for the root."""
    shaped, ancestors = {part.mover for part in parts}, []
    for part in parts:
        group = part.mover
        while group != GROUND:
            group = int(linkage.parent[group])
            if group in shaped:
                break
        ancestors.append(group)
    return ancestors
