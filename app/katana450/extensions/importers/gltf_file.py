"""glTF 2.0, as .glb, or as .gltf with embedded buffers.

Source: Khronos Group, glTF 2.0 Specification (ISO/IEC 12113:2022). No other file is opened.
"""

from __future__ import annotations

import base64
import binascii
import struct
from collections import Counter
from typing import Annotated, Any

import msgspec
import numpy as np
import numpy.typing as npt

from katana450.errors import InputError
from katana450.extensions.importers.surface import (
    MAX_COPIES,
    MeshBuilder,
    MeshReading,
    MeshSurface,
    check_triangles,
    doubles,
    of_polygons,
)
from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import FloatArray, IntArray
from katana450.srgb import to_srgb

Natural = Annotated[int, msgspec.Meta(ge=0)]
"""A whole number from 0."""

COMPONENTS = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
"""Component types: numpy types by their numbers in the specification."""

WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
"""Number of components of each accessor type."""

TRIANGLES, STRIP, FAN = 4, 5, 6
"""Modes of a primitive."""

IGNORED_EXTENSIONS = (
    "KHR_materials_",
    "KHR_texture_",
    "KHR_mesh_quantization",
    "KHR_lights_",
    "EXT_texture",
)
"""Prefixes of required extensions that can be ignored, because only surfaces are read."""


class Buffer(msgspec.Struct, rename="camel"):
    """A buffer of the file."""

    byte_length: Natural
    uri: str | None = None


class BufferView(msgspec.Struct, rename="camel"):
    """A part of a buffer."""

    buffer: Natural
    byte_length: Natural
    byte_offset: Natural = 0
    byte_stride: Annotated[int, msgspec.Meta(ge=1, le=252)] | None = None


class Accessor(msgspec.Struct, rename="camel"):
    """An array of numbers in a buffer view."""

    component_type: int
    count: Natural
    type: str
    buffer_view: Natural | None = None
    byte_offset: Natural = 0
    normalized: bool = False
    sparse: Any = None


class Primitive(msgspec.Struct, rename="camel"):
    """A part of a mesh with one material."""

    attributes: dict[str, Natural]
    indices: Natural | None = None
    material: Natural | None = None
    mode: Natural = TRIANGLES
    targets: list[Any] = []


class Mesh(msgspec.Struct, rename="camel"):
    """A mesh of the file."""

    primitives: list[Primitive]


class Node(msgspec.Struct, rename="camel"):
    """A node of the scene tree."""

    children: list[Natural] = []
    mesh: Natural | None = None
    skin: Natural | None = None
    matrix: Annotated[list[float], msgspec.Meta(min_length=16, max_length=16)] | None = None
    translation: tuple[float, float, float] = (0.0, 0.0, 0.0)
    rotation: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 1.0)
    scale: tuple[float, float, float] = (1.0, 1.0, 1.0)

    def pose(self) -> FloatArray:
        """Return its pose (4, 4) in the frame of its parent."""
        if self.matrix is not None:
            return np.array(self.matrix).reshape(4, 4).T
        x, y, z, w = self.rotation
        T = se3.from_rotation_translation(so3.from_quaternion((w, x, y, z)), self.translation)
        T[:3, :3] *= self.scale
        return T


class Scene(msgspec.Struct, rename="camel"):
    """A scene: the numbers of its root nodes."""

    nodes: list[Natural] = []


class Metallic(msgspec.Struct, rename="camel"):
    """The metallic-roughness model of a material."""

    base_color_factor: tuple[float, float, float, float] = (1.0, 1.0, 1.0, 1.0)
    base_color_texture: Any = None


class Material(msgspec.Struct, rename="camel"):
    """A material of the file."""

    pbr_metallic_roughness: Metallic = msgspec.field(default_factory=Metallic)


class Asset(msgspec.Struct, rename="camel"):
    """The metadata of the file."""

    version: str


class Document(msgspec.Struct, rename="camel"):
    """The parts of the JSON document that are read, named as in the specification in snake case."""

    asset: Asset
    extensions_required: list[str] = []
    buffers: list[Buffer] = []
    buffer_views: list[BufferView] = []
    accessors: list[Accessor] = []
    meshes: list[Mesh] = []
    materials: list[Material] = []
    nodes: list[Node] = []
    scenes: list[Scene] = []
    scene: Natural | None = None
    animations: list[Any] = []


def read_gltf(data: bytes, name: str) -> MeshReading:
    """Return all triangles of the scene in metres, y up. Raises InputError for an invalid file."""
    content, binary = _chunks(data, name) if data.startswith(b"glTF") else (data, None)
    try:
        document = msgspec.json.decode(content, type=Document)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise InputError(f"{name} is corrupt or not glTF 2.0: {error}.") from error
    if not document.asset.version.startswith("2."):
        version = document.asset.version[:20]
        raise InputError(f"{name} is glTF {version}; only glTF 2.0 is supported.")
    for extension in document.extensions_required:
        if not extension.startswith(IGNORED_EXTENSIONS):
            raise InputError(
                f"{name} needs the extension {extension[:60]}, which is not supported. "
                "Save it without compression."
            )
    try:
        return _File(document, binary, name).reading()
    except IndexError as error:
        raise InputError(f"{name} is corrupt: it refers to a part that is missing.") from error


def _chunks(data: bytes, name: str) -> tuple[bytes, bytes | None]:
    """Return the document and the buffer of a .glb; other chunks are ignored."""
    found: dict[bytes, bytes] = {}
    at = 12
    if len(data) < at or struct.unpack_from("<II", data, 4) != (2, len(data)):
        raise InputError(f"{name} is corrupt or not GLB 2.0: its length differs from its header.")
    while at + 8 <= len(data):
        size, kind = struct.unpack_from("<I4s", data, at)
        if at + 8 + size > len(data):
            raise InputError(f"{name} is corrupt: it ends within a chunk.")
        found.setdefault(kind, data[at + 8 : at + 8 + size])
        at += 8 + size
    if b"JSON" not in found:
        raise InputError(f"{name} is corrupt: it has no JSON chunk.")
    return found[b"JSON"], found.get(b"BIN\0")


class _File:
    """The surfaces of a decoded file."""

    def __init__(self, document: Document, binary: bytes | None, name: str) -> None:
        self._document, self._name = document, name
        self._buffers = [
            self._buffer(each, binary if number == 0 else None)
            for number, each in enumerate(document.buffers)
        ]
        self._left_out: Counter[str] = Counter()
        self._meshes: dict[int, MeshSurface] = {}

    def reading(self) -> MeshReading:
        """Return the surface of the default scene."""
        builder = MeshBuilder(self._name)
        waiting = [(root, np.eye(4)) for root in self._roots()]
        seen: set[int] = set()
        while waiting:
            number, T_parent = waiting.pop()
            if number in seen or len(seen) > MAX_COPIES:
                raise self._broken(
                    f"node {number} is used twice, or there are over {MAX_COPIES} nodes"
                )
            seen.add(number)
            node = self._document.nodes[number]
            with np.errstate(over="ignore", invalid="ignore"):
                T = T_parent @ node.pose() if any(node.rotation) else T_parent * np.nan
            if not np.isfinite(T).all():
                raise self._broken(f"node {number} has a pose that is not finite")
            waiting += [(child, T) for child in reversed(node.children)]
            if node.skin is not None:
                self._left_out["bones"] += 1
            if node.mesh is not None:
                builder.add(self._mesh(node.mesh).moved(T))
        if self._document.animations:
            self._left_out["motion"] += 1
        return MeshReading(builder.surface(), tuple(self._left_out))

    def _roots(self) -> list[int]:
        document = self._document
        if document.scenes:
            return document.scenes[document.scene or 0].nodes[::-1]
        children = {child for node in document.nodes for child in node.children}
        return [number for number in range(len(document.nodes)) if number not in children]

    def _buffer(self, buffer: Buffer, binary: bytes | None) -> bytes:
        if buffer.uri is None:
            data = binary
        elif buffer.uri.startswith("data:") and ";base64," in buffer.uri[:200]:
            try:
                data = base64.b64decode(buffer.uri.partition(",")[2], validate=True)
            except (binascii.Error, ValueError) as error:
                raise self._broken(f"a buffer is not base64: {error}") from error
        else:
            raise InputError(
                f"{self._name} has its shapes in another file, {buffer.uri[:60]!r}, which is not "
                "opened. Save it as .glb, or as .gltf with embedded buffers."
            )
        if data is None or len(data) < buffer.byte_length:
            raise self._broken("a buffer is missing or shorter than declared")
        return data

    def _mesh(self, number: int) -> MeshSurface:
        if number not in self._meshes:
            builder = MeshBuilder(self._name)
            for primitive in self._document.meshes[number].primitives:
                if primitive.mode in (TRIANGLES, STRIP, FAN):
                    builder.add(self._surface(primitive))
                else:
                    self._left_out["lines and points"] += 1
            self._meshes[number] = builder.surface()
        return self._meshes[number]

    def _surface(self, primitive: Primitive) -> MeshSurface:
        if "POSITION" not in primitive.attributes:
            return MeshSurface(np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64))
        points = self._numbers(primitive.attributes["POSITION"], 3)
        if primitive.indices is None:
            index = np.arange(len(points))
        else:
            index = self._rows(primitive.indices, 1).ravel().astype(np.int64)
        corners = self._corners(index, primitive.mode)
        if primitive.targets:
            self._left_out["changes of shape"] += 1
        return of_polygons(
            points,
            corners,
            np.full(len(corners) // 3, 3),
            self._name,
            vertex_colours=self._colours(primitive, len(points)),
        )

    def _corners(self, index: IntArray, mode: int) -> IntArray:
        """Return the corners (3 m,) of triangles, strips or fans."""
        if mode == TRIANGLES:
            if len(index) % 3:
                raise self._broken(f"{len(index)} corners do not form triangles")
            return index
        count = max(len(index) - 2, 0)
        check_triangles(count, self._name)
        rows = np.arange(count)
        if mode == FAN:
            places = np.column_stack((np.zeros_like(rows), rows + 1, rows + 2))
        else:
            odd = rows % 2
            places = np.column_stack((rows, rows + 1 + odd, rows + 2 - odd))
        return index[places.ravel()] if count else index[:0]

    def _colours(self, primitive: Primitive, count: int) -> FloatArray | None:
        """Return (count, 4) sRGB and opacity 0..1 of the vertices; None without colours."""
        factor = None
        if primitive.material is not None:
            material = self._document.materials[primitive.material].pbr_metallic_roughness
            factor = np.array([material.base_color_factor])
            if material.base_color_texture is not None:
                self._left_out["pictures on the surface"] += 1
        if "COLOR_0" in primitive.attributes:
            own = self._numbers(primitive.attributes["COLOR_0"], None)
            if own.shape not in ((count, 3), (count, 4)):
                raise self._broken("the colours do not match the vertices")
            if own.shape[1] == 3:
                own = np.column_stack((own, np.ones(count)))
            factor = own if factor is None else own * factor
        if factor is None:
            return None
        shown = np.column_stack((to_srgb(factor[:, :3]), factor[:, 3]))
        return np.broadcast_to(shown, (count, 4))

    def _numbers(self, number: int, width: int | None) -> FloatArray:
        """Return (count, width) of an accessor; normalized integers become 0..1 or -1..1."""
        rows = self._rows(number, width)
        accessor = self._document.accessors[number]
        if accessor.normalized and rows.dtype.kind in "iu":
            return np.maximum(rows / float(np.iinfo(rows.dtype).max), -1.0)
        return doubles(rows)

    def _rows(self, number: int, width: int | None) -> npt.NDArray[Any]:
        """Return (count, width) of an accessor in its own type; any width if None."""
        accessor = self._document.accessors[number]
        if accessor.sparse is not None or accessor.buffer_view is None:
            raise InputError(
                f"{self._name} has sparse or packed numbers, which are not supported. "
                "Save it without compression."
            )
        columns = WIDTHS.get(accessor.type, 0)
        kind = COMPONENTS.get(accessor.component_type)
        if kind is None or columns == 0 or (width is not None and columns != width):
            raise self._broken(f"accessor {number} has a wrong type")
        view = self._document.buffer_views[accessor.buffer_view]
        item = np.dtype(kind).itemsize * columns
        stride = view.byte_stride or item
        start = view.byte_offset + accessor.byte_offset
        ends = accessor.byte_offset + stride * (accessor.count - 1) + item
        buffer = self._buffers[view.buffer]
        if accessor.count == 0:
            return np.zeros((0, columns), kind)
        if stride < item or ends > view.byte_length or view.byte_offset + ends > len(buffer):
            raise self._broken(f"accessor {number} goes beyond its buffer")
        return np.ndarray(
            (accessor.count, columns), kind, buffer, start, (stride, np.dtype(kind).itemsize)
        )

    def _broken(self, what: str) -> InputError:
        return InputError(f"{self._name} is corrupt: {what}.")
