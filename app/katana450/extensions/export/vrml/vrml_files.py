"""A robot as a VRML97 world, in the structure of the paper's LabVIEW and Simulink scenes.

Each joint is a Transform whose `rotation` is about its axis in the root's frame, between two that
bring a point of the axis to the origin and back: VTK ignores `center`. The nested Transforms are
therefore the product of exponentials, link by link. Each link is a Transform with its pose while
all joints are at zero, so that a program that computes absolute poses finds the frame of the link.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from katana450.arm.robot.initial_camera import (
    FIELD_OF_VIEW,
    VIEW_DIRECTION,
    InitialCamera,
    fitted,
    looking,
)
from katana450.arm.robot.link import Link
from katana450.arm.robot.props import load_props
from katana450.arm.robot.robot import Robot
from katana450.arm.robot.surfaces import Material, VisualMesh, shapes_of
from katana450.arm.robot.visual import Visual
from katana450.assembly.robot_session import arm_session
from katana450.errors import InputError
from katana450.extensions.export.files import distinct
from katana450.extensions.export.obj_text import DIGITS, NORMAL_DIGITS
from katana450.extensions.export.vrml.vrml_names import VrmlNames
from katana450.extensions.export.vrml.vrml_world import (
    Node,
    Use,
    Value,
    World,
    axis_angle,
    world_text,
    x3d_text,
)
from katana450.maths.geometry import so3
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.settings import Settings


@dataclass(frozen=True, eq=False)
class PlacedObject:
    """An object at its place.

    Attributes:
        name: its name on a server.
        T: (4, 4) its pose in the root's frame [m].
        shapes: its surfaces in its own frame.
    """

    name: str
    T: FloatArray
    shapes: Sequence[VisualMesh]


def initial_objects(robot: Robot) -> tuple[PlacedObject, ...]:
    """Return the objects that a new server has around ``robot``; none without an arm."""
    if robot.arm is None:
        return ()
    props, ones = load_props(), frozen(np.ones(3))
    files = {"cup": props.cup.mesh, "basin": props.basin.mesh}
    session = arm_session(Settings(), robot).session
    return tuple(
        PlacedObject(
            scene_object.name,
            scene_object.T,
            shapes_of(Visual(frozen(np.eye(4)), ones, files[scene_object.name])),
        )
        for scene_object in session.begin(session.ready, 0.0, 0.0).objects
    )


def view(robot: Robot, values: Mapping[str, float]) -> InitialCamera:
    """Return the camera that sees the whole robot with the joints at ``values`` [rad, m]."""
    points = [np.zeros((1, 3))]
    for link, T in zip(robot.links, robot.frames(values).values(), strict=True):
        points += [shape.vertices @ T[:3, :3].T + T[:3, 3] for shape in link.shapes]
    return fitted(np.concatenate(points), np.array(VIEW_DIRECTION))


SKY = (0.87, 0.89, 0.92)
"""Colour of the background."""

Z_UP = (1.0, 0.0, 0.0, -math.pi / 2.0)
"""Rotation (axis, angle) from the root's z up to VRML's y up."""

_TURN = so3.rotation_x(-math.pi / 2.0)


class _Writing:
    """State of the writing of one world.

    Attributes:
        robot: the robot.
        names: its names in the world.
        objects: name of the Transform of each object, by its own name.
        materials: the materials that have a node already.
    """

    def __init__(self, robot: Robot, objects: Sequence[PlacedObject]) -> None:
        self.robot = robot
        self.names = VrmlNames(robot)
        self.objects = self.names.objects([placed_object.name for placed_object in objects])
        self.materials: set[Material] = set()


def world_of(
    robot: Robot, values: Mapping[str, float], objects: Sequence[PlacedObject] = ()
) -> World:
    """Return the whole robot at the joint ``values`` [rad, m], with ``objects`` around it."""
    writing = _Writing(robot, objects)
    contents = [_link(writing, robot.links[0], values)]
    for placed in objects:
        contents.append(_shown(writing, placed.T, placed.shapes, writing.objects[placed.name]))
    nodes = [
        *_surroundings(robot, values),
        Node("Transform", (("rotation", Z_UP), ("children", contents))),
    ]
    return World(tuple(nodes))


def vrml_files(robot: Robot, world: World) -> dict[str, bytes]:
    """Return name and content of the file of ``world``, and of one file per link with shapes."""
    (whole,) = distinct([robot.name])
    files = {f"{whole}.wrl": world_text(world).encode()}
    links = [link for link in robot.links if link.shapes]
    for link, name in zip(links, distinct(link.name for link in links), strict=True):
        files[f"parts/{name}.wrl"] = world_text(part_world(robot, link)).encode()
    return files


def x3d_files(robot: Robot, world: World) -> dict[str, bytes]:
    """Return name and content of the file of ``world``."""
    (whole,) = distinct([robot.name])
    return {f"{whole}.x3d": x3d_text(world).encode()}


def part_world(robot: Robot, link: Link) -> World:
    """Return one link at its place with all joints at zero, z up; all of them form the robot."""
    writing = _Writing(robot, ())
    title = Node("WorldInfo", (("title", f"{robot.name} {link.name}"),))
    placed = _placed(writing, link)
    return World((title, Node("Transform", (("rotation", Z_UP), ("children", [placed])))))


def _surroundings(robot: Robot, values: Mapping[str, float]) -> list[Node]:
    nodes = [
        Node(
            "WorldInfo",
            (("title", robot.name), ("info", ["Metres and radians; z of the root is up."])),
        ),
        Node("NavigationInfo", (("type", ["EXAMINE", "ANY"]),)),
        Node("Background", (("skyColor", [*SKY]),)),
        Node("DirectionalLight", (("direction", (0.3, -1.0, -0.4)), ("intensity", 0.6))),
    ]
    camera = view(robot, values)
    turn = axis_angle(_TURN @ looking(camera.target - camera.eye))
    fields: tuple[tuple[str, Value], ...] = (
        ("position", _rounded(_TURN @ camera.eye, 6)),
        ("orientation", _rounded(turn, 9)),
        ("fieldOfView", FIELD_OF_VIEW),
        ("description", "All"),
    )
    nodes.append(Node("Viewpoint", fields))
    return nodes


def _link(writing: _Writing, link: Link, values: Mapping[str, float]) -> Node:
    """Return the node of a link and its joint, with those of all links that it carries."""
    robot = writing.robot
    # In the order of the file, so that a material is defined where it is first used.
    contents = [
        _placed(writing, link),
        *(_link(writing, other, values) for other in robot.children(link)),
    ]
    if link.joint is None:
        return Node("Group", (("children", contents),)) if len(contents) > 1 else contents[0]
    axis = robot.axis(link.joint)
    name, value = writing.names.joints[link.joint.name], values[link.joint.name]
    if link.joint.slides:
        moved: tuple[str, Value] = ("translation", _rounded(value * axis, 9))
        return Node("Transform", (moved, ("children", contents)), name)
    point = robot.home[link.name][:3, 3]
    back = _shifted(-point, contents)
    turned = (("rotation", (*_rounded(axis, 9), value)), ("children", [back]))
    return _shifted(point, [Node("Transform", turned, name)])


def _shifted(by: FloatArray, children: list[Node]) -> Node:
    return Node("Transform", (("translation", _rounded(by, 9)), ("children", children)))


def _placed(writing: _Writing, link: Link) -> Node:
    """Return the Transform of a link with its shapes, as placed with all joints at zero."""
    T = writing.robot.home[link.name]
    return _shown(writing, T, link.shapes, writing.names.links[link.name])


def _shown(writing: _Writing, T: FloatArray, shapes: Sequence[VisualMesh], name: str) -> Node:
    """Return the Transform ``name`` with ``shapes`` at the pose ``T`` (4, 4)."""
    fields: tuple[tuple[str, Value], ...] = (
        ("translation", _rounded(T[:3, 3], 9)),
        ("rotation", _rounded(axis_angle(T[:3, :3]), 9)),
        ("children", [_shape(writing, shape) for shape in shapes]),
    )
    return Node("Transform", fields, name)


def _shape(writing: _Writing, shape: VisualMesh) -> Node:
    name = writing.names.appearances.get(shape.material)
    appearance: Node | Use
    if name is not None and shape.material in writing.materials:
        appearance = Use(name)
    else:
        writing.materials.add(shape.material)
        appearance = Node("Appearance", (("material", _material(shape.material)),), name)
    index = np.column_stack((shape.faces, np.full(len(shape.faces), -1)))
    surface = Node(
        "IndexedFaceSet",
        (
            ("coord", Node("Coordinate", (("point", [*_rounded(shape.vertices, DIGITS)]),))),
            ("normal", Node("Normal", (("vector", [*_rounded(shape.normals, NORMAL_DIGITS)]),))),
            ("coordIndex", index.ravel().tolist()),
        ),
    )
    return Node("Shape", (("appearance", appearance), ("geometry", surface)))


def _material(material: Material) -> Node:
    return Node(
        "Material",
        (
            ("diffuseColor", _rounded(material.colour, 4)),
            ("specularColor", _rounded([material.gleam] * 3, 4)),
            ("shininess", round(min(max(1.0 - material.rough, 0.0), 1.0), 4)),
        ),
    )


def _rounded(values: object, digits: int) -> tuple[float, ...]:
    # Adding zero turns -0 into 0.
    flat = np.round(np.asarray(values, dtype=float), digits).ravel() + 0.0
    if not np.isfinite(flat).all():
        raise InputError("A shape has coordinates that are not finite numbers.")
    return tuple(flat.tolist())
