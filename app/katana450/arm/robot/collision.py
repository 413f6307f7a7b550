"""Conversion of the collision shapes of a robot description to bodies of the collision core."""

from __future__ import annotations

import pickle
from collections.abc import Callable, Sequence
from itertools import combinations

import numpy as np

from katana450.arm.control.objects.environment import Hand
from katana450.arm.control.state.scene_objects import SceneObject, Shape
from katana450.arm.robot.link import Joint, Link
from katana450.arm.robot.props import BASIN_AT, CUP_AT, Props
from katana450.arm.robot.robot import Robot
from katana450.arm.robot.visual import Visual
from katana450.disk_cache import kept
from katana450.errors import InputError, RobotDescriptionError
from katana450.maths.collision.linkage import GROUND, Linkage, RigidGroup
from katana450.maths.collision.shape import CollisionShape, half_space, hull
from katana450.maths.collision.world import CollisionWorld, Part, obstacle
from katana450.maths.geometry import se3
from katana450.maths.geometry.arrays import FloatArray, frozen

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


Pieces = Callable[[Visual], Sequence[FloatArray]]
"""The points (n, 3) [m] of each convex body, in the frame of its link, that stand for a shape."""

MakeWorld = Callable[[Linkage, Sequence[Part]], CollisionWorld]
"""A function that makes a world of the linkage and the parts of a robot."""


def as_modelled(shape: Visual) -> Sequence[FloatArray]:
    """Return the vertices of ``shape``: one convex body, its hull."""
    return [shape.kept(lambda: np.asarray(shape.mesh.vertices), FloatArray)]


def world_of(
    robot: Robot, pieces: Pieces = as_modelled, make: MakeWorld | None = None
) -> tuple[CollisionWorld | None, tuple[str, ...]]:
    """Return the robot's own collision bodies, and sentences for a person on what they leave out.

    x is the arm's joint angles (n,) followed by the driven finger joint; for a robot without an
    arm, its driven joints followed by an unused number [rad, or m if it slides]. The world is None
    if no link has a shape.

    Args:
        robot: the robot.
        pieces: divides a shape into convex bodies.
        make: makes the world; None for the pairs of an arm that meet in sampled postures.
    """
    arm = robot.arm
    groups: list[RigidGroup] = []
    # For each link: the number of its rigid group, and its pose in the frame of that group.
    places: dict[str | None, tuple[int, FloatArray]] = {None: (GROUND, np.eye(4))}
    parts: list[Part] = []
    notes: list[str] = []
    for link in robot.links:
        group, T = places[link.parent]
        T = T @ link.at_rest({} if arm is None else arm.resting)
        joint = link.joint
        drive = None if joint is None else _drive(robot, joint)
        if joint is not None and drive is not None:
            groups.append(RigidGroup(group, T, joint.axis, *drive, slides=joint.slides))
            group, T = len(groups), np.eye(4)
        places[link.name] = group, T
        shapes, refused = _shapes(link, robot.bodies(link), pieces)
        notes += refused
        if shapes:
            parts.append(Part(link.name, group, (frozen(T),) * len(shapes), shapes))
    if not parts:
        return None, tuple(notes)
    if make is not None:
        return make(Linkage(groups), parts), tuple(notes)
    chain, gripper = robot.require_arm().chain, robot.require_arm().gripper
    lower, upper = np.append(chain.lower, gripper.lower), np.append(chain.upper, gripper.upper)
    pairs = _pairs(groups, parts, lower, upper)
    return CollisionWorld(Linkage(groups), parts, pairs), tuple(notes)


def _pairs(
    groups: Sequence[RigidGroup], parts: Sequence[Part], lower: FloatArray, upper: FloatArray
) -> list[tuple[int, int]]:
    """Return ``pairs_that_meet``, kept on the disk because its samples take half of a start."""

    def pairs() -> list[tuple[int, int]]:
        return pairs_that_meet(Linkage(groups), parts, lower, upper)

    shapes = [shape.mark for part in parts for shape in part.shapes]
    places = [(part.mover, part.T_mover_shape) for part in parts]
    bodies = pickle.dumps((groups, places, shapes))
    return kept(pairs, list[tuple[int, int]], bodies, lower, upper)


def table() -> Part:
    """Return the table as a half-space."""
    return obstacle("table", np.eye(4), half_space())


def scene_objects_of(props: Props) -> tuple[SceneObject, ...]:
    """Return cup and basin at their initial places, as the cylinders around them."""
    return tuple(
        SceneObject(
            name,
            Shape.CYLINDER,
            (vessel.outer_radius, vessel.height),
            se3.from_rotation_translation(np.eye(3), place),
            can_be_held=name == "cup",
        )
        for name, vessel, place in (("cup", props.cup, CUP_AT), ("basin", props.basin, BASIN_AT))
    )


def hand_of(robot: Robot, world: CollisionWorld) -> Hand:
    """Return the fingers and the group that carries them; without fingers, that of the last joint.

    Raises RobotDescriptionError if there is no arm.
    """
    arm, variable = robot.require_arm(), world.linkage.variable
    fingers = [part for part in world.parts if variable[part.mover] == arm.chain.n]
    palm = fingers[0].mover if fingers else int(np.flatnonzero(variable == arm.chain.n - 1)[-1])
    while variable[palm] == arm.chain.n:
        palm = int(world.linkage.parent[palm])
    T_base_palm = world.linkage.poses(np.zeros(arm.chain.n + 1))[palm]
    T_palm_tool = se3.inverse(T_base_palm) @ arm.T_base_shoulder @ arm.chain.M
    names = tuple(part.name for part in fingers)
    return Hand(palm, names, frozen(T_palm_tool), arm.gripper, tuple((name,) for name in names))


def _drive(robot: Robot, joint: Joint) -> tuple[int, float, float] | None:
    """Return index in x, factor and offset that drive ``joint``; None for a joint at rest."""
    arm = robot.arm
    if arm is None:
        return robot.driven.index(joint.leader), joint.factor, joint.offset
    if joint.name in arm.chain.names:
        return arm.chain.names.index(joint.name), 1.0, 0.0
    if joint.name in arm.fingers:
        return arm.chain.n, *arm.fingers[joint.name]
    return None


def _shapes(
    link: Link, bodies: Sequence[Visual], pieces: Pieces
) -> tuple[tuple[CollisionShape, ...], list[str]]:
    shapes: list[CollisionShape] = []
    refused: list[str] = []
    for body in bodies:
        try:
            shapes += [hull(points) for points in pieces(body)]
        except (InputError, RobotDescriptionError) as error:
            refused.append(f"A collision shape of link {link.name!r} is left out: {error}")
    return tuple(shapes), refused
