"""The surfaces of a robot's shapes: triangles of one material each, smooth over small bends."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from katana450.arm.robot.glb_file import GlbFile
from katana450.arm.robot.visual import Visual, scene_in
from katana450.caching import cached_property
from katana450.maths.geometry.arrays import FloatArray, IntArray, frozen
from katana450.srgb import to_light, to_srgb

Colours = npt.NDArray[np.uint8]
"""(m, 4) sRGB and opacity."""

CREASE = math.radians(40.0)
"""Faces that meet at a larger angle have separate normals."""

ROUGHNESS = 0.6


@dataclass(frozen=True, eq=False)
class Drawn:
    """Triangles with shared vertices.

    Attributes:
        vertices: (n, 3) [m], each with one normal.
        faces: (m, 3) indices of them.
        colours: (n, 4) sRGB and opacity of each vertex; None if the file has no colours.
    """

    vertices: FloatArray
    faces: IntArray
    colours: Colours | None = None


def drawn(vertices: FloatArray, faces: IntArray, colours: Colours | None = None) -> Drawn:
    """Return the triangles with vertices split at creases and between colours.

    Corners of one vertex stay together if smooth edges of one colour connect their faces.
    ``vertices``: (n, 3). ``faces``: (m, 3). ``colours``: (m, 4) of each face.
    """
    normals = np.cross(
        vertices[faces[:, 1]] - vertices[faces[:, 0]], vertices[faces[:, 2]] - vertices[faces[:, 0]]
    )
    lengths = np.linalg.norm(normals, axis=1)
    normals = normals / np.where(lengths > 0.0, lengths, 1.0)[:, None]
    # Half an edge runs from corner 3 f + i to corner 3 f + j of a face.
    start = np.arange(faces.size)
    end = 3 * (start // 3) + (start + 1) % 3
    flat = faces.ravel()
    low, high = np.minimum(flat[start], flat[end]), np.maximum(flat[start], flat[end])
    order = np.lexsort((high, low))
    meets = (low[order[1:]] == low[order[:-1]]) & (high[order[1:]] == high[order[:-1]])
    one, other = order[:-1][meets], order[1:][meets]
    smooth = (normals[one // 3] * normals[other // 3]).sum(axis=1) > math.cos(CREASE)
    if colours is not None:
        smooth &= (colours[one // 3] == colours[other // 3]).all(axis=1)
    one, other = one[smooth], other[smooth]
    # Both half-edges have the same ends, in the same or in the opposite order.
    turned = flat[start[one]] != flat[start[other]]
    first = np.where(turned, end[other], start[other])
    last = np.where(turned, start[other], end[other])
    label = _joined(
        faces.size, np.concatenate((start[one], end[one])), np.concatenate((first, last))
    )
    labels, number = np.unique(label, return_inverse=True)
    return Drawn(
        vertices[flat[labels]],
        number.reshape(-1, 3),
        None if colours is None else colours[labels // 3],
    )


def _joined(count: int, one: IntArray, other: IntArray) -> IntArray:
    """Return for each of ``count`` corners the lowest number in its connected component."""
    label = np.arange(count)
    while True:
        lowest = label.copy()
        np.minimum.at(lowest, one, label[other])
        np.minimum.at(lowest, other, label[one])
        lowest = lowest[lowest]
        if np.array_equal(lowest, label):
            return label
        label = lowest


def glb(shape: Drawn, opacity: float = 1.0) -> bytes:
    """Return a binary glTF file of ``shape`` in its own colours, for viser, with unchanged axes."""
    assert shape.colours is not None
    alpha = shape.colours[:, 3:] / 255.0 * opacity
    # glTF stores vertex colours as linear light.
    linear = to_light(shape.colours[:, :3] / 255.0)
    file = GlbFile()
    attributes = {
        "POSITION": file.add(shape.vertices),
        "NORMAL": file.add(smooth_normals(shape.vertices, shape.faces)),
        "COLOR_0": file.add(np.concatenate((linear, alpha), axis=1)),
    }
    indices = file.add(shape.faces.reshape(-1, 1))
    material = {
        "pbrMetallicRoughness": {"metallicFactor": 0.0, "roughnessFactor": ROUGHNESS},
        "alphaMode": "BLEND" if alpha.min() < 1.0 else "OPAQUE",
        "doubleSided": True,
    }
    primitive = {"attributes": attributes, "indices": indices, "material": 0}
    return file.content(
        scenes=[{"nodes": [0]}],
        nodes=[{"mesh": 0}],
        meshes=[{"primitives": [primitive]}],
        materials=[material],
    )


def smooth_normals(vertices: FloatArray, faces: IntArray) -> FloatArray:
    """Return normals (n, 3) of ``vertices`` (n, 3), weighted by the angles of their faces (m, 3).

    Source: G. Thürmer and C. A. Wüthrich, Computing Vertex Normals from Polygonal Facets, 1998.
    """
    corners = vertices[faces]
    sides = _unit(np.roll(corners, -1, axis=1) - corners)
    cosines = -np.einsum("mij,mij->mi", sides, np.roll(sides, 1, axis=1))
    angles = np.arccos(np.clip(cosines, -1.0, 1.0))
    across = _unit(np.cross(sides[:, 0], sides[:, 1]))
    sums = np.zeros(vertices.shape)
    np.add.at(sums, faces, angles[:, :, None] * across[:, None])
    normals = _unit(sums)
    return np.where(normals.any(axis=1, keepdims=True), normals, (0.0, 0.0, 1.0))


def _unit(v: FloatArray) -> FloatArray:
    """Return vectors (..., 3) of length 1; zero vectors stay 0."""
    length = np.linalg.norm(v, axis=-1, keepdims=True)
    unit: FloatArray = np.divide(v, length, out=np.zeros(v.shape), where=length > 0.0)
    return unit


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
    def corners(self) -> FloatArray:
        """(8, 3) corners of the bounding box [m]."""
        ends = (self.vertices.min(axis=0), self.vertices.max(axis=0))
        return np.array(list(itertools.product(*np.transpose(ends).tolist())))


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
