"""The surfaces of a robot's shapes: triangles of one material each."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from katana450.arm.robot.creases import drawn, smooth_normals
from katana450.arm.robot.visual import Visual, scene_in
from katana450.caching import cached_property
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.srgb import to_srgb


class Material(NamedTuple):
    """Optical properties: sRGB colour 0..1, and the glTF factors metallic and rough 0..1."""

    name: str
    colour: tuple[float, float, float]
    metallic: float = 0.0
    rough: float = 0.6

    @property
    def gleam(self) -> float:
        """Grey value 0..1 of the highlight, for formats without metal; largest for smooth metal."""
        return (1.0 - self.rough) * (0.3 + 0.5 * self.metallic)


@dataclass(frozen=True, eq=False)
class VisualMesh:
    """Triangles of one material.

    Attributes:
        material: of all triangles.
        vertices, normals: (n, 3), [m] and of unit length, in the frame of their link.
        faces: (m, 3) indices of both, counter-clockwise seen from outside.
    """

    material: Material
    vertices: FloatArray
    normals: FloatArray
    faces: npt.NDArray[np.int64]

    @cached_property
    def area(self) -> float:
        """Area of all triangles [m^2]."""
        a, b, c = np.moveaxis(self.vertices[self.faces], 1, 0)
        return 0.5 * float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum())

    @cached_property
    def corners(self) -> FloatArray:
        """(8, 3) corners of the bounding box [m]."""
        ends = (self.vertices.min(axis=0), self.vertices.max(axis=0))
        return np.array(list(itertools.product(*np.transpose(ends).tolist())))


PLAIN = (0.8, 0.8, 0.8)
"""Default colour of VRML."""


def main_colour(shapes: Sequence[VisualMesh]) -> tuple[float, float, float]:
    """Return the colour (sRGB, 0..1) of the largest part of the surface; PLAIN without shapes."""
    areas: dict[Material, float] = {}
    for shape in shapes:
        areas[shape.material] = areas.get(shape.material, 0.0) + shape.area
    return max(areas, key=areas.__getitem__).colour if areas else PLAIN


def shapes_of(visual: Visual) -> Sequence[VisualMesh]:
    """Return the surfaces of ``visual``, one per material, in the frame of its link.

    Raises RobotDescriptionError for a mesh file that cannot be read.
    """
    return visual.kept(lambda: _read(visual), list[VisualMesh])


def _read(visual: Visual) -> list[VisualMesh]:
    plain = Material(
        "plain {:02x}{:02x}{:02x}".format(*visual.colour),
        (visual.colour[0] / 255.0, visual.colour[1] / 255.0, visual.colour[2] / 255.0),
    )
    if visual.file is None:
        return [_shape(visual.mesh, np.eye(4), plain)]
    import trimesh

    T = visual.T_body_visual @ np.diag([*visual.scale, 1.0])
    scene, shapes = scene_in(visual.file), []
    for node in scene.graph.nodes_geometry:
        T_file, name = scene.graph[node]
        mesh = scene.geometry[name]
        if isinstance(mesh, trimesh.Trimesh) and len(mesh.faces):
            shapes.append(_shape(mesh, T @ T_file, _material(mesh, plain)))
    return shapes


def _shape(mesh: Any, T: FloatArray, material: Material) -> VisualMesh:
    """Return ``mesh`` moved by ``T``, with its own normals or those of its creases."""
    vertices = np.asarray(mesh.vertices)
    faces = np.asarray(mesh.faces, dtype=np.int64)
    # Those that trimesh would compute need SciPy, and are smooth over each edge.
    if "vertex_normals" in mesh._cache:
        normals = np.asarray(mesh.vertex_normals)
    else:
        split = drawn(vertices, faces)
        vertices, faces = split.vertices, split.faces
        normals = smooth_normals(vertices, faces)
    A = T[:3, :3]
    normals = normals @ np.linalg.inv(A)
    size = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = np.where(size > 0.0, normals / np.where(size > 0.0, size, 1.0), (0.0, 0.0, 1.0))
    # Mirroring turns the faces inside out.
    faces = faces[:, ::-1] if np.linalg.det(A) < 0.0 else faces
    vertices = vertices @ A.T + T[:3, 3]
    return VisualMesh(material, frozen(vertices), frozen(normals), faces)


def _material(mesh: Any, plain: Material) -> Material:
    material = getattr(mesh.visual, "material", None)
    if material is None:
        return plain
    factor = getattr(material, "baseColorFactor", None)
    if factor is None:
        red, green, blue = (float(part) / 255.0 for part in material.main_color[:3])
        return Material(str(material.name or plain.name), (red, green, blue))
    red, green, blue = to_srgb(np.asarray(factor)[:3] / 255.0).tolist()
    metallic, rough = (
        default if value is None else float(value)
        for value, default in ((material.metallicFactor, 1.0), (material.roughnessFactor, 1.0))
    )
    return Material(str(material.name or plain.name), (red, green, blue), metallic, rough)
