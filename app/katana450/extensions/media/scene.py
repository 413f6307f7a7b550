"""The triangles of a picture in one frame, with their items and materials."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from katana450.arm.robot.surfaces import VisualMesh
from katana450.caching import cached_property
from katana450.maths.geometry.arrays import FloatArray
from katana450.srgb import to_light

Floats = npt.NDArray[np.float32]
Ints = npt.NDArray[np.int32]
Bools = npt.NDArray[np.bool_]


class Item(NamedTuple):
    """A shape in the scene.

    Attributes:
        name: name of the link or object.
        shape: the mesh.
        T: (4, 4) pose of the mesh in the base frame [m].
    """

    name: str
    shape: VisualMesh
    T: FloatArray


@dataclass(frozen=True, eq=False)
class RenderScene:
    """All triangles of a scene.

    Attributes:
        names: name of each item.
        vertices: (v, 3) in the base frame [m].
        normals: (v, 3) unit normals.
        faces: (f, 3) corners, counter-clockwise seen from outside.
        item: (f,) item of each triangle.
        colour: (i, 3) linear colour of each item.
    """

    names: tuple[str, ...]
    vertices: Floats
    normals: Floats
    faces: Ints
    item: Ints
    colour: Floats

    @classmethod
    def of(cls, items: Sequence[Item]) -> RenderScene:
        """Return the scene of ``items``."""
        shapes = [item.shape for item in items]
        starts = np.cumsum([0, *(len(shape.vertices) for shape in shapes)])
        turned = [(item.shape, item.T[:3, :3].T, item.T[:3, 3]) for item in items]
        materials = [shape.material for shape in shapes]
        return cls(
            tuple(item.name for item in items),
            _stacked([shape.vertices @ R + p for shape, R, p in turned], np.float32),
            _stacked([shape.normals @ R for shape, R, _ in turned], np.float32),
            _stacked([s.faces + at for s, at in zip(shapes, starts[:-1], strict=True)], np.int32),
            np.repeat(np.arange(len(shapes)), [len(shape.faces) for shape in shapes]).astype("i4"),
            _stacked([[to_light(material.colour) for material in materials]], np.float32),
        )

    @cached_property
    def flat(self) -> Floats:
        """The unit normals (f, 3) of the triangles; 0 for a triangle without area."""
        a, b, c = (self.vertices[self.faces[:, corner]] for corner in range(3))
        return unit(np.cross(b - a, c - a))


def unit(v: npt.NDArray[Any]) -> Floats:
    """Return vectors (..., 3) scaled to length 1; zero vectors stay 0."""
    length = np.sqrt(np.einsum("...i,...i->...", v, v))[..., None]
    found = np.divide(v, length, out=np.zeros_like(v), where=length > 0.0)
    return np.asarray(found, dtype=np.float32)


def _stacked(parts: Sequence[Any], kind: Any) -> npt.NDArray[Any]:
    if not parts or not len(parts[0]):
        return np.empty((0, 3), dtype=kind)
    return np.concatenate(parts).astype(kind)
