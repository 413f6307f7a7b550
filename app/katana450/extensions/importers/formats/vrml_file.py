"""VRML worlds of other programs, flattened to one surface.

Source: ISO/IEC 14772-1:1997, 6.6 Box, 6.9 Cone, 6.12 Cylinder, 6.18 Extrusion,
6.23 IndexedFaceSet, 6.42 Sphere. Nodes that are not read are left out and reported. A world shows
other worlds of the same upload, and no script is executed.
"""

from __future__ import annotations

import posixpath
import re
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from itertools import pairwise

import numpy as np

from katana450.errors import InputError
from katana450.extensions.export.vrml.vrml_world import HEADER, Node, Value
from katana450.extensions.importers.archive import Companions
from katana450.extensions.importers.formats.surface import (
    MAX_COPIES,
    NOTHING,
    MeshBuilder,
    MeshReading,
    MeshSurface,
    check_triangles,
    of_polygons,
)
from katana450.extensions.importers.formats.vrml_reader import Reader
from katana450.maths.geometry import so3
from katana450.maths.geometry.arrays import FloatArray, IntArray

ROUND = 32
"""Number of sides that approximate a circle."""

LENGTHS = {
    "Box": ("size",),
    "Cone": ("bottomRadius", "height"),
    "Cylinder": ("radius", "height"),
    "Sphere": ("radius",),
}
"""Fields of a solid that must not be negative."""


class FieldError(Exception):
    """A field has a value of a wrong type, as a clause."""


def rows(node: Node, field: str, width: int = 1, default: Sequence[float] = ()) -> FloatArray:
    """Return a field of numbers as (k, width). Raises FieldError."""
    value = node.get(field)
    numbers = np.array(default if value is None else value).ravel()
    if numbers.size and numbers.dtype.kind not in "fi":
        raise FieldError(f"{node.kind}.{field} must be numbers")
    if numbers.size % width:
        raise FieldError(
            f"the {numbers.size} numbers of {node.kind}.{field} are no rows of {width}"
        )
    return numbers.astype(np.float64).reshape(-1, width)


def vector(node: Node, field: str, default: Sequence[float]) -> FloatArray:
    """Return a field of as many numbers as ``default`` has, (n,). Raises FieldError."""
    numbers = rows(node, field, 1, default)[:, 0]
    if len(numbers) != len(default):
        raise FieldError(f"{node.kind}.{field} has {len(numbers)} numbers, not {len(default)}")
    return numbers


def number(node: Node, field: str, default: float) -> float:
    """Return a field of one number. Raises FieldError."""
    return float(vector(node, field, (default,))[0])


def indices(node: Node, field: str) -> IntArray:
    """Return a field of whole numbers (k,). Raises FieldError."""
    numbers = rows(node, field)[:, 0]
    if not (np.abs(numbers) < 2.0**53).all() or (numbers % 1.0).any():
        raise FieldError(f"{node.kind}.{field} must be whole numbers")
    return numbers.astype(np.int64)


def flag(node: Node, field: str) -> bool:
    """Return a Boolean field, which is TRUE by default. Raises FieldError."""
    value = node.get(field)
    if not isinstance(value, bool | None):
        raise FieldError(f"{node.kind}.{field} must be TRUE or FALSE")
    return value is not False


def part(node: Node, field: str) -> Node | None:
    """Return the node in a field; None if there is none. Raises FieldError."""
    value = node.get(field)
    if not isinstance(value, Node | None):
        raise FieldError(f"{node.kind}.{field} must be a node")
    return None if value is None or value.kind == "NULL" else value


def texts(value: Value | None) -> tuple[str, ...]:
    """Return the texts of a field."""
    items = value if isinstance(value, list) else (value,)
    return tuple(item for item in items if isinstance(item, str))


def _box(node: Node, name: str, _left_out: Counter[str]) -> MeshSurface:
    half = vector(node, "size", (2.0, 2.0, 2.0)) / 2.0
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    sides = [0, 1, 3, 2, 4, 6, 7, 5, 0, 4, 5, 1, 2, 3, 7, 6, 0, 2, 6, 4, 1, 5, 7, 3]
    return of_polygons(signs * half, np.array(sides), np.full(6, 4), name)


def _cone(node: Node, name: str, _left_out: Counter[str]) -> MeshSurface:
    radius, height = number(node, "bottomRadius", 1.0), number(node, "height", 2.0)
    low, tip = (radius, -height / 2.0), (0.0, height / 2.0)
    bottom, side = flag(node, "bottom"), flag(node, "side")
    return _turned([((0.0, low[1]), low)] * bottom + [(low, tip)] * side, name)


def _cylinder(node: Node, name: str, _left_out: Counter[str]) -> MeshSurface:
    radius, height = number(node, "radius", 1.0), number(node, "height", 2.0)
    low, high = (radius, -height / 2.0), (radius, height / 2.0)
    segments = [((0.0, low[1]), low)] * flag(node, "bottom")
    segments += [(low, high)] * flag(node, "side")
    segments += [(high, (0.0, high[1]))] * flag(node, "top")
    return _turned(segments, name)


def _sphere(node: Node, name: str, _left_out: Counter[str]) -> MeshSurface:
    radius = number(node, "radius", 1.0)
    angles = np.linspace(-np.pi / 2.0, np.pi / 2.0, ROUND // 2 + 1)
    profile = np.column_stack((np.cos(angles), np.sin(angles))) * radius
    profile[[0, -1], 0] = 0.0
    return _turned(pairwise(map(tuple, profile.tolist())), name)


def _turned(segments: Iterable[tuple[Sequence[float], Sequence[float]]], name: str) -> MeshSurface:
    """Return the surface of segments, each of two points (radius, y) upwards, turned about y."""
    turn = np.arange(ROUND) * (2.0 * np.pi / ROUND)
    ring = np.column_stack((np.sin(turn), np.zeros(ROUND), np.cos(turn)))
    rings = [radius * ring + (0.0, y, 0.0) for segment in segments for radius, y in segment]
    corner, next_corner = np.arange(ROUND), np.roll(np.arange(ROUND), -1)
    quads = np.column_stack((corner, next_corner, ROUND + next_corner, ROUND + corner)).ravel()
    corners = quads + 2 * ROUND * np.arange(len(rings) // 2)[:, None]
    points = np.concatenate([np.zeros((0, 3)), *rings])
    # At the axis, two corners are one.
    return of_polygons(points, corners.ravel(), np.full(corners.size // 4, 4), name).tidy()


def _face_set(node: Node, name: str, left_out: Counter[str]) -> MeshSurface:
    coord, table = part(node, "coord"), colour_table(node)
    has_points = coord is not None and coord.kind == "Coordinate"
    points = rows(coord, "point", 3) if coord is not None and has_points else np.zeros((0, 3))
    index = indices(node, "coordIndex")
    corners, sizes = split(index)
    face_colours = corner_colours = None
    if table is not None:
        chosen = indices(node, "colorIndex")
        if flag(node, "colorPerVertex"):
            places, their_sizes = split(chosen) if len(chosen) else (corners, sizes)
            fits = np.array_equal(sizes, their_sizes)
            corner_colours = chosen_colours(table, places, fits, left_out)
        else:
            places = chosen if len(chosen) else np.arange(len(sizes))
            fits = len(places) >= len(sizes)
            face_colours = chosen_colours(table, places[: len(sizes)], fits, left_out)
    if face_colours is not None:
        corner_colours = np.repeat(face_colours, sizes, axis=0)
    surface = of_polygons(points, corners, sizes, name, corner_colours=corner_colours)
    return _facing(surface, not flag(node, "ccw"))


def colour_table(node: Node) -> FloatArray | None:
    """Return the colours (c, 3) of a geometry; None if it has none."""
    color = part(node, "color")
    if color is None or color.kind != "Color":
        return None
    return rows(color, "color", 3)


def split(index: IntArray) -> tuple[IntArray, IntArray]:
    """Return corners (k,) and sizes (p,) of the polygons in a list with -1 between them."""
    ends = np.flatnonzero(np.append(index, -1) < 0)
    sizes = np.diff(ends, prepend=-1) - 1
    # The last polygon needs no -1.
    return index[index >= 0], sizes if len(index) == 0 or index[-1] >= 0 else sizes[:-1]


def chosen_colours(
    table: FloatArray, places: IntArray, fits: bool, left_out: Counter[str]
) -> FloatArray | None:
    """Return the colours (k, 4) at ``places`` of ``table`` (c, 3); None if they do not match."""
    if not fits or (places < 0).any() or (places >= len(table)).any():
        left_out["colours that do not match the faces"] += 1
        return None
    return np.column_stack((table[places], np.ones(len(places))))


def _facing(surface: MeshSurface, turned: bool) -> MeshSurface:
    if not turned:
        return surface
    return MeshSurface(surface.vertices, surface.faces[:, ::-1], surface.colours)


def _extrusion(node: Node, name: str, left_out: Counter[str]) -> MeshSurface:
    square = (1.0, 1.0, 1.0, -1.0, -1.0, -1.0, -1.0, 1.0, 1.0, 1.0)
    section = rows(node, "crossSection", 2, square)
    spine = rows(node, "spine", 3, (0.0, 0.0, 0.0, 0.0, 1.0, 0.0))
    scale = rows(node, "scale", 2, (1.0, 1.0))
    turns = rows(node, "orientation", 4, (0.0, 0.0, 1.0, 0.0))
    count, length = len(section), len(spine)
    if count < 2 or length < 2 or not len(scale) or not len(turns):
        left_out["Extrusion with too few points"] += 1
        return NOTHING
    check_triangles(2 * (count - 1) * (length - 1), name)
    frames = _frames(spine)
    points = np.empty((length, count, 3))
    for row in range(length):
        x, y, z, angle = turns[min(row, len(turns) - 1)]
        flat = section * scale[min(row, len(scale) - 1)]
        placed = np.column_stack((flat[:, 0], np.zeros(count), flat[:, 1]))
        R = frames[row] @ so3.exp(angle * unit(np.array((x, y, z))))
        points[row] = placed @ R.T + spine[row]
    first = (np.arange(length - 1)[:, None] * count + np.arange(count - 1)).ravel()
    quads = np.column_stack((first, first + 1, first + count + 1, first + count))
    corners, sizes = [quads.ravel()], [np.full(len(first), 4)]
    # The last corner of a closed section repeats the first.
    closed = bool((section[0] == section[-1]).all())
    cap = np.arange(count - closed)
    for wanted, polygon in (
        (flag(node, "beginCap"), cap[::-1]),
        (flag(node, "endCap"), (length - 1) * count + cap),
    ):
        if wanted and len(polygon) > 2:
            corners.append(polygon)
            sizes.append(np.array([len(polygon)]))
    surface = of_polygons(
        points.reshape(-1, 3), np.concatenate(corners), np.concatenate(sizes), name
    )
    return _facing(surface, not flag(node, "ccw"))


def _frames(spine: FloatArray) -> list[FloatArray]:
    """Return the section's frame (3, 3) at each point of a spine, as in 6.18.

    y is along the spine and z out of its bend. A point without a bend has the frame of the point
    before.
    """
    closed = bool((spine[0] == spine[-1]).all())
    following, behind = np.roll(spine, -1, axis=0), np.roll(spine, 1, axis=0)
    if closed:
        following[-1], behind[0] = spine[1], spine[-2]
    else:
        following[-1], behind[0] = spine[-1], spine[0]
    along = [unit(row) for row in following - behind]
    bends = [unit(row) for row in np.cross(following - spine, behind - spine)]
    if not closed:
        bends[0], bends[-1] = bends[min(1, len(bends) - 1)], bends[max(len(bends) - 2, 0)]
    frames: list[FloatArray] = []
    y = next((row for row in along if row.any()), np.array((0.0, 1.0, 0.0)))
    z = next((row for row in bends if row.any()), None)
    if z is None:
        z = _least_turn(y)[:, 2]
    for direction, bend in zip(along, bends, strict=True):
        y = direction if direction.any() else y
        z = bend if bend.any() else z
        # A bend in the opposite direction would flip the section.
        if frames and float(z @ frames[-1][:, 2]) < 0.0:
            z = -z
        x = unit(np.cross(y, z))
        frames.append(np.column_stack((x, y, np.cross(x, y))))
    return frames


def _least_turn(y: FloatArray) -> FloatArray:
    """Return the smallest rotation (3, 3) that takes the y axis to the unit vector ``y``."""
    axis = np.cross((0.0, 1.0, 0.0), y)
    sine, cosine = float(np.linalg.norm(axis)), float(y[1])
    direction = axis / sine if sine > 0.0 else np.array((0.0, 0.0, 1.0))
    return so3.exp(direction * float(np.arctan2(sine, cosine)))


def unit(v: FloatArray) -> FloatArray:
    """Return ``v`` scaled to length 1; a zero vector stays 0."""
    size = float(np.abs(v).max())
    if not size > 0.0:
        return np.zeros_like(v)
    v = v / size
    return np.asarray(v / np.linalg.norm(v))


SOLIDS: dict[str, Callable[[Node, str, Counter[str]], MeshSurface]] = {
    "Box": _box,
    "Cone": _cone,
    "Cylinder": _cylinder,
    "Sphere": _sphere,
    "IndexedFaceSet": _face_set,
    "Extrusion": _extrusion,
}
"""The function that builds the surface, by the kind of a node."""


def surface_of(node: Node, name: str, left_out: Counter[str]) -> MeshSurface | None:
    """Return the surface of a geometry node; None for an unknown kind.

    ``name`` is the name of the file; ``left_out`` counts what contradicts the rest.
    """
    if node.kind not in SOLIDS:
        return None
    if any((rows(node, field) < 0.0).any() for field in LENGTHS.get(node.kind, ())):
        left_out[f"{node.kind} without a size"] += 1
        return NOTHING
    return SOLIDS[node.kind](node, name, left_out)


GZIP = b"\x1f\x8b"
"""First bytes of a gzip file."""

OTHER_WORLDS = re.compile(r"\s*<|#VRML V1\.0|#X3D")
"""Beginning of X3D in XML, of VRML 1.0, and of X3D in the encoding of VRML97."""

SUFFIX = ".wrl"
"""Suffix of worlds."""

GROUPS = ("Group", "Anchor", "Billboard", "Collision")
"""Kinds of groups whose children are all shown at their place."""

NO_SURFACE = re.compile(
    "NULL|Viewpoint|Background|Fog|Sound|Script|.*(Info|Light|Sensor|Interpolator)"
)
"""Kinds of nodes that show nothing by themselves, and are not reported as left out."""

PICTURES = "pictures on the surface"
"""Name of what a texture shows, in messages."""

Shown = Callable[[tuple[str, ...]], MeshSurface | None]
"""A function that returns the surface of the first of several addresses that is there."""


def read_wrl(data: bytes, name: str, companions: Companions) -> MeshReading:
    """Return all surfaces that are shown at first, in the world frame with y up.

    Raises InputError with the line of an error.
    """
    worlds = _Worlds(name, companions)
    return MeshReading(worlds.read(data, ""), tuple(worlds.left_out))


class _Worlds:
    """The worlds of one upload: each is read once, with the worlds that it shows."""

    def __init__(self, name: str, companions: Companions) -> None:
        self._name, self._companions = name, companions
        self.left_out: Counter[str] = Counter()
        self._surfaces: dict[str, MeshSurface] = {}
        self._open: list[str] = []

    def read(self, data: bytes, path: str) -> MeshSurface:
        """Return the surface of the world at ``path`` of the upload; empty for the first file."""
        name = path or self._name
        reader = Reader(self._text(data, name), name)
        self._open.append(path)
        try:
            world = tuple(node for node in reader.nodes() if isinstance(node, Node))
            return _Flattening(name, self.left_out, self._shown).surface(world)
        except FieldError as error:
            raise InputError(f"{name} is corrupt: {error}.") from error
        finally:
            self._open.pop()

    def _shown(self, urls: tuple[str, ...]) -> MeshSurface | None:
        """Return the surface of the first world of ``urls`` that is there; else None."""
        companion = self._companions.find((url.partition("#")[0] for url in urls), self._open[-1])
        if companion is None:
            return None
        path, data = companion
        if path in self._open:
            self.left_out["worlds that show themselves"] += 1
            return None
        if not path.lower().endswith(SUFFIX):
            self.left_out[f"{posixpath.basename(path)}, which is not VRML"] += 1
            return None
        if path not in self._surfaces:
            self._surfaces[path] = self.read(data, path)
        return self._surfaces[path]

    def _text(self, data: bytes, name: str) -> str:
        if data.startswith(GZIP):
            raise InputError(f"{name} is compressed by gzip. Unpack it, or export it as GLB.")
        text = data.decode("utf-8", "replace").removeprefix("\ufeff")
        if OTHER_WORLDS.match(text):
            raise InputError(
                f"{name} is VRML 1.0 or X3D, which is not read. Export it as VRML97 or GLB."
            )
        if not text.startswith("#VRML V2.0"):
            raise InputError(f"{name} is not VRML: it must begin with {HEADER!r}.")
        return text


class _Flattening:
    """A traversal of the visible nodes of the file ``name``, with the pose of each.

    ``left_out`` counts the parts that are not read. ``shown`` returns the surface of another world.
    """

    def __init__(self, name: str, left_out: Counter[str], shown: Shown) -> None:
        self._name, self._left_out, self._shown_file = name, left_out, shown
        self._builder = MeshBuilder(name)
        self._surfaces: dict[int, MeshSurface | None] = {}
        self._visits = 0

    def surface(self, world: tuple[Node, ...]) -> MeshSurface:
        """Return the surface of all nodes of a file. Raises InputError or FieldError."""
        # Without recursion, because reused nodes can be nested deeper than the text.
        waiting = [(node, np.eye(4)) for node in reversed(world)]
        while waiting:
            node, T = waiting.pop()
            self._visits += 1
            if self._visits > MAX_COPIES:
                raise InputError(
                    f"{self._name} shows more than {MAX_COPIES} nodes, each counted as often as "
                    "it is used."
                )
            if node.kind == "Shape":
                self._shape(node, T)
            if node.kind == "Inline":
                surface = self._shown_file(texts(node.get("url")))
                if surface is not None:
                    self._builder.add(surface.moved(T))
            waiting += [(child, T_child) for child, T_child in reversed(self._shown(node, T))]
        return self._builder.surface()

    def _shown(self, node: Node, T: FloatArray) -> list[tuple[Node, FloatArray]]:
        """Return the visible children of a node with their poses."""
        match node.kind:
            case kind if kind in GROUPS:
                return [(child, T) for child in _nodes(node.get("children"))]
            case "Transform":
                with np.errstate(over="ignore", invalid="ignore"):
                    T_children = T @ _placed(node)
                return [(child, T_children) for child in _nodes(node.get("children"))]
            case "Switch":
                chosen = number(node, "whichChoice", -1.0)
                choice = _nodes(node.get("choice"))
                return [(choice[int(chosen)], T)] if 0.0 <= chosen < len(choice) else []
            case "LOD":
                return [(child, T) for child in _nodes(node.get("level"))[:1]]
            case "Shape" | "Inline":
                pass
            case kind if not NO_SURFACE.fullmatch(kind):
                self._left_out[kind] += 1
        return []

    def _shape(self, node: Node, T: FloatArray) -> None:
        geometry = part(node, "geometry")
        if geometry is None:
            return
        if id(geometry) not in self._surfaces:
            self._surfaces[id(geometry)] = surface_of(geometry, self._name, self._left_out)
        surface = self._surfaces[id(geometry)]
        if surface is not None:
            self._builder.add(surface.painted(self._colour(node)).moved(T))
        else:
            self._left_out[geometry.kind] += 1

    def _colour(self, shape: Node) -> tuple[float, ...] | None:
        """Return the colour (4,) 0..1 of its material; None without a material."""
        appearance = part(shape, "appearance")
        if appearance is None:
            return None
        if part(appearance, "texture") is not None:
            self._left_out[PICTURES] += 1
        material = part(appearance, "material")
        if material is None or material.kind != "Material":
            return None
        diffuse = vector(material, "diffuseColor", (0.8, 0.8, 0.8))
        glow = vector(material, "emissiveColor", (0.0, 0.0, 0.0))
        shown = diffuse if diffuse.any() else glow
        return (*shown.tolist(), 1.0 - number(material, "transparency", 0.0))


def _nodes(value: Value | None) -> list[Node]:
    """Return the nodes in a field."""
    items = value if isinstance(value, list) else (value,)
    return [item for item in items if isinstance(item, Node)]


def _placed(node: Node) -> FloatArray:
    """Return the pose (4, 4) of a Transform, 6.52: P' = T C R SR S -SR -C P."""
    moved, center = (vector(node, key, (0.0,) * 3) for key in ("translation", "center"))
    scale = vector(node, "scale", (1.0,) * 3)
    R, SR = (_rotation(node, key) for key in ("rotation", "scaleOrientation"))
    A = R @ (SR * scale) @ SR.T
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = A, moved + center - A @ center
    return T


def _rotation(node: Node, field: str) -> FloatArray:
    """Return the rotation (3, 3) in a field of axis and angle."""
    x, y, z, angle = vector(node, field, (0.0, 0.0, 1.0, 0.0))
    # Reduced to one turn, because the sine of a very large angle is noise.
    return so3.exp(unit(np.array((x, y, z))) * float(np.remainder(angle, 2.0 * np.pi)))
