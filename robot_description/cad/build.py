"""Writing of parts to files: one GLB file for each link with geometry."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from robot_description.cad.column import arm_base_link
from robot_description.cad.conduit import conduits_json
from robot_description.cad.control_box import base_link
from robot_description.cad.fingers import finger_left_link, finger_right_link
from robot_description.cad.forearm import forearm_link
from robot_description.cad.glb import Primitive, glb_bytes
from robot_description.cad.gripper import gripper_link
from robot_description.cad.part import Part
from robot_description.cad.roll import roll_link
from robot_description.cad.shading import CREASE, PAINT_CREASE, shade, weld
from robot_description.cad.shoulder import pan_link
from robot_description.cad.upper_arm import upper_arm_link
from robot_description.cad.wrist import wrist_link

MILLIMETRE = 0.001
MESHES = Path(__file__).resolve().parent.parent / "meshes"
CONDUITS = MESHES.parent / "conduits.json"

PARTS: tuple[Callable[[], Part], ...] = (
    base_link,
    arm_base_link,
    pan_link,
    upper_arm_link,
    forearm_link,
    wrist_link,
    roll_link,
    gripper_link,
    finger_right_link,
    finger_left_link,
)
"""Makers of the parts, from the table to the finger tips, each named like its link."""


@dataclass(frozen=True)
class Built:
    """One written file, with its numbers of materials, triangles and bytes."""

    path: Path
    materials: int
    triangles: int
    size: int


def primitives_of(part: Part) -> list[Primitive]:
    """Return the shaded triangles of ``part`` in metres, one primitive for each material."""
    primitives = []
    for material, solid in part.bodies():
        mesh = solid.to_mesh64()
        positions = np.asarray(mesh.vert_properties, dtype=np.float64)[:, :3] * MILLIMETRE
        triangles = np.asarray(mesh.tri_verts, dtype=np.int64)
        crease = PAINT_CREASE if material.paint else CREASE
        primitives.append(Primitive(material, *shade(*weld(positions, triangles), crease)))
    return primitives


@functools.cache
def parts() -> tuple[Part, ...]:
    """Return the parts of all links, made once; do not change them."""
    return tuple(make() for make in PARTS)


def write_glb(part: Part, folder: Path) -> Built:
    """Write the GLB of ``part`` into ``folder``."""
    primitives = primitives_of(part)
    data = glb_bytes(part.link, primitives)
    path = folder / f"{part.link}.glb"
    path.write_bytes(data)
    triangles = sum(len(primitive.triangles) for primitive in primitives)
    return Built(path, len(primitives), triangles, len(data))


def build(folder: Path = MESHES) -> Iterator[Built]:
    """Write the GLB file of every link into ``folder``, and yield each when it is written."""
    folder.mkdir(parents=True, exist_ok=True)
    for part in parts():
        yield write_glb(part, folder)


def write_conduits(path: Path = CONDUITS) -> None:
    """Write the fittings of the conduit to ``path``, for programs that draw the conduit."""
    path.write_text(conduits_json(), encoding="utf-8")
