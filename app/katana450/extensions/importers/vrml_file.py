"""VRML97 worlds of other programs, flattened to one surface.

Source: ISO/IEC 14772-1:1997. This reader is more tolerant than the one for our own files: nodes
that are not of the standard are left out and reported. No other file is opened, and no script is
executed.
"""

from __future__ import annotations

import re
import zlib
from collections import Counter

import numpy as np

from katana450.errors import InputError
from katana450.extensions.export.vrml_node import Node, Route, Value
from katana450.extensions.export.vrml_text import HEADER
from katana450.extensions.importers.surface import MAX_COPIES, MeshBuilder, MeshReading, MeshSurface
from katana450.extensions.importers.vrml_reader import Reader
from katana450.extensions.importers.vrml_solids import (
    MAKERS,
    number,
    numbers,
    part,
    surface_of,
    unit,
)
from katana450.extensions.importers.vrml_standard import IGNORED_NODES, STANDARD
from katana450.maths.geometry import so3
from katana450.maths.geometry.arrays import FloatArray

GZIP = b"\x1f\x8b"
"""First bytes of a gzip file."""

CLOSERS = {"{": "}", "[": "]"}
"""The closing token of each opening token."""

TEXTURES = ("ImageTexture", "PixelTexture", "MovieTexture")
"""Kinds of nodes that are textures."""


def read_wrl(data: bytes, name: str, maximum: int) -> MeshReading:
    """Return all surfaces that are shown at first, in the world frame with y up.

    ``maximum`` [bytes] limits the unpacked size of a compressed file. Raises InputError with the
    line of an error.
    """
    if data.startswith(GZIP):
        data = _unpacked(data, name, maximum)
    text = data.decode("utf-8", "replace").removeprefix("\ufeff")
    if re.match("#VRML V1.0", text):
        raise InputError(
            f"{name} is VRML 1.0, which is not supported. Save it as VRML97 (VRML 2.0)."
        )
    if not re.match(f"{re.escape(HEADER)}(?![^ \r\n])", text):
        raise InputError(f"{name} is not VRML97: it must begin with {HEADER!r}.")
    reader = ForeignReader(text, name)
    world = reader.world()
    return _Flattening(name, reader.left_out).reading(world.nodes)


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


class ForeignReader(Reader):
    """A reader that knows the standard nodes, omits others, and puts reused nodes in place."""

    fields = STANDARD

    def __init__(self, text: str, name: str) -> None:
        """Read ``text`` of the file ``name``."""
        super().__init__(text, name)
        self.left_out: Counter[str] = Counter()

    def _define(self, name: str) -> None:
        # The standard allows a name to be defined again.
        self._named[name] = None

    def _used(self, node: Node, _name: str) -> Node:
        return node

    def _unknown(self, kind: str, name: str | None) -> Node:
        if kind in ("PROTO", "EXTERNPROTO"):
            raise self._error(f"{kind} {self._ahead[:40]}: prototypes are not supported")
        if kind != "NULL":
            self._skip_braces()
        if kind in TEXTURES:
            self.left_out["pictures on the surface"] += 1
        return Node(kind, (), name)

    def _skip_braces(self) -> None:
        if self._ahead != "{":
            raise self._error(f"expected '{{', not {self._ahead[:40]!r}")
        closers: list[str] = []
        while True:
            token = self._take()
            if token in CLOSERS:
                closers.append(CLOSERS[token])
            elif token in ("}", "]"):
                if token != closers.pop():
                    raise self._error(f"{token!r} closes nothing")
                if not closers:
                    return
            elif token == "DEF":
                name = self._new_name()
                self._named[name] = Node(self._ahead, (), name)

    def _stray(self, kind: str, field: str) -> None:
        if field in ("PROTO", "EXTERNPROTO"):
            self._unknown(field, None)
        if field != "ROUTE":
            super()._stray(kind, field)
        self._ends()

    def _route(self) -> Route:
        self._take()
        return self._ends()

    def _ends(self) -> Route:
        """Return the rest of a ROUTE after its first word; its target does not matter here."""
        source = self._take()
        self._expect("TO")
        return Route(source, "", self._take(), "")


class _Flattening:
    """A traversal of the visible nodes, with the pose of each."""

    def __init__(self, name: str, left_out: Counter[str]) -> None:
        self._name, self._left_out = name, left_out
        self._builder = MeshBuilder(name)
        self._surfaces: dict[int, MeshSurface | None] = {}
        self._visits = 0

    def reading(self, nodes: tuple[Node, ...]) -> MeshReading:
        """Return the surface of all nodes of a file."""
        # Without recursion, because reused nodes can be nested deeper than the text.
        waiting = [(node, np.eye(4)) for node in reversed(nodes)]
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
            waiting += [(child, T_child) for child, T_child in reversed(self._shown(node, T))]
        return MeshReading(self._builder.surface(), tuple(self._left_out))

    def _shown(self, node: Node, T: FloatArray) -> list[tuple[Node, FloatArray]]:
        """Return the visible children of a node with their poses."""
        match node.kind:
            case "Group" | "Anchor" | "Billboard" | "Collision":
                return [(child, T) for child in _nodes(node.get("children"))]
            case "Transform":
                with np.errstate(over="ignore", invalid="ignore"):
                    T_children = T @ _placed(node)
                return [(child, T_children) for child in _nodes(node.get("children"))]
            case "Switch":
                chosen = int(number(node, "whichChoice", -1.0))
                choice = _nodes(node.get("choice"))
                return [(choice[chosen], T)] if 0 <= chosen < len(choice) else []
            case "LOD":
                return [(child, T) for child in _nodes(node.get("level"))[:1]]
            case "Inline":
                self._left_out["other files that it shows"] += 1
            case "Shape":
                pass
            case kind if kind not in IGNORED_NODES and kind not in MAKERS and kind not in TEXTURES:
                self._left_out[kind] += 1
        return []

    def _shape(self, node: Node, T: FloatArray) -> None:
        geometry = part(node, "geometry")
        if geometry is None:
            return
        if id(geometry) not in self._surfaces:
            self._surfaces[id(geometry)] = surface_of(geometry, self._name)
        surface = self._surfaces[id(geometry)]
        if surface is not None:
            self._builder.add(surface.painted(_colour(node)).moved(T))
        elif geometry.kind != "NULL":
            self._left_out[geometry.kind] += 1


def _nodes(value: Value | None) -> list[Node]:
    items = value if isinstance(value, tuple) else (value,)
    return [item for item in items if isinstance(item, Node)]


def _placed(node: Node) -> FloatArray:
    """Return the pose (4, 4) of a Transform, 6.52: P' = T C R SR S -SR -C P."""
    moved, center = (numbers(node, key, (0.0,) * 3)[:, 0] for key in ("translation", "center"))
    scale = numbers(node, "scale", (1.0,) * 3)[:, 0]
    R, SR = (_rotation(node, key) for key in ("rotation", "scaleOrientation"))
    A = R @ (SR * scale) @ SR.T
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = A, moved + center - A @ center
    return T


def _rotation(node: Node, field: str) -> FloatArray:
    x, y, z, angle = numbers(node, field, (0.0, 0.0, 1.0, 0.0))[:, 0]
    # Reduced to one turn, because the sine of a very large angle is noise.
    return so3.exp(unit(np.array((x, y, z))) * float(np.remainder(angle, 2.0 * np.pi)))


def _colour(shape: Node) -> tuple[float, ...] | None:
    """Return the colour (4,) 0..1 of its material; None without a material."""
    appearance = part(shape, "appearance")
    material = None if appearance is None else part(appearance, "material")
    if material is None or material.kind != "Material":
        return None
    diffuse = numbers(material, "diffuseColor", (0.8, 0.8, 0.8))[:, 0]
    glow = numbers(material, "emissiveColor", (0.0, 0.0, 0.0))[:, 0]
    shown = diffuse if diffuse.any() else glow
    return (*shown.tolist(), 1.0 - number(material, "transparency", 0.0))
