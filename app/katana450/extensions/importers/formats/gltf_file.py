"""glTF, as .glb, or as .gltf with buffers in itself or in other files.

Source: Khronos Group, glTF 2.0 Specification (ISO/IEC 12113:2022); KHR_draco_mesh_compression. Only
the parts that are read are listed, named as in the specification in snake case. The library that
decompresses is imported when a file needs it.
"""

from __future__ import annotations

import base64
import binascii
import struct
from collections import Counter
from typing import Annotated, Any
from urllib.parse import unquote_to_bytes

import msgspec
import numpy as np
import numpy.typing as npt

from katana450.errors import InputError
from katana450.extensions.importers.archive import Companions
from katana450.extensions.importers.formats.surface import (
    MAX_COPIES,
    NOTHING,
    MeshBuilder,
    MeshReading,
    MeshSurface,
    doubles,
    failures_in_words,
    of_polygons,
)
from katana450.extras import library
from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.srgb import to_srgb

Natural = Annotated[int, msgspec.Meta(ge=0)]
"""A whole number from 0."""

TRIANGLES = 4
"""Mode of a primitive of separate triangles."""


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


class DracoPart(msgspec.Struct, rename="camel"):
    """The compressed numbers of a primitive (KHR_draco_mesh_compression)."""

    buffer_view: Natural
    attributes: dict[str, Natural]


class PrimitiveExtensions(msgspec.Struct):
    """The extension of a primitive that is read."""

    draco: DracoPart | None = msgspec.field(default=None, name="KHR_draco_mesh_compression")


class Primitive(msgspec.Struct, rename="camel"):
    """A part of a mesh with one material."""

    attributes: dict[str, Natural]
    indices: Natural | None = None
    material: Natural | None = None
    mode: Natural = TRIANGLES
    targets: list[Any] = []
    extensions: PrimitiveExtensions = msgspec.field(default_factory=PrimitiveExtensions)


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
        # A quaternion of zeros is no rotation.
        if not any(self.rotation):
            return np.full((4, 4), np.nan)
        x, y, z, w = self.rotation
        R = so3.from_quaternion((w, x, y, z)) * self.scale
        return se3.from_rotation_translation(R, self.translation)


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

    version: str | float


class Document(msgspec.Struct, rename="camel"):
    """The parts of the JSON document that are read, named as in the specification in snake case."""

    asset: Asset = msgspec.field(default_factory=lambda: Asset("2.0"))
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


class Outline(msgspec.Struct):
    """The part of a document from which its version is seen."""

    asset: Asset = msgspec.field(default_factory=lambda: Asset("2.0"))


def decoded(data: bytes, name: str) -> tuple[Document, bytes | None]:
    """Return the document of the file ``name``, and the buffer of a .glb; None without one.

    Raises InputError for a file that is corrupt or of another version.
    """
    content, binary = _chunks(data, name) if data.startswith(b"glTF") else (data, None)
    try:
        version = str(msgspec.json.decode(content, type=Outline).asset.version)[:20]
        if not version.startswith("2"):
            raise InputError(_other_version(version, name))
        document = msgspec.json.decode(content, type=Document)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise InputError(f"{name} is corrupt or not glTF: {error}.") from error
    return document, binary


def _chunks(data: bytes, name: str) -> tuple[bytes, bytes | None]:
    """Return the document and the buffer of a .glb; other chunks are ignored."""
    chunks: dict[bytes, bytes] = {}
    offset = 12
    version, length = struct.unpack_from("<II", data, 4) if len(data) >= offset else (2, offset)
    if version != 2:
        raise InputError(_other_version(str(version), name))
    if length > len(data):
        raise InputError(f"{name} is corrupt or not GLB 2.0: it is shorter than its header says.")
    data = data[:length]
    while offset + 8 <= len(data):
        size, kind = struct.unpack_from("<I4s", data, offset)
        if offset + 8 + size > len(data):
            raise InputError(f"{name} is corrupt: it ends within a chunk.")
        chunks.setdefault(kind, data[offset + 8 : offset + 8 + size])
        offset += 8 + size
    if b"JSON" not in chunks:
        raise InputError(f"{name} is corrupt: it has no JSON chunk.")
    return chunks[b"JSON"], chunks.get(b"BIN\0")


def _other_version(version: str, name: str) -> str:
    return f"{name} is glTF {version}, which is not read. Export it as glTF 2.0."


COMPONENTS = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
"""Component types: numpy types by their numbers in the specification."""

WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
"""Number of components of each accessor type."""


class Buffers:
    """The numbers of a decoded file. A buffer is read when it is needed."""

    def __init__(
        self, document: Document, binary: bytes | None, companions: Companions, name: str
    ) -> None:
        """``binary`` is the buffer of a .glb; ``companions`` has the other buffers."""
        self._document, self._binary, self._name = document, binary, name
        self._companions = companions
        self._buffers: dict[int, bytes] = {}
        self._views: dict[int, bytes] = {}

    def numbers(self, number: int, width: int | None) -> FloatArray:
        """Return (count, width) of an accessor; normalized integers become 0..1 or -1..1."""
        return self.scaled(self.rows(number, width), number)

    def scaled(self, rows: npt.NDArray[Any], number: int) -> FloatArray:
        """Return ``rows``, which are those of an accessor, as numbers."""
        if self._document.accessors[number].normalized and rows.dtype.kind in "iu":
            return np.maximum(rows / float(np.iinfo(rows.dtype).max), -1.0)
        return doubles(rows)

    def rows(self, number: int, width: int | None) -> npt.NDArray[Any]:
        """Return (count, width) of an accessor in its own type; any width if None."""
        accessor = self._document.accessors[number]
        columns = WIDTHS.get(accessor.type, 0)
        kind = COMPONENTS.get(accessor.component_type)
        if kind is None or columns == 0 or (width is not None and columns != width):
            raise self.broken(f"accessor {number} has a wrong type")
        what = f"accessor {number}"
        if accessor.sparse is not None:
            raise InputError(f"{self._name} has sparse numbers, which are not read: save it dense.")
        if accessor.buffer_view is None:
            raise self.broken(f"{what} has no buffer")
        return self._part(
            accessor.buffer_view, accessor.byte_offset, accessor.count, columns, kind, what
        )

    def draco(self, part: DracoPart) -> tuple[dict[str, npt.NDArray[Any]], npt.NDArray[Any]]:
        """Return the attributes of a compressed primitive by their names, and its triangles."""
        data = self._view(part.buffer_view)
        decoder = library("DracoPy", "meshes", "glTF files with Draco compression")
        with failures_in_words(self._name):
            mesh = decoder.decode(data)
            by_id = {attribute["unique_id"]: attribute["data"] for attribute in mesh.attributes}
            faces = np.asarray(getattr(mesh, "faces", np.zeros((0, 3), np.uint32)))
        attributes = {
            name: np.asarray(by_id[number]).reshape(len(by_id[number]), -1)
            for name, number in part.attributes.items()
            if number in by_id
        }
        return attributes, faces.astype(np.int64).ravel()

    def broken(self, what: str) -> InputError:
        """Return the error of a file that contradicts itself."""
        return InputError(f"{self._name} is corrupt: {what}.")

    def _part(
        self, number: int, offset: int, count: int, columns: int, kind: str, what: str
    ) -> npt.NDArray[Any]:
        """Return (count, columns) numbers of a buffer view from byte ``offset`` on."""
        data = self._view(number)
        size = np.dtype(kind).itemsize
        item = size * columns
        stride = self._document.buffer_views[number].byte_stride or item
        if count == 0:
            return np.zeros((0, columns), kind)
        if stride < item or offset + stride * (count - 1) + item > len(data):
            raise self.broken(f"{what} goes beyond its buffer")
        return np.ndarray((count, columns), kind, data, offset, (stride, size))

    def _view(self, number: int) -> bytes:
        """Return the bytes of a buffer view."""
        if number not in self._views:
            view = self._document.buffer_views[number]
            self._views[number] = self._bytes(view.buffer, view.byte_offset, view.byte_length)
        return self._views[number]

    def _bytes(self, number: int, offset: int, length: int) -> bytes:
        data = self._buffer(number)
        if offset + length > len(data):
            raise self.broken("a part of a buffer goes beyond its end")
        return data[offset : offset + length]

    def _buffer(self, number: int) -> bytes:
        if number not in self._buffers:
            buffer = self._document.buffers[number]
            data = self._binary if number == 0 else None
            if buffer.uri is not None:
                data = self._named(buffer.uri)
            if data is None or len(data) < buffer.byte_length:
                raise self.broken("a buffer is missing or shorter than declared")
            self._buffers[number] = data
        return self._buffers[number]

    def _named(self, uri: str) -> bytes:
        """Return the data in ``uri`` itself, or in the file that it names."""
        if uri.startswith("data:"):
            head, _, content = uri.partition(",")
            try:
                if head.endswith(";base64"):
                    return base64.b64decode(unquote_to_bytes(content), validate=True)
            except (binascii.Error, ValueError) as error:
                raise self.broken(f"a buffer is not base64: {error}") from error
            return unquote_to_bytes(content)
        companion = self._companions.find([uri])
        if companion is None:
            raise InputError(
                f"{self._name} has its shapes in another file, {uri[:60]!r}, which is not there. "
                "Add both together, as their folder or as a .zip; or save it as .glb."
            )
        return companion[1]


READ_EXTENSIONS = ("KHR_draco_mesh_compression", "KHR_mesh_quantization")
"""Required extensions that are read."""

MESHOPT = "_meshopt_compression"
"""End of the names of extensions with which a file is refused."""

NO_SURFACE = ("KHR_materials_", "KHR_texture_", "KHR_lights_", "EXT_texture", "KHR_techniques_")
"""Prefixes of required extensions that change no surface, and are not reported."""


def read_gltf(data: bytes, name: str, companions: Companions | None = None) -> MeshReading:
    """Return all triangles of the scene in metres, y up. Raises InputError for an invalid file."""
    document, binary = decoded(data, name)
    if any(extension.endswith(MESHOPT) for extension in document.extensions_required):
        raise InputError(
            f"{name} is compressed with meshopt, which is not read. Save it without compression, "
            "or with Draco."
        )
    try:
        buffers = Buffers(document, binary, companions or Companions(), name)
        return _File(document, buffers, name).reading()
    except IndexError as error:
        raise InputError(f"{name} is corrupt: it refers to a part that is missing.") from error


class _File:
    """The surfaces of a decoded file."""

    def __init__(self, document: Document, buffers: Buffers, name: str) -> None:
        self._document, self._buffers, self._name = document, buffers, name
        self._left_out: Counter[str] = Counter()
        self._meshes: dict[int, MeshSurface] = {}

    def reading(self) -> MeshReading:
        """Return the surface of the default scene."""
        builder = MeshBuilder(self._name)
        waiting = [(root, np.eye(4)) for root in self._roots()]
        visits = 0
        while waiting:
            number, T_parent = waiting.pop()
            visits += 1
            # A node may be shown at several places, though the standard forbids it.
            if visits > MAX_COPIES:
                raise self._buffers.broken(
                    f"it shows more than {MAX_COPIES} nodes, each counted as often as it is used"
                )
            node = self._document.nodes[number]
            with np.errstate(over="ignore", invalid="ignore"):
                T = T_parent @ node.pose()
            if not np.isfinite(T).all():
                raise self._buffers.broken(f"node {number} has a pose that is not finite")
            waiting += [(child, T) for child in reversed(node.children)]
            if node.skin is not None:
                self._left_out["bones"] += 1
            if node.mesh is not None:
                builder.add(self._mesh(node.mesh).moved(T))
        if self._document.animations:
            self._left_out["motion"] += 1
        for extension in self._document.extensions_required:
            if extension not in READ_EXTENSIONS and not extension.startswith(NO_SURFACE):
                self._left_out[f"the extension {extension[:60]}"] += 1
        return MeshReading(builder.surface(), tuple(self._left_out))

    def _roots(self) -> list[int]:
        document = self._document
        if document.scenes:
            return document.scenes[document.scene or 0].nodes[::-1]
        children = {child for node in document.nodes for child in node.children}
        return [number for number in range(len(document.nodes)) if number not in children]

    def _mesh(self, number: int) -> MeshSurface:
        if number not in self._meshes:
            builder = MeshBuilder(self._name)
            for primitive in self._document.meshes[number].primitives:
                if primitive.mode == TRIANGLES:
                    builder.add(self._surface(primitive))
                else:
                    self._left_out["lines, points and strips"] += 1
            self._meshes[number] = builder.surface()
        return self._meshes[number]

    def _surface(self, primitive: Primitive) -> MeshSurface:
        if "POSITION" not in primitive.attributes:
            return NOTHING
        own = None
        draco = primitive.extensions.draco
        if draco is not None:
            attributes, index = self._buffers.draco(draco)
            if attributes.get("POSITION", index).shape[1:] != (3,):
                raise self._buffers.broken("compressed vertices do not have three coordinates")
            points = self._buffers.scaled(attributes["POSITION"], primitive.attributes["POSITION"])
            if "COLOR_0" in attributes and "COLOR_0" in primitive.attributes:
                own = self._buffers.scaled(attributes["COLOR_0"], primitive.attributes["COLOR_0"])
        else:
            points = self._buffers.numbers(primitive.attributes["POSITION"], 3)
            index = np.arange(len(points))
            if primitive.indices is not None:
                index = self._buffers.rows(primitive.indices, 1).ravel().astype(np.int64)
            colour = primitive.attributes.get("COLOR_0")
            own = None if colour is None else self._buffers.numbers(colour, None)
        if len(index) % 3:
            self._left_out["corners that form no triangle"] += 1
        corners = index[: len(index) // 3 * 3]
        if primitive.targets:
            self._left_out["changes of shape"] += 1
        return of_polygons(
            points,
            corners,
            np.full(len(corners) // 3, 3),
            self._name,
            vertex_colours=self._colours(primitive, own, len(points)),
        )

    def _colours(
        self, primitive: Primitive, own: FloatArray | None, count: int
    ) -> FloatArray | None:
        """Return (count, 4) sRGB and opacity 0..1 of the vertices; None without colours.

        ``own`` are the colours of the vertices themselves.
        """
        factor = None
        if primitive.material is not None:
            material = self._document.materials[primitive.material].pbr_metallic_roughness
            factor = np.array([material.base_color_factor])
            if material.base_color_texture is not None:
                self._left_out["pictures on the surface"] += 1
        if own is not None:
            if own.shape not in ((count, 3), (count, 4)):
                raise self._buffers.broken("the colours do not match the vertices")
            if own.shape[1] == 3:
                own = np.column_stack((own, np.ones(count)))
            factor = own if factor is None else own * factor
        if factor is None:
            return None
        shown = np.column_stack((to_srgb(factor[:, :3]), factor[:, 3]))
        return np.broadcast_to(shown, (count, 4))
