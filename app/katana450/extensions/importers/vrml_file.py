"""VRML worlds of other programs, flattened to one surface.

Source: ISO/IEC 14772-1:1997. Nodes that are not read are left out and reported. A world shows other
worlds of the same upload, and no script is executed.
"""

from __future__ import annotations

import posixpath
import re
import zlib
from collections import Counter
from collections.abc import Callable

import numpy as np

from katana450.errors import InputError
from katana450.extensions.export.vrml_node import Node, Value
from katana450.extensions.export.vrml_text import HEADER
from katana450.extensions.importers.archive import Companions
from katana450.extensions.importers.surface import (
    MAX_COPIES,
    MeshBuilder,
    MeshReading,
    MeshSurface,
)
from katana450.extensions.importers.vrml_reader import Reader
from katana450.extensions.importers.vrml_solids import (
    FieldError,
    number,
    part,
    surface_of,
    texts,
    unit,
    vector,
)
from katana450.maths.geometry import so3
from katana450.maths.geometry.arrays import FloatArray

GZIP = b"\x1f\x8b"
"""First bytes of a gzip file."""

OTHER_WORLDS = re.compile(r"\s*<|#VRML V1\.0|#X3D")
"""Beginning of X3D in XML, of VRML 1.0, and of X3D in the encoding of VRML97."""

SUFFIXES = (".wrl", ".wrz")
"""Suffixes of worlds."""

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


def read_wrl(data: bytes, name: str, maximum: int, companions: Companions) -> MeshReading:
    """Return all surfaces that are shown at first, in the world frame with y up.

    ``maximum`` [bytes] limits the unpacked size of a compressed file. Raises InputError with the
    line of an error.
    """
    worlds = _Worlds(name, maximum, companions)
    return MeshReading(worlds.read(data, ""), tuple(worlds.left_out))


class _Worlds:
    """The worlds of one upload: each is read once, with the worlds that it shows."""

    def __init__(self, name: str, maximum: int, companions: Companions) -> None:
        self._name, self._maximum, self._companions = name, maximum, companions
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
        found = self._companions.find((url.partition("#")[0] for url in urls), self._open[-1])
        if found is None:
            return None
        path, data = found
        if path in self._open:
            self.left_out["worlds that show themselves"] += 1
            return None
        if not path.lower().endswith(SUFFIXES):
            self.left_out[f"{posixpath.basename(path)}, which is not VRML"] += 1
            return None
        if path not in self._surfaces:
            self._surfaces[path] = self.read(data, path)
        return self._surfaces[path]

    def _text(self, data: bytes, name: str) -> str:
        if data.startswith(GZIP):
            data = _unpacked(data, name, self._maximum)
        text = data.decode("utf-8", "replace").removeprefix("\ufeff")
        if OTHER_WORLDS.match(text):
            raise InputError(
                f"{name} is VRML 1.0 or X3D, which is not read. Export it as VRML97 or GLB."
            )
        if not text.startswith("#VRML V2.0"):
            raise InputError(f"{name} is not VRML: it must begin with {HEADER!r}.")
        return text


def _unpacked(data: bytes, name: str, maximum: int) -> bytes:
    unpacker = zlib.decompressobj(wbits=16 + zlib.MAX_WBITS)
    try:
        found = unpacker.decompress(data, maximum + 1)
    except zlib.error as error:
        raise InputError(f"{name} is corrupt: {error}.") from error
    if len(found) > maximum:
        raise InputError(f"{name} has more than {maximum // 1_000_000} MB when unpacked.")
    if not unpacker.eof:
        raise InputError(f"{name} is corrupt: it ends too early.")
    return found


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
                found = self._shown_file(texts(node.get("url")))
                if found is not None:
                    self._builder.add(found.moved(T))
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
