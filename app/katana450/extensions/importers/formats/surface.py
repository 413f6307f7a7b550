"""Triangle surfaces as all readers produce them, from polygons."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt
from manifold3d import triangulate

from katana450.arm.robot.surfaces import Colours
from katana450.errors import InputError
from katana450.maths.geometry.arrays import FloatArray, IntArray


def cut(vertices: FloatArray, corners: IntArray, sizes: IntArray) -> tuple[IntArray, IntArray]:
    """Return triangles (m, 3) as places in ``corners``, and the polygon (m,) of each.

    Args:
        vertices: (n, 3), finite.
        corners: (k,) indices of vertices, polygon after polygon.
        sizes: (p,) number of corners of each polygon.

    A polygon of k corners gives k - 2 triangles with its own orientation. A polygon that crosses
    itself gives as many, of arbitrary shape. The effort for a concave polygon grows at most with
    the square of its number of corners.
    """
    starts = np.cumsum(sizes) - sizes
    triangles, owners = [np.zeros((0, 3), dtype=np.int64)], [np.zeros(0, dtype=np.int64)]
    for size in np.unique(sizes[sizes >= 3]).tolist():
        polygons = np.flatnonzero(sizes == size)
        places = starts[polygons][:, None] + np.arange(size)
        fan = np.column_stack((np.zeros(size - 2), np.arange(1, size - 1), np.arange(2, size)))
        local = np.broadcast_to(fan.astype(np.int64), (len(polygons), size - 2, 3)).copy()
        if size > 3:
            points = vertices[corners[places]]
            for number in np.flatnonzero(_concave(points)).tolist():
                local[number] = _triangles(points[number])
        triangles.append(np.take_along_axis(places[:, None, :], local, axis=2).reshape(-1, 3))
        owners.append(np.repeat(polygons, size - 2))
    owner = np.concatenate(owners)
    order = np.argsort(owner, kind="stable")
    return np.concatenate(triangles)[order], owner[order]


def _normals(points: FloatArray) -> FloatArray:
    """Return normals (p, 3) of polygons (p, k, 3), of any length, by Newell's sum."""
    following = np.roll(points, -1, axis=1)
    return np.asarray(np.cross(points, following).sum(axis=1))


def _concave(points: FloatArray) -> IntArray:
    """Return for each polygon of (p, k, 3) whether it has a concave corner, (p,)."""
    points = points - points[:, :1]
    before, following = np.roll(points, 1, axis=1), np.roll(points, -1, axis=1)
    turns = np.einsum("pkc,pc->pk", np.cross(points - before, following - points), _normals(points))
    scale = np.abs(turns).max(axis=1, keepdims=True)
    return np.asarray((turns < -1e-9 * scale).any(axis=1))


def _triangles(points: FloatArray) -> IntArray:
    """Return the triangles (k - 2, 3) of one polygon (k, 3), as numbers of its corners."""
    points = points - points[0]
    normal = _normals(points[None])[0]
    axis = int(np.argmax(np.abs(normal)))
    flat = np.delete(points, axis, axis=1)
    if (normal[axis] < 0.0) != (axis == 1):
        flat = flat[:, ::-1]
    return np.asarray(triangulate([flat]), dtype=np.int64)


GREY = (204, 204, 204, 255)
"""Colour (RGBA bytes) of uncoloured parts beside coloured ones: the default of VRML97."""

MAX_TRIANGLES = 500_000
"""Maximum number of triangles of a file."""

MAX_COPIES = 40_000
"""Maximum number of nodes of a scene, each counted as often as it is used."""


@dataclass(frozen=True, eq=False)
class MeshSurface:
    """A surface of triangles.

    Attributes:
        vertices: (n, 3).
        faces: (m, 3) indices of vertices, counter-clockwise seen from outside.
        colours: (m, 4) sRGB and opacity of the faces; None if the file has none.
    """

    vertices: FloatArray
    faces: IntArray
    colours: Colours | None = None

    def moved(self, T: FloatArray) -> MeshSurface:
        """Return it under the affine map ``T`` (4, 4); a mirrored surface keeps its outside."""
        with np.errstate(over="ignore", invalid="ignore"):
            vertices = self.vertices @ T[:3, :3].T + T[:3, 3]
            mirrored = float(np.linalg.det(T[:3, :3])) < 0.0
        faces = self.faces[:, ::-1] if mirrored else self.faces
        return replace(self, vertices=vertices, faces=faces)

    def painted(self, colour: Sequence[float] | None) -> MeshSurface:
        """Return it in one colour (4,) 0..1, unless it has colours of its own."""
        if colour is None or self.colours is not None:
            return self
        return replace(self, colours=np.tile(as_bytes([colour]), (len(self.faces), 1)))

    def tidy(self) -> MeshSurface:
        """Return its faces without degenerate ones, with equal vertices merged."""
        rows, faces = _used(self.vertices, self.faces)
        # Adding zero turns -0 into 0.
        rows = rows + 0.0
        order = np.lexsort(rows.T)
        first = np.ones(len(rows), dtype=bool)
        first[1:] = (np.diff(rows[order], axis=0) != 0.0).any(axis=1)
        number = np.empty(len(rows), dtype=np.int64)
        number[order] = np.cumsum(first) - 1
        faces = number[faces]
        a, b, c = faces.T
        whole = (a != b) & (b != c) & (c != a)
        vertices, faces = _used(rows[order][first], faces[whole])
        return MeshSurface(vertices, faces, None if self.colours is None else self.colours[whole])


NOTHING = MeshSurface(np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64))
"""The surface of a part without vertices or size."""


def _used(vertices: FloatArray, faces: IntArray) -> tuple[FloatArray, IntArray]:
    """Return the vertices that ``faces`` use, and ``faces`` with the new indices."""
    used = np.zeros(len(vertices), dtype=bool)
    used[faces] = True
    return vertices[used], (np.cumsum(used) - 1)[faces]


@dataclass(frozen=True, eq=False)
class MeshReading:
    """The result of a reader, in the units and axes of the file.

    Attributes:
        surface: the surface.
        left_out: names of the parts that were not read.
        unit: unit [m], if the file gives it.
    """

    surface: MeshSurface
    left_out: tuple[str, ...] = ()
    unit: float | None = None


class MeshBuilder:
    """A builder that joins surfaces to one, within the maximum number of triangles."""

    def __init__(self, name: str) -> None:
        """Start without surfaces. ``name`` is the name of the file for messages."""
        self._name = name
        self._parts: list[MeshSurface] = []
        self._triangles = 0

    def add(self, part: MeshSurface) -> None:
        """Add ``part``. Raises InputError for too many triangles or non-finite coordinates."""
        self._triangles += len(part.faces)
        check_triangles(self._triangles, self._name)
        check_finite(part.vertices, self._name)
        self._parts.append(part)

    def surface(self) -> MeshSurface:
        """Return all parts as one surface, with colours if any part has them."""
        coloured = any(part.colours is not None for part in self._parts)
        offsets = np.cumsum([0, *(len(part.vertices) for part in self._parts)])
        paint = [value / 255.0 for value in GREY]
        parts = [part.painted(paint if coloured else None) for part in self._parts]
        return MeshSurface(
            np.concatenate([np.zeros((0, 3)), *(part.vertices for part in parts)]),
            np.concatenate(
                [np.zeros((0, 3), dtype=np.int64)]
                + [part.faces + offset for part, offset in zip(parts, offsets, strict=False)]
            ),
            np.concatenate([part.colours for part in parts if part.colours is not None])
            if coloured
            else None,
        )


def check_triangles(count: int, name: str) -> None:
    """Raise InputError if ``count`` exceeds MAX_TRIANGLES."""
    if count > MAX_TRIANGLES:
        raise InputError(
            f"{name} has more than {MAX_TRIANGLES} triangles, the maximum. "
            "Save it coarser, or in parts."
        )


def of_polygons(
    vertices: FloatArray,
    corners: IntArray,
    sizes: IntArray,
    name: str,
    colours: Colours | None = None,
    corner_colours: FloatArray | None = None,
    vertex_colours: FloatArray | None = None,
) -> MeshSurface:
    """Return the surface of polygons, which may be concave.

    Args:
        vertices: (n, 3).
        corners: (k,) indices of vertices, polygon after polygon.
        sizes: (p,) number of corners of each polygon; polygons of fewer than three are left out.
        name: name of the file for messages.
        colours: (p, 4) bytes of each polygon.
        corner_colours: (k, 4) 0..1 of each corner; a triangle gets the mean of its three.
        vertex_colours: (n, 4) 0..1 of each vertex; a triangle gets the mean of its three.

    Raises InputError for indices without a vertex, coordinates that are not finite, and too many
    triangles.
    """
    check_triangles(int(np.maximum(sizes - 2, 0).sum()), name)
    wrong = (corners < 0) | (corners >= len(vertices))
    if wrong.any():
        raise InputError(
            f"{name} has a face with vertex {int(corners[wrong][0])}, counted from 0, "
            f"but only {len(vertices)} vertices."
        )
    check_finite(vertices[corners], name)
    triangles, polygon = cut(vertices, corners, sizes)
    if vertex_colours is not None:
        colours = as_bytes(vertex_colours[corners[triangles]].mean(axis=1))
    elif corner_colours is not None:
        colours = as_bytes(corner_colours[triangles].mean(axis=1))
    elif colours is not None:
        colours = colours[polygon]
    return MeshSurface(vertices, corners[triangles], colours)


def doubles(values: npt.NDArray[Any]) -> FloatArray:
    """Return ``values`` in double precision, without a warning for NaN."""
    with np.errstate(invalid="ignore"):
        return values.astype(np.float64)


def check_finite(vertices: FloatArray, name: str) -> None:
    """Raise InputError for NaN, infinity, and magnitudes from 1e30."""
    if not (np.abs(vertices) < 1e30).all():
        raise InputError(f"{name} has coordinates that are not finite numbers.")


def as_bytes(colours: Iterable[Sequence[float]] | FloatArray) -> Colours:
    """Return colours 0..1 as bytes (m, 4); values outside are clipped."""
    rows = np.nan_to_num(np.asarray(colours, dtype=np.float64))
    return np.rint(np.clip(rows, 0.0, 1.0) * 255.0).astype(np.uint8).reshape(-1, 4)


@contextmanager
def failures_in_words(name: str) -> Iterator[None]:
    """Raise InputError about the file ``name`` for any exception of a library in the block."""
    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            # Older numpy only warns about text that is not a number.
            warnings.filterwarnings("error", message="string or file could not be read")
            yield
    except (InputError, MemoryError, RecursionError):
        raise
    except (IndexError, KeyError, StopIteration) as error:
        raise InputError(f"{name} is corrupt: it refers to a part that is missing.") from error
    except Exception as error:
        reason = " ".join(str(error).split())[:120].rstrip(".")
        raise InputError(f"{name} is corrupt: {reason or type(error).__name__}.") from error
