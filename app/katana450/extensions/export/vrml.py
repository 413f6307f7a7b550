"""A robot as a VRML97 world, in the structure of the paper's LabVIEW and Simulink scenes.

Geometry is given in the root's frame with all joints at zero, as a CAD program exports an assembly.
Each joint is a Transform whose `center` is a point of its axis and whose `rotation` is about that
axis. The nested Transforms are therefore the product of exponentials, link by link.

The shapes of a link are in a Switch: 0 shows them as made, 1 painted in one colour, -1 hides them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from katana450.arm.robot.initial_camera import FIELD_OF_VIEW, camera
from katana450.arm.robot.link import Joint, Link
from katana450.arm.robot.robot import Robot
from katana450.arm.robot.surfaces import Material, VisualMesh
from katana450.errors import InputError
from katana450.extensions.export.names import distinct
from katana450.extensions.export.trajectory_file import RecordedMotion
from katana450.extensions.export.vrml_names import VrmlNames
from katana450.extensions.export.vrml_node import Node, Route, Use, Value, World
from katana450.extensions.export.vrml_text import world_text
from katana450.maths.geometry import so3
from katana450.maths.geometry.arrays import FloatArray

DIGITS = 5
"""Decimal places of a coordinate [m]: a hundredth of a millimetre."""

NORMAL_DIGITS = 3
"""Decimal places of a normal."""

SKY = (0.87, 0.89, 0.92)
"""Colour of the background."""

Z_UP = (1.0, 0.0, 0.0, -math.pi / 2.0)
"""Rotation (axis, angle) from the root's z up to VRML's y up."""

_TURN = so3.rotation_x(-math.pi / 2.0)


def world_of(
    robot: Robot, values: Mapping[str, float], motion: RecordedMotion | None = None
) -> World:
    """Return the whole robot at the joint ``values`` [rad, m], or playing ``motion``.

    A motion also sets the static pose to its first sample, for programs that do not play it.
    """
    values = values if motion is None else motion.start
    names = VrmlNames(robot)
    root = _link(robot, robot.links[0], values, names, set())
    nodes = [
        *_surroundings(robot),
        Node("Transform", (("rotation", Z_UP), ("children", (root,)))),
    ]
    routes: list[Route] = []
    if motion is not None:
        clock: list[tuple[str, Value]] = [("cycleInterval", float(motion.t[-1])), ("loop", True)]
        nodes.append(Node("TimeSensor", tuple(clock), names.clock))
        for name, joint in robot.joints.items():
            nodes.append(_interpolator(joint, robot, motion, names))
            target, source = names.joints[name], f"{names.joints[name]}{names.way}"
            setter = "set_translation" if joint.slides else "set_rotation"
            routes.append(Route(names.clock, "fraction_changed", source, "set_fraction"))
            routes.append(Route(source, "value_changed", target, setter))
    return World(tuple(nodes), tuple(routes))


def vrml_files(
    robot: Robot, values: Mapping[str, float], motion: RecordedMotion | None = None
) -> dict[str, bytes]:
    """Return name and content of the file of the robot, and of one file per link with shapes."""
    (whole,) = distinct([robot.name])
    files = {f"{whole}.wrl": world_text(world_of(robot, values, motion)).encode()}
    links = [link for link in robot.links if link.shapes]
    for link, name in zip(links, distinct(link.name for link in links), strict=True):
        files[f"parts/{name}.wrl"] = world_text(part_world(robot, link)).encode()
    return files


def part_world(robot: Robot, link: Link) -> World:
    """Return one link at its place with all joints at zero, z up; all of them form the robot."""
    names = VrmlNames(robot)
    shapes = _shapes(robot, link, names, set())
    part = Node("Group", (("children", tuple(shapes)),), names.links[link.name])
    title = Node("WorldInfo", (("title", f"{robot.name} {link.name}"),))
    return World((title, Node("Transform", (("rotation", Z_UP), ("children", (part,))))))


def _surroundings(robot: Robot) -> list[Node]:
    view = camera(robot)
    R = _TURN @ _looking(view.target - view.eye)
    w = so3.log(R)
    angle = float(np.linalg.norm(w))
    axis = w / angle if angle else np.array([0.0, 0.0, 1.0])
    return [
        Node(
            "WorldInfo",
            (("title", robot.name), ("info", ("Metres and radians; z of the root is up.",))),
        ),
        Node("NavigationInfo", (("type", ("EXAMINE", "ANY")),)),
        Node("Background", (("skyColor", SKY),)),
        Node(
            "Viewpoint",
            (
                ("position", _rounded(_TURN @ view.eye, 6)),
                ("orientation", _rounded([*axis, angle], 9)),
                ("fieldOfView", FIELD_OF_VIEW),
                ("description", "All of it"),
            ),
        ),
        Node("DirectionalLight", (("direction", (0.3, -1.0, -0.4)), ("intensity", 0.6))),
    ]


def _looking(direction: FloatArray) -> FloatArray:
    """Return the rotation (3, 3) in the root of a camera along ``direction`` (3,).

    Its x points right, y up and -z ahead.
    """
    back = -direction / np.linalg.norm(direction)
    right = np.cross((0.0, 0.0, 1.0), back)
    right /= np.linalg.norm(right)
    return np.column_stack((right, np.cross(back, right), back))


def _link(
    robot: Robot,
    link: Link,
    values: Mapping[str, float],
    names: VrmlNames,
    written: set[Material],
) -> Node:
    """Return the node of a link with all its children; ``written`` collects the materials."""
    own = _switch(robot, link, names, written)
    children_nodes = [_link(robot, other, values, names, written) for other in robot.children(link)]
    center = ("center", _rounded(robot.home[link.name][:3, 3], 9))
    children = ("children", (*own, *children_nodes))
    if link.joint is None:
        return Node("Transform", (center, children), names.links[link.name])
    group = Node("Group", (children,), names.links[link.name])
    moved = _moved(robot, link.joint, values[link.joint.name])
    return Node("Transform", (center, moved, ("children", (group,))), names.joints[link.joint.name])


def _switch(robot: Robot, link: Link, names: VrmlNames, written: set[Material]) -> tuple[Node, ...]:
    """Return the Switch of a link: its shapes as made, and again to be painted."""
    if not link.shapes:
        return ()
    dressed = names.dressed[link.name]
    colours = (("diffuseColor", _rounded(link.colour, 4)), ("transparency", 0.0))
    paint: Node | Use = Node("Material", colours, dressed.paint)
    made: list[Node] = []
    painted: list[Node] = []
    for number, shape in enumerate(_shapes(robot, link, names, written)):
        name = f"{names.links[link.name]}{names.surface}{number}"
        look, (field, surface) = shape.fields
        assert isinstance(surface, Node)
        made.append(replace(shape, fields=(look, (field, replace(surface, name=name)))))
        one = Node("Appearance", (("material", paint),))
        painted.append(Node("Shape", (("appearance", one), (field, Use(name)))))
        paint = Use(dressed.paint)
    choices = tuple(Node("Group", (("children", tuple(each)),)) for each in (made, painted))
    return (Node("Switch", (("whichChoice", 0), ("choice", choices)), dressed.appearance),)


def _moved(robot: Robot, joint: Joint, value: float) -> tuple[str, Value]:
    axis = robot.axis(joint)
    if joint.slides:
        return "translation", _rounded(value * axis, 9)
    return "rotation", (*_rounded(axis, 9), value)


def _shapes(robot: Robot, link: Link, names: VrmlNames, written: set[Material]) -> list[Node]:
    T = robot.home[link.name]
    return [_shape(shape, T, names, written) for shape in link.shapes]


def _shape(shape: VisualMesh, T: FloatArray, names: VrmlNames, written: set[Material]) -> Node:
    name = names.appearance(shape.material)
    appearance: Node | Use
    if shape.material in written:
        appearance = Use(name)
    else:
        written.add(shape.material)
        appearance = Node("Appearance", (("material", _material(shape.material)),), name)
    points = shape.vertices @ T[:3, :3].T + T[:3, 3]
    normals = shape.normals @ T[:3, :3].T
    index = np.column_stack((shape.faces, np.full(len(shape.faces), -1)))
    surface = Node(
        "IndexedFaceSet",
        (
            ("coord", Node("Coordinate", (("point", _rounded(points, DIGITS)),))),
            ("normal", Node("Normal", (("vector", _rounded(normals, NORMAL_DIGITS)),))),
            ("coordIndex", tuple(index.ravel().tolist())),
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


def _interpolator(joint: Joint, robot: Robot, motion: RecordedMotion, names: VrmlNames) -> Node:
    name = f"{names.joints[joint.name]}{names.way}"
    axis = robot.axis(joint)
    t, values = motion.keys(joint.name)
    keys = ("key", tuple((t / motion.t[-1]).tolist()))
    if joint.slides:
        rows = values[:, None] * axis
        return Node("PositionInterpolator", (keys, ("keyValue", _rounded(rows, 9))), name)
    rows = np.column_stack((np.broadcast_to(axis, (len(t), 3)), values))
    return Node("OrientationInterpolator", (keys, ("keyValue", _rounded(rows, 9))), name)


def _rounded(values: object, digits: int) -> tuple[float, ...]:
    # Adding zero turns -0 into 0.
    flat = np.round(np.asarray(values, dtype=float), digits).ravel() + 0.0
    if not np.isfinite(flat).all():
        raise InputError("A shape has coordinates that are not finite numbers.")
    return tuple(flat.tolist())
