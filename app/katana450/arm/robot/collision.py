"""The bodies that a robot description gives its links, as the collision core takes them."""

from __future__ import annotations

import numpy as np

from katana450.arm.control.scene_objects import Hand, SceneObject, Shape
from katana450.arm.robot.link import Joint, Link
from katana450.arm.robot.mounted_arm import MountedArm
from katana450.arm.robot.props import BASIN_AT, CUP_AT, Props
from katana450.arm.robot.robot import Robot
from katana450.errors import InputError
from katana450.maths.collision.linkage import GROUND, Linkage, RigidGroup
from katana450.maths.collision.pairs import pairs_that_meet
from katana450.maths.collision.shape import CollisionShape, half_space, hull
from katana450.maths.collision.world import CollisionWorld, Part, obstacle
from katana450.maths.geometry import se3
from katana450.maths.geometry.arrays import FloatArray, frozen


def world_of(robot: Robot) -> tuple[CollisionWorld | None, tuple[str, ...]]:
    """Return the arm's own collision bodies, and sentences for a person on what they leave out.

    Every shape counts as its convex hull. x is the arm's joint angles (n,) and the driven finger
    joint [rad, or m where it slides]. The world is None when no link has a shape. Raises
    RobotDescriptionError where there is no arm.
    """
    arm = robot.require_arm()
    movers: list[RigidGroup] = []
    # Of each body the piece it moves with, and where it is in the frame of that.
    places: dict[str | None, tuple[int, FloatArray]] = {None: (GROUND, np.eye(4))}
    parts: list[Part] = []
    notes: list[str] = []
    for link in robot.links:
        piece, T = places[link.parent]
        T = T @ link.at_rest(arm.resting)
        joint = link.joint
        drive = None if joint is None else _drive(arm, joint)
        if joint is not None and drive is not None:
            movers.append(RigidGroup(piece, T, joint.axis, *drive, slides=joint.slides))
            piece, T = len(movers), np.eye(4)
        places[link.name] = piece, T
        shapes, refused = _shapes(link)
        notes += refused
        if shapes:
            parts.append(Part(link.name, piece, (frozen(T),) * len(shapes), shapes))
    if not parts:
        return None, tuple(notes)
    bare = [link.name for link in robot.links if link.visuals and not link.collisions]
    if bare:
        notes.append(f"Without collision shapes, and so not checked: {', '.join(bare)}.")
    linkage = Linkage(movers)
    chain, gripper = arm.chain, arm.gripper
    lower, upper = np.append(chain.lower, gripper.lower), np.append(chain.upper, gripper.upper)
    return CollisionWorld(linkage, parts, pairs_that_meet(linkage, parts, lower, upper)), tuple(
        notes
    )


def table() -> Part:
    """What everything stands on, as a half-space."""
    return obstacle("table", np.eye(4), half_space())


def scene_objects_of(props: Props) -> tuple[SceneObject, ...]:
    """Cup and basin where they stand at first, as the cylinders round them."""
    return tuple(
        SceneObject(
            name,
            Shape.CYLINDER,
            (vessel.outer_radius, vessel.height),
            se3.from_rotation_translation(np.eye(3), at),
            can_be_held=name == "cup",
        )
        for name, vessel, at in (("cup", props.cup, CUP_AT), ("basin", props.basin, BASIN_AT))
    )


def initial_objects(props: Props) -> tuple[Part, ...]:
    """The table and ``scene_objects_of`` as obstacles that stay where they are."""
    objects = scene_objects_of(props)
    return (
        table(),
        *(obstacle(each.name, each.T_collision_shape, each.collision_shape) for each in objects),
    )


def hand_of(robot: Robot, world: CollisionWorld) -> Hand:
    """Return the fingers and what they hang on; without any, what the last joint turns.

    Raises RobotDescriptionError where there is no arm.
    """
    arm = robot.require_arm()
    driven = {link.name for link in robot.links if link.joint and link.joint.name in arm.fingers}
    fingers = [part for part in world.parts if part.name in driven]
    if fingers:
        palm = int(world.linkage.parent[fingers[0].mover])
    else:
        palm = int(np.flatnonzero(world.linkage.variable == arm.chain.n - 1)[-1])
    T_base_palm = world.linkage.poses(np.zeros(arm.chain.n + 1))[palm]
    T_palm_tool = se3.inverse(T_base_palm) @ arm.T_base_shoulder @ arm.chain.M
    names = tuple(part.name for part in fingers)
    return Hand(palm, names, frozen(T_palm_tool), slides=arm.gripper.slides)


def _drive(arm: MountedArm, joint: Joint) -> tuple[int, float, float] | None:
    """The entry of x that moves ``joint``, with factor and offset; None for a joint at rest."""
    if joint.name in arm.chain.names:
        return arm.chain.names.index(joint.name), 1.0, 0.0
    if joint.name in arm.fingers:
        return arm.chain.n, *arm.fingers[joint.name]
    return None


def _shapes(link: Link) -> tuple[tuple[CollisionShape, ...], list[str]]:
    shapes: list[CollisionShape] = []
    refused: list[str] = []
    for collision in link.collisions:
        try:
            shapes.append(hull(collision.mesh.vertices))
        except InputError as error:
            refused.append(f"A collision shape of link {link.name!r} is left out: {error}")
    return tuple(shapes), refused
