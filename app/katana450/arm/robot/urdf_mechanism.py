"""Any URDF as a mechanism: a tree of turning, sliding, fixed and mimicking joints."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from katana450.arm.robot.description import reading
from katana450.arm.robot.mechanism import Joint, Link, Material, Mechanism, Shape
from katana450.arm.robot.visual import Visual, rods, unreadable_mesh, visuals_of
from katana450.errors import RobotDescriptionError
from katana450.maths.geometry.arrays import FloatArray, frozen

MOVABLE = {"revolute": False, "continuous": False, "prismatic": True}
"""Types of joint that are understood, and whether each slides."""


EDGE = math.radians(30.0)
"""Between two triangles, from which on they are shaded apart."""


def load_mechanism(path: Path) -> tuple[Mechanism, tuple[str, ...]]:
    """The tree in a URDF file with its visual shapes, and notes for a person on what it lacks.

    Thin rods stand for a link without shapes that others hang on.

    Raises RobotDescriptionError when the file cannot be read or has a joint that no exported
    format has a word for.
    """
    import yourdfpy

    with reading(path):
        urdf = yourdfpy.URDF.load(str(path), load_meshes=False, build_scene_graph=False)
        joints = {joint.child: joint for joint in urdf.robot.joints}
        links = {link.name: link for link in urdf.robot.links}
        missing: list[Path] = []
        found: dict[str, Link] = {}
        for name in _parents_first(links, joints):
            visuals, absent = visuals_of(links[name].visuals, urdf.robot.materials, path.parent)
            missing.extend(absent)
            if not visuals:
                hung = [joint.origin for joint in joints.values() if joint.parent == name]
                visuals = rods([origin[:3, 3] for origin in hung if origin is not None])
            shapes = tuple(shape for visual in visuals for shape in shapes_of(visual))
            above = joints.get(name)
            if above is None:
                found[name] = Link(name, None, frozen(np.eye(4)), None, shapes)
            else:
                T = np.eye(4) if above.origin is None else above.origin
                found[name] = Link(name, above.parent, frozen(T), _joint(path, above), shapes)
    notes = tuple(f"There is no mesh at {mesh}." for mesh in missing)
    return _with_leaders(path, Mechanism(urdf.robot.name, tuple(found.values()))), notes


def _parents_first(links: dict[str, Any], joints: dict[str, Any]) -> list[str]:
    """The names of the links of a tree, each behind the one it hangs on."""
    children: dict[str, list[str]] = {}
    for name in links:
        if name in joints:
            children.setdefault(joints[name].parent, []).append(name)
    order = [name for name in links if name not in joints]
    for name in order:
        order.extend(children.get(name, ()))
    return order


def _joint(path: Path, joint: Any) -> Joint | None:
    if joint.type == "fixed":
        return None
    if joint.type not in MOVABLE:
        raise RobotDescriptionError(
            f"Joint {joint.name!r} of {path.name} is {joint.type}; "
            f"joints that can be exported are fixed, {', '.join(MOVABLE)}."
        )
    axis = np.asarray((1.0, 0.0, 0.0) if joint.axis is None else joint.axis, dtype=float)
    size = float(np.linalg.norm(axis))
    if not 0.0 < size < math.inf:
        raise RobotDescriptionError(f"Joint {joint.name!r} of {path.name} has no axis.")
    lower, upper = -math.inf, math.inf
    if joint.type != "continuous" and joint.limit is not None:
        lower, upper = (
            bound if value is None else float(value)
            for bound, value in ((lower, joint.limit.lower), (upper, joint.limit.upper))
        )
    leader, factor, offset = joint.name, 1.0, 0.0
    if joint.mimic is not None:
        if joint.mimic.joint == joint.name:
            raise RobotDescriptionError(f"Joint {joint.name!r} of {path.name} mimics itself.")
        leader = joint.mimic.joint
        factor = 1.0 if joint.mimic.multiplier is None else float(joint.mimic.multiplier)
        offset = 0.0 if joint.mimic.offset is None else float(joint.mimic.offset)
    named = None if joint.limit is None else joint.limit.velocity
    return Joint(
        name=joint.name,
        slides=MOVABLE[joint.type],
        axis=frozen(axis / size),
        lower=lower,
        upper=upper,
        leader=leader,
        factor=factor,
        offset=offset,
        speed=math.inf if named is None else float(named),
    )


def _with_leaders(path: Path, mechanism: Mechanism) -> Mechanism:
    """The same with every follower of a follower tied to the joint that is driven."""
    joints = mechanism.joints

    def led(joint: Joint) -> Joint:
        passed = [joint.name]
        while joint.leader != passed[-1]:
            above = joints.get(joint.leader)
            if above is None or above.name in passed:
                raise RobotDescriptionError(
                    f"Joint {joint.name!r} of {path.name} mimics {joint.leader!r}, "
                    "which no driven joint stands behind."
                )
            passed.append(above.name)
            factor, offset = joint.factor * above.factor, joint.factor * above.offset + joint.offset
            joint = replace(joint, leader=above.leader, factor=factor, offset=offset)
        return joint

    links = (
        link if link.joint is None else replace(link, joint=led(link.joint))
        for link in mechanism.links
    )
    return replace(mechanism, links=tuple(links))


def shapes_of(visual: Visual) -> Sequence[Shape]:
    """Its surfaces, one a material, in the frame of its body.

    Raises RobotDescriptionError if it is no mesh.
    """
    plain = Material(
        "plain {:02x}{:02x}{:02x}".format(*visual.colour),
        (visual.colour[0] / 255.0, visual.colour[1] / 255.0, visual.colour[2] / 255.0),
    )
    if not isinstance(visual.source, Path):
        return [_shape(_edged(visual.mesh), np.eye(4), plain)]
    import trimesh

    bare = visual.source.suffix.lower() == ".stl"
    T = visual.T_body_visual @ np.diag([*visual.scale, 1.0])
    try:
        scene = trimesh.load_scene(visual.source)
    except Exception as error:
        raise unreadable_mesh(visual.source) from error
    shapes = []
    for node in scene.graph.nodes_geometry:
        T_file, name = scene.graph[node]
        mesh = scene.geometry[name]
        if isinstance(mesh, trimesh.Trimesh) and len(mesh.faces):
            made = _edged(mesh) if bare else mesh
            shapes.append(_shape(made, T @ T_file, _material(mesh, plain)))
    return shapes


def _edged(mesh: Any) -> Any:
    """A mesh that brings no normals of its own, with those of a smooth surface up to an edge."""
    import trimesh

    return trimesh.graph.smooth_shade(mesh, angle=EDGE)


def _shape(mesh: Any, T: FloatArray, material: Material) -> Shape:
    A = T[:3, :3]
    normals = np.asarray(mesh.vertex_normals) @ np.linalg.inv(A)
    size = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = np.where(size > 0.0, normals / np.where(size > 0.0, size, 1.0), (0.0, 0.0, 1.0))
    faces = np.asarray(mesh.faces, dtype=np.int64)
    # A mirrored shape would show its inside.
    faces = faces[:, ::-1] if np.linalg.det(A) < 0.0 else faces
    vertices = np.asarray(mesh.vertices) @ A.T + T[:3, 3]
    return Shape(material, frozen(vertices), frozen(normals), faces)


def _material(mesh: Any, plain: Material) -> Material:
    material = getattr(mesh.visual, "material", None)
    if material is None:
        return plain
    factor = getattr(material, "baseColorFactor", None)
    if factor is None:
        red, green, blue = (float(part) / 255.0 for part in material.main_color[:3])
        return Material(str(material.name or plain.name), (red, green, blue))
    red, green, blue = (_srgb(float(part) / 255.0) for part in np.asarray(factor)[:3])
    metallic, rough = (
        default if value is None else float(value)
        for value, default in ((material.metallicFactor, 1.0), (material.roughnessFactor, 1.0))
    )
    return Material(str(material.name or plain.name), (red, green, blue), metallic, rough)


def _srgb(linear: float) -> float:
    """IEC 61966-2-1, for glTF tells colours as light."""
    return 12.92 * linear if linear <= 0.0031308 else 1.055 * linear ** (1.0 / 2.4) - 0.055
