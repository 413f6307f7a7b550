"""The elements of a checked URDF file as plain values: links, joints and shapes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple
from xml.etree.ElementTree import Element

import numpy as np

from katana450.arm.robot.visual import GREY, Color, Visual, box, cylinder, mesh_file, sphere
from katana450.maths.geometry import se3, so3
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
    """A <joint>.

    Attributes:
        type: one of ``description.JOINTS``.
        parent, child: names of its links.
        origin: (4, 4) pose of the child in the parent at zero [m].
        axis: (3,) as stated, in the frame of the child; not normalised.
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
class UrdfLink:
    """A <link>.

    Attributes:
        mass: [kg], 0 if not stated. center: (3,) of mass in the frame of the link [m].
        missing: the mesh files of its shapes that do not exist.
    """

    name: str
    visuals: tuple[Visual, ...]
    collisions: tuple[Visual, ...]
    mass: float
    center: FloatArray
    missing: tuple[Path, ...]


@dataclass(frozen=True, eq=False)
class Urdf:
    """A <robot>: its links and joints by name, in the order of the file."""

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
        """Return the names of the links, each after the link it hangs on."""
        parents = {joint.child: joint.parent for joint in self.joints.values()}
        children: dict[str, list[str]] = {}
        for name in self.links:
            if name in parents:
                children.setdefault(parents[name], []).append(name)
        order = [name for name in self.links if name not in parents]
        for name in order:
            order.extend(children.get(name, ()))
        return order


def urdf_of(root: Element, folder: Path) -> Urdf:
    """Return the robot in ``root``, the outermost element of a file that passed the checks.

    ``folder``: the folder of the file, which mesh files are named from.
    """
    colors = {
        material.get("name"): found
        for material in root.findall("material")
        if (found := _color(material)) is not None
    }
    return Urdf(
        name=root.attrib["name"],
        links={e.attrib["name"]: _link(e, colors, folder) for e in root.findall("link")},
        joints={e.attrib["name"]: _joint(e) for e in root.findall("joint")},
    )


def _link(element: Element, colors: Mapping[str | None, Color], folder: Path) -> UrdfLink:
    missing: list[Path] = []
    visuals, collisions = (
        tuple(
            visual
            for shape in element.findall(tag)
            if (visual := _visual(shape, known, folder, missing)) is not None
        )
        for tag, known in (("visual", colors), ("collision", {}))
    )
    inertial = element.find("inertial")
    mass, center = None, np.zeros(3)
    if inertial is not None and (mass := inertial.find("mass")) is not None:
        center = _origin(inertial)[:3, 3]
    weight = 0.0 if mass is None else max(float(mass.get("value", 0.0)), 0.0)
    name = element.attrib["name"]
    return UrdfLink(name, visuals, collisions, weight, frozen(center), tuple(missing))


def _joint(element: Element) -> UrdfJoint:
    axis, limit, mimic = (element.find(tag) for tag in ("axis", "limit", "mimic"))
    return UrdfJoint(
        name=element.attrib["name"],
        type=element.attrib["type"],
        parent=_found(element, "parent").attrib["link"],
        child=_found(element, "child").attrib["link"],
        origin=_origin(element),
        axis=frozen(_numbers("1 0 0" if axis is None else axis.get("xyz", "1 0 0"))),
        limit=None if limit is None else UrdfLimit(*(_number(limit, k) for k in UrdfLimit._fields)),
        mimic=None
        if mimic is None
        else UrdfMimic(
            mimic.attrib["joint"],
            float(mimic.get("multiplier", 1.0)),
            float(mimic.get("offset", 0.0)),
        ),
    )


def _visual(
    element: Element, colors: Mapping[str | None, Color], folder: Path, missing: list[Path]
) -> Visual | None:
    """The shape of a <visual> or <collision>; None for a mesh file that joins ``missing``."""
    material = element.find("material")
    color = None
    if material is not None:
        color = _color(material) or colors.get(material.get("name"))
    shape = _found(element, "geometry")[0]
    scale = np.ones(3)
    match shape.tag:
        case "box":
            source = box(_numbers(shape.attrib["size"]))
        case "cylinder":
            source = cylinder(float(shape.attrib["radius"]), float(shape.attrib["length"]))
        case "sphere":
            source = sphere(float(shape.attrib["radius"]))
        case _:
            path = mesh_file(shape.attrib["filename"], folder)
            if not path.is_file():
                missing.append(path)
                return None
            scale = np.broadcast_to(_numbers(shape.get("scale", "1")), 3)
            return Visual(_origin(element), frozen(scale), path, color or GREY)
    return Visual(_origin(element), frozen(scale), source, color or GREY)


def _color(material: Element) -> Color | None:
    """Red, green and blue of 255; None for a material that states no color."""
    color = material.find("color")
    if color is None:
        return None
    red, green, blue = (
        round(255.0 * min(max(part, 0.0), 1.0))
        for part in _numbers(color.get("rgba", "1 1 1 1")).tolist()[:3]
    )
    return red, green, blue


def _origin(element: Element) -> FloatArray:
    """(4, 4) of the <origin> in ``element`` [m]; the identity without one."""
    origin = element.find("origin")
    if origin is None:
        return frozen(np.eye(4))
    xyz, rpy = (_numbers(origin.get(name, "0 0 0")).tolist() for name in ("xyz", "rpy"))
    return frozen(se3.from_rotation_translation(so3.from_rpy(*rpy), xyz))


def _found(element: Element, tag: str) -> Element:
    found = element.find(tag)
    assert found is not None, f"the checks let a <{element.tag}> without <{tag}> pass"
    return found


def _number(element: Element, name: str) -> float | None:
    text = element.get(name)
    return None if text is None else float(text)


def _numbers(text: str) -> FloatArray:
    """The numbers of an attribute; some files put commas between them."""
    return np.array([float(word) for word in text.replace(",", " ").split()])
