"""A URDF file as plain values: links, joints and shapes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple
from xml.etree.ElementTree import Element, fromstring

import numpy as np

from katana450.arm.robot.visual import GREY, Color, PrimitiveShape, Visual, mesh_file
from katana450.maths.geometry.arrays import FloatArray, frozen


class UrdfLimit(NamedTuple):
    """Limits [rad] or [m] and maximum speed [rad/s] or [m/s] of a joint; None if not stated."""

    lower: float | None
    upper: float | None
    velocity: float | None


class UrdfMimic(NamedTuple):
    """The joint that another follows: value = multiplier * (value of ``joint``) + offset."""

    joint: str
    multiplier: float
    offset: float


@dataclass(frozen=True, eq=False)
class UrdfJoint:
    """An element <joint>.

    Attributes:
        name: of the joint.
        type: one of ``description.JOINTS``.
        parent, child: names of its links.
        origin: (4, 4) pose of the child in the parent at zero [m].
        axis: (3,) as stated, in the frame of the child; not normalised.
        limit: limits and speed, if stated.
        mimic: the joint that it follows, if any.
    """

    name: str
    type: str
    parent: str
    child: str
    origin: FloatArray
    axis: FloatArray
    limit: UrdfLimit | None
    mimic: UrdfMimic | None


@dataclass(frozen=True, eq=False)
class UrdfShape:
    """A shape of a link: a ``Visual`` whose source is either a mesh file or a primitive."""

    T_body_visual: FloatArray
    scale: FloatArray
    colour: Color
    file: Path | None = None
    primitive: PrimitiveShape | None = None

    @property
    def visual(self) -> Visual:
        """The shape that can be read."""
        source = self.file or self.primitive
        assert source is not None
        return Visual(self.T_body_visual, self.scale, source, self.colour)


@dataclass(frozen=True, eq=False)
class UrdfLink:
    """An element <link>.

    Attributes:
        name: of the link.
        visuals, collisions: its shapes.
        mass: [kg], 0 if not stated.
        center: (3,) centre of mass in the frame of the link [m].
        missing: the mesh files of its visuals, and of its collisions, that do not exist.
    """

    name: str
    visuals: tuple[UrdfShape, ...]
    collisions: tuple[UrdfShape, ...]
    mass: float
    center: FloatArray
    missing: tuple[tuple[Path, ...], tuple[Path, ...]]


@dataclass(frozen=True, eq=False)
class Urdf:
    """An element <robot>: its links and joints by name, in the order of the file."""

    name: str
    links: Mapping[str, UrdfLink]
    joints: Mapping[str, UrdfJoint]

    def frames(self) -> dict[str, FloatArray]:
        """Return the pose (4, 4) of each link in the root with every joint at zero [m]."""
        found: dict[str, FloatArray] = {}
        above = {joint.child: joint for joint in self.joints.values()}
        for name in self.parents_first():
            joint = above.get(name)
            found[name] = np.eye(4) if joint is None else found[joint.parent] @ joint.origin
        return found

    def parents_first(self) -> list[str]:
        """Return the names of the links, each after its parent."""
        parents = {joint.child: joint.parent for joint in self.joints.values()}
        children: dict[str, list[str]] = {}
        for name in self.links:
            if name in parents:
                children.setdefault(parents[name], []).append(name)
        order = [name for name in self.links if name not in parents]
        for name in order:
            order.extend(children.get(name, ()))
        return order


def urdf_of(data: bytes, folder: Path) -> Urdf:
    """Return the robot in ``data``, the contents of a file that passed the checks.

    ``folder``: the folder of the file, to which the names of mesh files are relative.
    """
    robot = fromstring(data)
    colors = {
        each.get("name"): color
        for each in robot.findall("material")
        if (color := _rgb(each)) is not None
    }
    links = [_link(each, colors, folder) for each in robot.findall("link")]
    joints = [_joint(each) for each in robot.findall("joint")]
    return Urdf(
        name=robot.attrib["name"],
        links={link.name: link for link in links},
        joints={joint.name: joint for joint in joints},
    )


def _link(link: Element, colors: Mapping[str | None, Color], folder: Path) -> UrdfLink:
    missing: tuple[list[Path], list[Path]] = ([], [])
    visuals, collisions = (
        tuple(
            visual
            for shape in link.findall(kind)
            if (visual := _visual(shape, colors, folder, files)) is not None
        )
        for kind, files in zip(("visual", "collision"), missing, strict=True)
    )
    mass, center = 0.0, np.zeros(3)
    stated = link.find("inertial/mass")
    if stated is not None:
        mass = max(float(stated.get("value", 0.0)), 0.0)
        center = _origin(link.find("inertial"))[:3, 3]
    lost = tuple(missing[0]), tuple(missing[1])
    return UrdfLink(link.attrib["name"], visuals, collisions, mass, frozen(center), lost)


def _joint(joint: Element) -> UrdfJoint:
    parent, child = (joint.find(end) for end in ("parent", "child"))
    limit, mimic = joint.find("limit"), joint.find("mimic")
    bounds = [next(iter(_numbers(limit, name)), None) for name in UrdfLimit._fields]
    assert parent is not None
    assert child is not None
    return UrdfJoint(
        name=joint.attrib["name"],
        type=joint.attrib["type"],
        parent=parent.attrib["link"],
        child=child.attrib["link"],
        origin=_origin(joint),
        axis=frozen(_numbers(joint.find("axis"), "xyz", "1 0 0")),
        limit=None if limit is None else UrdfLimit(*bounds),
        mimic=None
        if mimic is None
        else UrdfMimic(
            mimic.attrib["joint"],
            float(mimic.get("multiplier", 1.0)),
            float(mimic.get("offset", 0.0)),
        ),
    )


def _visual(
    shape: Element, colors: Mapping[str | None, Color], folder: Path, missing: list[Path]
) -> UrdfShape | None:
    """Return the shape of a visual or collision; None for a missing file, added to ``missing``."""
    geometry = shape.find("geometry")
    assert geometry is not None
    form, scale, file = geometry[0], np.ones(3), None
    primitive = None
    match form.tag:
        case "box":
            primitive = PrimitiveShape("box", {"extents": _numbers(form, "size")})
        case "cylinder":
            radius, height = float(form.attrib["radius"]), float(form.attrib["length"])
            primitive = PrimitiveShape("cylinder", {"radius": radius, "height": height})
        case "sphere":
            radius = float(form.attrib["radius"])
            primitive = PrimitiveShape("icosphere", {"subdivisions": 3, "radius": radius})
        case _:
            file = mesh_file(form.attrib["filename"], folder)
            if not file.is_file():
                missing.append(file)
                return None
            scale = np.broadcast_to(_numbers(form, "scale", "1"), 3)
    return UrdfShape(_origin(shape), frozen(scale), _color(shape, colors), file, primitive)


def _color(shape: Element, colors: Mapping[str | None, Color]) -> Color:
    """Return the colour of its material, or of the robot's material of that name."""
    material = shape.find("material")
    if material is None:
        return GREY
    return _rgb(material) or colors.get(material.get("name")) or GREY


def _rgb(material: Element) -> Color | None:
    """Return red, green and blue (0..255) of ``material``; None if it states no colour."""
    color = material.find("color")
    if color is None:
        return None
    parts = _numbers(color, "rgba", "1 1 1 1")
    red, green, blue = (round(255.0 * min(max(part, 0.0), 1.0)) for part in parts[:3])
    return red, green, blue


def _origin(element: Element | None) -> FloatArray:
    """Return the pose (4, 4) of the origin of ``element`` [m]; the identity if none is stated."""
    origin = None if element is None else element.find("origin")
    if origin is None:
        return frozen(np.eye(4))
    T, R = np.eye(4), np.eye(4)
    T[:3, 3] = _numbers(origin, "xyz", "0 0 0")
    # In the order of trimesh and yourdfpy: what follows from a robot stays the same to the bit.
    rpy = _numbers(origin, "rpy", "0 0 0")
    (si, sj, sk), (ci, cj, ck) = map(np.sin, rpy), map(np.cos, rpy)
    cc, cs, sc, ss = ci * ck, ci * sk, si * ck, si * sk
    R[0, :3] = cj * ck, sj * sc - cs, sj * cc + ss
    R[1, :3] = cj * sk, sj * ss + cc, sj * cs - sc
    R[2, :3] = -sj, cj * si, cj * ci
    return frozen(T @ R)


def _numbers(element: Element | None, name: str, default: str = "") -> list[float]:
    """Return the numbers of an attribute, which commas may separate."""
    text = default if element is None else element.get(name, default)
    return [float(word) for word in text.replace(",", " ").split()]
