"""Sentences for the driver on parts of a robot that are not checked, or that look wrong."""

from __future__ import annotations

from collections.abc import Collection, Iterator

import numpy as np

from katana450.arm.control.messages import UNCHECKED, short
from katana450.arm.robot.robot import Robot
from katana450.extensions.bodies.estimated_shapes import drawn
from katana450.maths.collision.world import CollisionWorld, Part
from katana450.maths.geometry.arrays import FloatArray

MAX_LENGTH = 10.0
"""[m] Parts that are longer, and links that are farther from their parent, look wrong."""


def cautions(
    robot: Robot, unknown: Collection[str], world: CollisionWorld | None, x: FloatArray
) -> Iterator[str]:
    """Return what the driver of ``robot`` must know of its ``world``.

    Args:
        robot: the robot as in its file.
        unknown: names of the links of which shapes are unknown.
        world: its bodies and the table; None without shapes.
        x: (k,) joint values [rad or m] of the world where the robot starts.
    """
    for link in robot.links:
        distance = float(np.linalg.norm(link.T_parent_link[:3, 3]))
        if distance > MAX_LENGTH:
            yield (
                f"{link.name} is {short(distance)} m from its parent {link.parent}: check the "
                "origin of its joint."
            )
    if world is None:
        yield UNCHECKED
        return
    checked = {part.name for part in world.parts}
    shaped = [link.name for link in robot.links if drawn(link) or link.name in unknown]
    unchecked = [name for name in shaped if name not in checked]
    if unchecked:
        yield f"Not checked for contacts: {', '.join(unchecked)}."
    estimated = [part.name for part in world.parts if part.name in unknown]
    if estimated:
        yield f"Contacts are estimated, because shapes cannot be read: {', '.join(estimated)}."
    yield from _implausible(robot, world, x)


def _implausible(robot: Robot, world: CollisionWorld, x: FloatArray) -> Iterator[str]:
    own = {link.name for link in robot.links}
    sizes = np.array([_size(part) if part.name in own else np.inf for part in world.parts])
    for part, size in zip(world.parts, sizes.tolist(), strict=True):
        if MAX_LENGTH < size < np.inf:
            yield f"{part.name} is {short(size)} m long: check the unit of its shapes."
    placed, owners = world.at(x), (world.part_of[world.first], world.part_of[world.second])
    limits = -np.minimum(sizes[owners[0]], sizes[owners[1]])
    for pair in placed.nearer_than(limits)[0].tolist():
        depth = -placed.distance(pair)
        if depth > -limits[pair]:
            one, other = (world.parts[owner[pair]].name for owner in owners)
            yield (
                f"{one} and {other} overlap by {short(1e3 * depth)} mm where the robot starts, "
                "more than one of them is long: check the units and origins of their shapes."
            )
            return


def _size(part: Part) -> float:
    """Return the longest side [m] of the boxes round the shapes of ``part``."""
    return max(float((shape.high - shape.low).max()) for shape in part.shapes)
