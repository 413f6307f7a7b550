"""The collision world of any robot."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace
from functools import cache, partial
from typing import Any, NamedTuple

import numpy as np

from katana450.arm.control.state.messages import UNCHECKED, short
from katana450.arm.robot.collision import Pieces, as_modelled, table, world_of
from katana450.arm.robot.link import Link
from katana450.arm.robot.robot import Robot
from katana450.arm.robot.structure import ARM_JOINTS
from katana450.arm.robot.visual import ROD_LENGTH, PrimitiveShape, Visual
from katana450.errors import InputError, RobotDescriptionError
from katana450.extensions.bodies.pairs_at_rest import (
    TOUCH_DISTANCE,
    RestPairs,
    judged_at_rest,
    pairs_at_rest,
)
from katana450.extensions.bodies.pieces import pieces
from katana450.maths.collision.linkage import GROUND, Linkage
from katana450.maths.collision.shape import half_space, hull
from katana450.maths.collision.world import CollisionWorld, Part, obstacle
from katana450.maths.geometry import se3
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.settings import Settings


def robot_world(robot: Robot) -> tuple[CollisionWorld | None, tuple[str, ...], tuple[str, ...]]:
    """Return the bodies and pairs of ``robot``, sentences on what is left out, and cautions.

    x is that of ``world_of``. An arm of the five-axis family keeps the pairs that sampled postures
    bring near each other, and its collision shapes count as convex. All other shapes are divided by
    ``pieces``. Links of unknown shape get those of ``with_estimates``. A robot that is driven joint
    by joint has its table here, an arm in its session. The world is None if no link has a shape.
    """
    five_axes = robot.arm is not None and robot.arm.chain.n == ARM_JOINTS
    divide = cache(as_modelled if five_axes and robot.collides else pieces)
    complete, unknown = with_estimates(robot, divide)
    findings: list[str] = []

    def make(linkage: Linkage, parts: Sequence[Part]) -> CollisionWorld:
        rest = pairs_at_rest(linkage, parts, _at_rest(robot), _at_home(robot))
        touching = [f"{parts[a].name} and {parts[b].name}" for a, b in rest.touching]
        if touching:
            findings.append(f"Not checked, because they touch at rest: {'; '.join(touching)}.")
        if robot.arm is not None:
            return CollisionWorld(linkage, parts, rest.checked, rest.close)
        under = standing(linkage, parts, _at_rest(robot))
        findings.extend(under.notes)
        return CollisionWorld(
            linkage,
            (*parts, *under.table),
            (*rest.checked, *under.pairs.checked),
            {**rest.close, **under.pairs.close},
        )

    world, notes = world_of(complete, divide, None if five_axes else make)
    on_table = world if world is None or robot.arm is None else world.with_obstacles((table(),))
    start = _at_home(robot)
    x = _at_rest(robot) if start is None else start
    return world, (*notes, *findings), tuple(cautions(robot, unknown, on_table, x))


def _at_rest(robot: Robot) -> FloatArray:
    """Return x with every joint at zero, or at the limit nearest to zero."""
    if robot.arm is None:
        return np.append(robot.joint_group.ready, 0.0)
    chain, gripper = robot.arm.chain, robot.arm.gripper
    return np.append(np.clip(0.0, chain.lower, chain.upper), gripper.clamp(0.0))


def _at_home(robot: Robot) -> FloatArray | None:
    """Return x where an arm starts and Home leads; None for a robot that is driven by joints."""
    if robot.arm is None:
        return None
    return np.append(robot.arm.ready(Settings.ready), robot.arm.gripper.clamp(0.0))


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
                f"{link.name!r} is {short(distance)} m from its parent {link.parent!r}: check the "
                "origin of its joint."
            )
    if world is None:
        yield UNCHECKED
        return
    checked = {part.name for part in world.parts}
    shaped = [link.name for link in robot.links if drawn(link) or link.name in unknown]
    unchecked = [name for name in shaped if name not in checked]
    if unchecked:
        yield f"Not checked for contacts: {', '.join(map(repr, unchecked))}."
    estimated = [part.name for part in world.parts if part.name in unknown]
    if estimated:
        reason = "the file gives no shapes" if _is_shapeless(robot) else "shapes cannot be read"
        yield f"Contacts are estimated, because {reason}: {', '.join(map(repr, estimated))}."
    yield from _implausible(robot, world, x)


def _implausible(robot: Robot, world: CollisionWorld, x: FloatArray) -> Iterator[str]:
    own = {link.name for link in robot.links}
    sizes = np.array([_size(part) if part.name in own else np.inf for part in world.parts])
    for part, size in zip(world.parts, sizes.tolist(), strict=True):
        if MAX_LENGTH < size < np.inf:
            yield f"{part.name!r} is {short(size)} m long: check the unit of its shapes."
    placed, owners = world.at(x), (world.part_of[world.first], world.part_of[world.second])
    limits = -np.minimum(sizes[owners[0]], sizes[owners[1]])
    for pair in placed.nearer_than(limits)[0].tolist():
        depth = -placed.distance(pair)
        if depth > -limits[pair]:
            one, other = (world.parts[owner[pair]].name for owner in owners)
            yield (
                f"{one!r} and {other!r} overlap by {short(1e3 * depth)} mm where the robot starts, "
                "more than one of them is long: check the units and origins of their shapes."
            )
            return


def _size(part: Part) -> float:
    """Return the longest side [m] of the boxes round the shapes of ``part``."""
    return max(float((shape.high - shape.low).max()) for shape in part.shapes)


DEEP = -10.0
"""[m] Height of a plane below every robot, from which heights are measured."""


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


def standing(linkage: Linkage, parts: Sequence[Part], x: FloatArray) -> Standing:
    """Return the table of a robot that is at rest at ``x`` (k,).

    The table is as high as z = 0 of the base, or as the lowest part that stands still if that is
    lower. If a part that moves is still lower, nothing says where the robot stands, and no table is
    known. Parts that touch the table at rest are not checked against it.
    """
    heights = _heights(linkage, parts, x)
    fixed = np.array([part.mover == GROUND for part in parts])
    lowest = min(float(heights[fixed].min(initial=0.0)), 0.0)
    if lowest > -TOUCH_DISTANCE:
        lowest = 0.0
    if float(heights.min()) < lowest - TOUCH_DISTANCE:
        part = parts[int(heights.argmin())].name
        why = f"nothing says where the robot stands, and {part} is below its base at rest"
        return Standing((), RestPairs([], {}, []), (f"No table is checked: {why}.",))
    ground = _table_at(lowest)
    over = [(number, len(parts)) for number in np.flatnonzero(~fixed).tolist()]
    pairs = judged_at_rest(linkage, (*parts, ground), over, x)
    notes = [f"The table is {-1e3 * lowest:.0f} mm below the base."] if lowest < 0.0 else []
    touching = ", ".join(parts[number].name for number, _ in pairs.touching)
    if touching:
        notes.append(f"Not checked against the table, which they touch: {touching}.")
    return Standing((ground,), pairs, tuple(notes))


def _table_at(height: float) -> Part:
    """Return the table as a half-space up to ``height`` [m]."""
    T = se3.from_rotation_translation(np.eye(3), (0.0, 0.0, height))
    return obstacle("table", T, half_space())


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


RADIUS_RATIO, MAX_RADIUS = 0.1, 0.06
"""Radius of a capsule, as a ratio [1] to the longest stick of the robot, and its maximum [m]."""


def drawn(link: Link) -> tuple[Visual, ...]:
    """Return the visuals of ``link`` without the sticks that represent missing ones."""
    return tuple(visual for visual in link.visuals if not visual.is_rod)


def with_estimates(robot: Robot, pieces: Pieces) -> tuple[Robot, frozenset[str]]:
    """Return ``robot`` with shapes for all links that have a stick, and the links of unknown shape.

    What is drawn replaces collision shapes that are missing. Where no link has a shape, all sticks
    get some. ``pieces``: see ``world_of``.
    """
    links, unknown = [], []
    shapeless = _is_shapeless(robot)
    for link in robot.links:
        visuals, collisions = link.visuals, link.collisions
        if robot.collides and link.missing[1]:
            collisions = (*collisions, *drawn(link))
        if (shapeless and link.visuals) or _is_unknown(robot, link, collisions, pieces):
            unknown.append(link.name)
            capsules = _capsules(robot, link)
            if robot.collides:
                collisions = (*collisions, *capsules)
            elif capsules:
                visuals = (*drawn(link), *capsules)
        links.append(replace(link, visuals=visuals, collisions=collisions))
    return replace(robot, links=tuple(links)), frozenset(unknown)


def _is_shapeless(robot: Robot) -> bool:
    """Return whether the description of ``robot`` names no shape at all."""
    return not any(link.collisions or drawn(link) or any(link.missing) for link in robot.links)


def _is_unknown(robot: Robot, link: Link, collisions: Sequence[Visual], pieces: Pieces) -> bool:
    """Return whether shapes of ``link`` for contacts are missing and not drawn, or unreadable."""
    no_visuals, no_collisions = link.missing
    if no_collisions and (no_visuals or not drawn(link)):
        return True
    if no_visuals and not robot.collides:
        return True
    try:
        for shape in collisions if robot.collides else drawn(link):
            for points in pieces(shape):
                hull(points)
    except (InputError, RobotDescriptionError):
        return True
    return False


def _capsules(robot: Robot, link: Link) -> list[Visual]:
    """Return a capsule along each stick from ``link`` to its children.

    It begins inside the stick, so that a link that stands on the table does not reach into it. The
    other end goes round the joint of the child.
    """
    lengths = [float(np.linalg.norm(member.T_parent_link[:3, 3])) for member in robot.links]
    radius = min(RADIUS_RATIO * max(lengths), MAX_RADIUS)
    ends = [child.T_parent_link[:3, 3] for child in robot.children(link)]
    return [
        Visual(frozen(np.eye(4)), frozen(np.ones(3)), None, make=partial(_capsule, end, radius))
        for end in ends
        if np.linalg.norm(end) > ROD_LENGTH
    ]


def _capsule(end: FloatArray, radius: float) -> Any:
    """Return the corners, as a trimesh, of a capsule of ``radius`` round the stick to ``end`` [m].

    end: (3,) in the frame of the link [m].
    """
    mesh = PrimitiveShape("icosphere", {"subdivisions": 1, "radius": radius}).mesh()
    start = min(radius / float(np.linalg.norm(end)), 1.0) * end
    mesh.faces, mesh.vertices = [], np.concatenate((mesh.vertices + start, mesh.vertices + end))
    return mesh
