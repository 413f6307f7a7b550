"""A robot as a USD scene with UsdPhysics: rigid bodies, joints, drives and collision shapes.

Links are rigid bodies side by side, placed in the root, because UsdPhysics moves bodies by world
poses. Joints connect them. Frames without mass on fixed joints, such as the tool point, are no
bodies, because engines would give them a mass; each is in the body that carries it. A joint that
follows another has no schema in USD itself, so its factor and offset are custom attributes.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from katana450.arm.robot.link import Joint, Link
from katana450.arm.robot.robot import Robot
from katana450.arm.robot.surfaces import Material, VisualMesh, shapes_of
from katana450.extensions.export.excluded_pairs import excluded_pairs
from katana450.extensions.export.names import distinct
from katana450.extensions.export.physics import (
    GRAVITY,
    Drive,
    Inertial,
    drives_of,
    inertials_of,
    is_frame,
)
from katana450.extensions.export.rows import distinct_rows
from katana450.extensions.export.usda_text import (
    Prim,
    matrix,
    number,
    points,
    quoted,
    usda_text,
    vector,
    whole,
)
from katana450.maths.geometry import so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.srgb import to_light

DIGITS, NORMAL_DIGITS = 5, 3
"""Decimal places of coordinates [m] and of normals."""

_PER_CORNER = ' (interpolation = "faceVarying")'
"""Metadata of normals: one for each corner of each face."""

RESERVED = frozenset(("Looks", "Joints", "Shapes"))
"""Names of the scopes beside and in the links."""


def usd_files(robot: Robot, path: Path, values: Mapping[str, float]) -> dict[str, bytes]:
    """Return name and content of the file at the joint ``values`` [rad or m].

    ``path``: the URDF file of ``robot``.
    """
    (name,) = distinct([robot.name])
    root = _Scene(robot, path, name).root(values)
    text = usda_text(root, f"{robot.name}, by katana450", [_gravity()])
    return {f"{name}.usda": text.encode()}


class _Scene:
    """The prims of one robot, whose root prim is named ``name``."""

    def __init__(self, robot: Robot, path: Path, name: str) -> None:
        self._robot = robot
        self._name = name
        self._inertials = inertials_of(path)
        self._drives = drives_of(robot, path)
        links = [link.name for link in robot.links]
        self._links = dict(zip(links, distinct(links, RESERVED), strict=True))
        shown = list(dict.fromkeys(shape.material for link in robot.links for shape in link.shapes))
        looks = distinct(material.name for material in shown)
        self._looks: dict[Material, str] = dict(zip(shown, looks, strict=True))

    def root(self, values: Mapping[str, float]) -> Prim:
        frames = self._robot.frames(values)
        excluded: dict[str, list[str]] = {}
        for first, second, _ in excluded_pairs(self._robot):
            excluded.setdefault(first, []).append(self._path(second))
        links = [
            link for link in self._robot.links if not is_frame(self._robot, link, self._inertials)
        ]
        bodies = [
            self._body(link, frames[link.name], excluded.get(link.name, ())) for link in links
        ]
        names = distinct(link.joint.name if link.joint else link.name for link in links)
        joints = [self._joint(link, name, values) for link, name in zip(links, names, strict=True)]
        looks = [
            _look(material, name, f"/{self._name}/Looks/{name}")
            for material, name in self._looks.items()
        ]
        return Prim(
            "Xform",
            self._name,
            ("PhysicsArticulationRootAPI",),
            {},
            [
                Prim("Scope", "Looks", (), {}, looks),
                *bodies,
                Prim("Scope", "Joints", (), {}, joints),
            ],
        )

    def _path(self, link: str) -> str:
        return f"</{self._name}/{self._links[link]}>"

    def _body(self, link: Link, T_root_link: FloatArray, excluded: Sequence[str]) -> Prim:
        schemas = ["PhysicsRigidBodyAPI", "PhysicsMassAPI"]
        properties: dict[str, str | None] = {
            **_placed(T_root_link),
            **_mass(self._inertials.get(link.name)),
        }
        if excluded:
            schemas.append("PhysicsFilteredPairsAPI")
            properties["rel physics:filteredPairs"] = f"[{', '.join(excluded)}]"
        meshes = [
            self._mesh(f"look_{k}", [shape], shape.material) for k, shape in enumerate(link.shapes)
        ]
        for k, collision in enumerate(link.collisions):
            meshes.append(self._mesh(f"collision_{k}", shapes_of(collision), None))
        carried = [
            Prim("Xform", self._links[child.name], (), _placed(child.T_parent_link))
            for child in self._robot.children(link)
            if is_frame(self._robot, child, self._inertials)
        ]
        shapes = [Prim("Scope", "Shapes", (), {}, meshes)] if meshes else []
        return Prim("Xform", self._links[link.name], schemas, properties, [*shapes, *carried])

    def _mesh(self, name: str, shapes: Sequence[VisualMesh], look: Material | None) -> Prim:
        """Return a mesh with a material, or without one an invisible collision shape."""
        corners, at = distinct_rows([shape.vertices for shape in shapes], DIGITS)
        starts = np.cumsum([0, *(len(shape.vertices) for shape in shapes)])
        faces = np.concatenate(
            [shape.faces + start for shape, start in zip(shapes, starts, strict=False)]
        )
        properties: dict[str, str | None] = {
            "point3f[] points": points(corners, DIGITS),
            "int[] faceVertexCounts": whole(np.full(len(faces), 3)),
            "int[] faceVertexIndices": whole(at[faces].ravel()),
            "uniform token subdivisionScheme": '"none"',
        }
        if look is None:
            schemas = ["PhysicsCollisionAPI", "PhysicsMeshCollisionAPI"]
            properties["uniform token purpose"] = '"guide"'
            properties["uniform token physics:approximation"] = '"convexHull"'
        else:
            schemas = ["MaterialBindingAPI"]
            normals = np.concatenate([shape.normals for shape in shapes])[faces.ravel()]
            properties["normal3f[] normals"] = points(normals, NORMAL_DIGITS) + _PER_CORNER
            properties["rel material:binding"] = f"</{self._name}/Looks/{self._looks[look]}>"
        return Prim("Mesh", name, schemas, properties)

    def _joint(self, link: Link, name: str, values: Mapping[str, float]) -> Prim:
        """Return the joint between ``link`` and its parent, for the root the world."""
        properties: dict[str, str | None] = {}
        if link.parent is not None:
            properties["rel physics:body0"] = self._path(link.parent)
        properties["rel physics:body1"] = self._path(link.name)
        joint = link.joint
        # x of the joint's frames is along its axis.
        R = np.eye(3) if joint is None else _along_x(joint.axis)
        T = link.T_parent_link
        for body, at, turn in ((0, T[:3, 3], T[:3, :3] @ R), (1, np.zeros(3), R)):
            properties[f"point3f physics:localPos{body}"] = vector(at)
            properties[f"quatf physics:localRot{body}"] = vector(so3.to_quaternion(turn))
        if joint is None:
            return Prim("PhysicsFixedJoint", name, (), properties)
        properties |= _limits(joint)
        if joint.leader != joint.name:
            properties["custom string katana450:mimic:joint"] = quoted(joint.leader)
            properties["custom double katana450:mimic:factor"] = number(joint.factor)
            properties["custom double katana450:mimic:offset"] = number(joint.offset)
            schemas: tuple[str, ...] = ()
        else:
            kind = "linear" if joint.slides else "angular"
            schemas = (f"PhysicsDriveAPI:{kind}",)
            properties |= _drive(self._drives[joint.name], kind, values[joint.name])
        shape = "Prismatic" if joint.slides else "Revolute"
        return Prim(f"Physics{shape}Joint", name, schemas, properties)


def _gravity() -> Prim:
    """Return the settings of a simulation."""
    return Prim(
        "PhysicsScene",
        "PhysicsScene",
        (),
        {
            "vector3f physics:gravityDirection": "(0, 0, -1)",
            "float physics:gravityMagnitude": number(GRAVITY),
        },
    )


def _placed(T: FloatArray) -> dict[str, str | None]:
    return {
        "matrix4d xformOp:transform": matrix(T),
        "uniform token[] xformOpOrder": '["xformOp:transform"]',
    }


def _mass(inertial: Inertial | None) -> dict[str, str | None]:
    if inertial is None:
        return {}
    moments, axes = inertial.principal
    return {
        "float physics:mass": number(inertial.mass),
        "point3f physics:centerOfMass": vector(inertial.T_link_inertia[:3, 3]),
        "float3 physics:diagonalInertia": vector(moments),
        "quatf physics:principalAxes": vector(so3.to_quaternion(axes)),
    }


def _limits(joint: Joint) -> dict[str, str | None]:
    """Return axis and limits; UsdPhysics has degrees."""
    scale = 1.0 if joint.slides else 180.0 / math.pi
    return {
        "uniform token physics:axis": '"X"',
        "float physics:lowerLimit": number(scale * joint.lower),
        "float physics:upperLimit": number(scale * joint.upper),
    }


def _drive(drive: Drive, kind: str, value: float) -> dict[str, str | None]:
    """Return a position drive to ``value`` [rad or m]; UsdPhysics counts by degrees."""
    scale = 1.0 if kind == "linear" else math.pi / 180.0
    return {
        f"uniform token drive:{kind}:physics:type": '"force"',
        f"float drive:{kind}:physics:targetPosition": number(value / scale),
        f"float drive:{kind}:physics:stiffness": number(scale * drive.stiffness),
        f"float drive:{kind}:physics:damping": number(scale * drive.damping),
    }


def _along_x(axis: FloatArray) -> FloatArray:
    """Return a rotation (3, 3) whose x axis is the unit vector ``axis``."""
    other = np.eye(3)[int(np.abs(axis).argmin())]
    y = np.cross(other, axis)
    y /= np.linalg.norm(y)
    return np.column_stack((axis, y, np.cross(axis, y)))


def _look(material: Material, name: str, path: str) -> Prim:
    """Return a material; USD has colours as linear light."""
    shader = Prim(
        "Shader",
        "surface",
        (),
        {
            "uniform token info:id": '"UsdPreviewSurface"',
            "color3f inputs:diffuseColor": vector(np.round(to_light(material.colour), 5)),
            "float inputs:metallic": number(round(material.metallic, 4)),
            "float inputs:roughness": number(round(material.rough, 4)),
            "token outputs:surface": None,
        },
    )
    connected: dict[str, str | None] = {
        "token outputs:surface.connect": f"<{path}/surface.outputs:surface>"
    }
    return Prim("Material", name, (), connected, [shader])
