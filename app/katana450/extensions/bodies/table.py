"""The table under a robot that is driven joint by joint: its file does not say where it stands."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from katana450.arm.control.joints import JointSet
from katana450.extensions.bodies.pairs_at_rest import TOUCH_DISTANCE, RestPairs, judged_at_rest
from katana450.maths.collision.clearance import STOP
from katana450.maths.collision.linkage import GROUND, Linkage
from katana450.maths.collision.shape import half_space
from katana450.maths.collision.world import CollisionWorld, Part, obstacle
from katana450.maths.geometry import se3
from katana450.maths.geometry.arrays import FloatArray

DEEP = -10.0
"""[m] Height of a plane below every robot, from which heights are measured."""

MAX_NAMED = 4
"""Maximum number of parts that a note names."""


class Standing(NamedTuple):
    """The table under a robot.

    Attributes:
        table: the table, or nothing under a robot that hangs.
        pairs: the pairs of a part with the table, whose index is the one after all parts.
        notes: sentences for a person.
    """

    table: tuple[Part, ...]
    pairs: RestPairs
    notes: tuple[str, ...]


def standing(linkage: Linkage, parts: Sequence[Part], joints: JointSet) -> Standing:
    """Return the table of a robot whose x (k,) is that of ``joints`` and an unused number.

    The table is as high as the lowest point at rest, or z = 0 of the base if that is lower. If a
    joint can move this point farther down, the robot hangs, and no table is known. Parts that touch
    the table at rest are not checked against it.
    """
    rest = np.append(joints.ready, 0.0)
    heights = _heights(linkage, parts, rest)
    lowest = min(float(heights.min()), 0.0)
    if lowest > -TOUCH_DISTANCE:
        lowest = 0.0
    feet = [part for part, height in zip(parts, heights, strict=True) if height < lowest + STOP]
    if lowest < 0.0:
        lower = _lowered(linkage, feet, joints, lowest - STOP)
        if lower:
            why = f"{lower} is its lowest part at rest and can move farther down"
            return Standing(
                (),
                RestPairs([], {}, []),
                (f"No table is checked, because nothing says where the robot stands: {why}.",),
            )
    table = _table_at(lowest)
    moving = [number for number, part in enumerate(parts) if part.mover != GROUND]
    pairs = judged_at_rest(
        linkage, (*parts, table), [(number, len(parts)) for number in moving], rest
    )
    notes = []
    if lowest < 0.0:
        under = _listed([part.name for part in feet])
        notes.append(f"The table is {-1e3 * lowest:.0f} mm below the base, under {under}.")
    touching = [parts[number].name for number, _ in pairs.touching]
    if touching:
        notes.append(f"Not checked against the table, which they touch: {_listed(touching)}.")
    return Standing((table,), pairs, tuple(notes))


def _table_at(height: float) -> Part:
    """Return the table as a half-space up to ``height`` [m]."""
    T = se3.from_rotation_translation(np.eye(3), (0.0, 0.0, height))
    return obstacle("table", T, half_space())


def _lowered(linkage: Linkage, feet: Sequence[Part], joints: JointSet, height: float) -> str:
    """Return the name of one of ``feet`` that one joint moves below ``height`` [m], or ""."""
    for axis, (low, high) in enumerate(zip(joints.lower, joints.upper, strict=True)):
        for value in (low, 0.5 * (low + high), high):
            x = np.append(joints.ready, 0.0)
            x[axis] = value
            heights = _heights(linkage, feet, x)
            if float(heights.min()) < height:
                return feet[int(heights.argmin())].name
    return ""


def _heights(linkage: Linkage, parts: Sequence[Part], x: FloatArray) -> FloatArray:
    """Return the heights (p,) [m] of the lowest points of ``parts`` at ``x`` (k,) [rad or m]."""
    count = len(parts)
    pairs = [(number, count) for number in range(count)]
    world = CollisionWorld(linkage, (*parts, _table_at(DEEP)), pairs)
    placed, heights = world.at(x), np.full(count, np.inf)
    for pair, body in enumerate(world.first.tolist()):
        part = int(world.part_of[body])
        heights[part] = min(heights[part], DEEP + placed.distance(pair))
    return heights


def _listed(names: Sequence[str]) -> str:
    """Return the names as words, with a count of those beyond MAX_NAMED."""
    more = len(names) - MAX_NAMED
    return ", ".join(names[:MAX_NAMED]) + (f" and {more} more" if more > 0 else "")
