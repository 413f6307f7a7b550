"""The bodies that a robot description gives its links, as the collision core takes them."""

from __future__ import annotations

import numpy as np

from katana450.arm.control.things import Form, Hand, Thing
from katana450.arm.robot.model import Body, RobotModel
from katana450.arm.robot.props import BASIN_AT, CUP_AT, Props
from katana450.errors import InputError
from katana450.maths.collision.linkage import GROUND, Linkage, Mover
from katana450.maths.collision.pairs import pairs_that_meet
from katana450.maths.collision.shape import Shape, half_space, hull
from katana450.maths.collision.world import Part, World, obstacle
from katana450.maths.geometry import se3
from katana450.maths.geometry.arrays import FloatArray, frozen


def world_of(model: RobotModel) -> tuple[World | None, tuple[str, ...]]:
    """The arm's own collision bodies, and sentences for a person on what is left out of them.

    Every shape counts as its convex hull. x is the arm's joint angles (n,) and the driven finger
    joint [rad, or m where it slides]. The world is None when no link has a shape.
    """
    movers: list[Mover] = []
    # Of each body the piece it moves with, and where it is in the frame of that.
    places: dict[str | None, tuple[int, FloatArray]] = {None: (GROUND, np.eye(4))}
    parts: list[Part] = []
    notes: list[str] = []
    for body in model.bodies:
        piece, T = places[body.parent]
        T = T @ body.T_parent_body
        drive = _drive(model, body)
        if drive is not None:
            movers.append(Mover(piece, T, body.axis, *drive, slides=body.slides))
            piece, T = len(movers), np.eye(4)
        places[body.name] = piece, T
        shapes, refused = _shapes(body)
        notes += refused
        if shapes:
            parts.append(Part(body.name, piece, (frozen(T),) * len(shapes), shapes))
    if not parts:
        return None, tuple(notes)
    bare = [body.name for body in model.bodies if body.visuals and not body.collisions]
    if bare:
        notes.append(f"Without collision shapes, and so not checked: {', '.join(bare)}.")
    linkage = Linkage(movers)
    chain, gripper = model.arm.chain, model.arm.gripper
    lower, upper = np.append(chain.lower, gripper.lower), np.append(chain.upper, gripper.upper)
    return World(linkage, parts, pairs_that_meet(linkage, parts, lower, upper)), tuple(notes)


def table() -> Part:
    """What everything stands on, as a half-space."""
    return obstacle("table", np.eye(4), half_space())


def things_of(props: Props) -> tuple[Thing, ...]:
    """Cup and basin where they stand at first, as the cylinders round them."""
    return tuple(
        Thing(
            name,
            Form.CYLINDER,
            (vessel.outer_radius, vessel.height),
            se3.from_rotation_translation(np.eye(3), at),
            can_be_held=name == "cup",
        )
        for name, vessel, at in (("cup", props.cup, CUP_AT), ("basin", props.basin, BASIN_AT))
    )


def standing_around(props: Props) -> tuple[Part, ...]:
    """The table and ``things_of`` as obstacles that stay where they are."""
    things = things_of(props)
    return (table(), *(obstacle(each.name, each.T_shape, each.shape) for each in things))


def hand_of(model: RobotModel, world: World) -> Hand:
    """The fingers and what they hang on; without any, what the last joint turns."""
    driven = {body.name for body in model.bodies if body.joint in model.fingers}
    fingers = [part for part in world.parts if part.name in driven]
    if fingers:
        palm = int(world.linkage.parent[fingers[0].mover])
    else:
        palm = int(np.flatnonzero(world.linkage.variable == model.arm.chain.n - 1)[-1])
    chain = model.arm.chain
    T_base_palm = world.linkage.poses(np.zeros(chain.n + 1))[palm]
    T_palm_tool = se3.inverse(T_base_palm) @ model.T_base_shoulder @ chain.M
    names = tuple(part.name for part in fingers)
    return Hand(palm, names, frozen(T_palm_tool), slides=model.arm.gripper.slides)


def _drive(model: RobotModel, body: Body) -> tuple[int, float, float] | None:
    """Which entry of x turns the body's joint, with factor and offset; None where none does."""
    chain = model.arm.chain
    if body.joint is None:
        return None
    if body.joint in chain.names:
        return chain.names.index(body.joint), 1.0, 0.0
    if body.joint in model.fingers:
        return chain.n, *model.fingers[body.joint]
    return None


def _shapes(body: Body) -> tuple[tuple[Shape, ...], list[str]]:
    shapes: list[Shape] = []
    refused: list[str] = []
    for collision in body.collisions:
        try:
            shapes.append(hull(collision.mesh.vertices))
        except InputError as error:
            refused.append(f"A collision shape of link {body.name!r} is left out: {error}")
    return tuple(shapes), refused
