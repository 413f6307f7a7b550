"""A URDF file, read with yourdfpy, as plain values: links, joints and shapes."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from katana450.arm.robot.link import Inertial, Joint, JointLimit, Link, Mimic
from katana450.arm.robot.visual import GREY, Color, PrimitiveShape, Visual, mesh_file
from katana450.disk_cache import kept
from katana450.maths.geometry.arrays import FloatArray, frozen


@dataclass(frozen=True, eq=False)
class Urdf:
    """An element <robot>: its links and joints by name, in the order of the file.

    The links have no parents yet, and the joints no leaders.
    """

    name: str
    links: Mapping[str, Link]
    joints: Mapping[str, Joint]

    def frames(self) -> dict[str, FloatArray]:
        """Return the pose (4, 4) of each link in the root with every joint at zero [m]."""
        frames: dict[str, FloatArray] = {}
        above = {joint.child: joint for joint in self.joints.values()}
        for name in self.parents_first():
            joint = above.get(name)
            frames[name] = (
                np.eye(4) if joint is None else frames[joint.parent] @ joint.T_parent_child
            )
        return frames

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


def driver_of(joint: Joint, joints: Mapping[str, Joint]) -> Mimic | None:
    """Return the driven joint among ``joints`` that ``joint`` follows, directly or not.

    Multiplier and offset are those of all joints between. A driven joint follows itself. None if
    it follows none of them.
    """
    factor, offset, passed = 1.0, 0.0, [joint.name]
    while joint.mimic is not None:
        leader = joints.get(joint.mimic.joint)
        if leader is None or leader.name in passed:
            return None
        factor, offset = factor * joint.mimic.multiplier, factor * joint.mimic.offset + offset
        passed.append(leader.name)
        joint = leader
    return Mimic(joint.name, factor, offset)


FILENAME = re.compile(rb"filename\s*=\s*[\"']([^\"']*)[\"']")
"""The name of a mesh file in the contents of a URDF file."""


class _Stream:
    """A file that is read once, in one piece.

    After a fault yourdfpy would read the file again and keep the parts that its parser accepts.
    """

    def __init__(self, data: bytes) -> None:
        self._data = data

    def read(self, _: int = -1) -> bytes:
        data, self._data = self._data, b""
        return data


def urdf_of(data: bytes, folder: Path) -> Urdf:
    """Return the robot in ``data``, the contents of a file that passed the checks.

    ``folder``: the folder of the file, to which the names of mesh files are relative.
    """
    # Which file a name refers to depends on the files that exist.
    files = [mesh_file(name.decode(errors="replace"), folder) for name in FILENAME.findall(data)]
    states = [f"{file} {file.is_file()}" for file in files]
    return kept(lambda: _read(data, folder), Urdf, data, str(folder), *states)


def _read(data: bytes, folder: Path) -> Urdf:
    # Imported here, because the import takes longer than reading a file.
    import yourdfpy

    options = {"build_scene_graph": False, "load_meshes": False}
    robot = yourdfpy.URDF.load(_Stream(data), **options).robot
    colors = {
        material.name: material.color for material in robot.materials if material.color is not None
    }
    return Urdf(
        name=robot.name,
        links={link.name: _link(link, colors, folder) for link in robot.links},
        joints={joint.name: _joint(joint) for joint in robot.joints},
    )


def _link(link: Any, colors: Mapping[str | None, Any], folder: Path) -> Link:
    missing: tuple[list[Path], list[Path]] = ([], [])
    visuals, collisions = (
        tuple(
            visual
            for shape in shapes
            if (visual := _visual(shape, colors, folder, files)) is not None
        )
        for shapes, files in zip((link.visuals, link.collisions), missing, strict=True)
    )
    inertial = None
    if link.inertial is not None and (link.inertial.mass or 0.0) > 0.0:
        moments = np.zeros((3, 3)) if link.inertial.inertia is None else link.inertial.inertia
        inertial = Inertial(link.inertial.mass, _origin(link.inertial), frozen(moments))
    lost = tuple(missing[0]), tuple(missing[1])
    return Link(link.name, None, frozen(np.eye(4)), None, visuals, collisions, inertial, lost)


def _joint(joint: Any) -> Joint:
    limit, mimic, losses = joint.limit, joint.mimic, joint.dynamics
    size = float(np.linalg.norm(joint.axis))
    return Joint(
        name=joint.name,
        type=joint.type,
        parent=joint.parent,
        child=joint.child,
        T_parent_child=_origin(joint),
        axis=frozen(joint.axis / size if 0.0 < size < np.inf else np.zeros(3)),
        limit=limit and JointLimit(limit.lower, limit.upper, limit.velocity, limit.effort),
        mimic=mimic and Mimic(mimic.joint, mimic.multiplier, mimic.offset),
        damping=0.0 if losses is None else losses.damping or 0.0,
        friction=0.0 if losses is None else losses.friction or 0.0,
    )


def _visual(
    shape: Any, colors: Mapping[str | None, Any], folder: Path, missing: list[Path]
) -> Visual | None:
    """Return the shape of a visual or collision; None for a missing file, added to ``missing``."""
    geometry, scale, file = shape.geometry, np.ones(3), None
    primitive = None
    if geometry.box is not None:
        primitive = PrimitiveShape("box", {"extents": np.asarray(geometry.box.size).tolist()})
    elif geometry.cylinder is not None:
        primitive = PrimitiveShape(
            "cylinder", {"radius": geometry.cylinder.radius, "height": geometry.cylinder.length}
        )
    elif geometry.sphere is not None:
        radius = geometry.sphere.radius
        primitive = PrimitiveShape("icosphere", {"subdivisions": 3, "radius": radius})
    else:
        file = mesh_file(geometry.mesh.filename, folder)
        if not file.is_file():
            missing.append(file)
            return None
        if geometry.mesh.scale is not None:
            scale = np.broadcast_to(np.asarray(geometry.mesh.scale, dtype=float), 3)
    return Visual(_origin(shape), frozen(scale), file, _color(shape, colors), primitive)


def _color(shape: Any, colors: Mapping[str | None, Any]) -> Color:
    """Return red, green and blue (0..255) of its material, or of the robot's one of that name."""
    material = getattr(shape, "material", None)
    if material is None:
        return GREY
    color = colors.get(material.name) if material.color is None else material.color
    if color is None:
        return GREY
    red, green, blue = (round(255.0 * min(max(part, 0.0), 1.0)) for part in color.rgba[:3].tolist())
    return red, green, blue


def _origin(element: Any) -> FloatArray:
    """Return the pose (4, 4) of the origin of ``element`` [m]; the identity if none is stated."""
    return frozen(np.eye(4) if element.origin is None else element.origin)
