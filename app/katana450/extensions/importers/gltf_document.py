"""The JSON document of a glTF file, in the form of version 2.0.

Source: Khronos Group, glTF 2.0 Specification (ISO/IEC 12113:2022), and its extensions. Only the
parts that are read are listed, named as in the specification in snake case.
"""

from __future__ import annotations

import struct
from typing import Annotated, Any, Literal

import msgspec
import numpy as np

from katana450.errors import InputError
from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import FloatArray

Natural = Annotated[int, msgspec.Meta(ge=0)]
"""A whole number from 0."""

LINE_MODES, TRIANGLES, STRIP, FAN = range(4), 4, 5, 6
"""Modes of a primitive: points and lines, and three of surfaces."""


class Buffer(msgspec.Struct, rename="camel"):
    """A buffer of the file."""

    byte_length: Natural
    uri: str | None = None


class MeshoptView(msgspec.Struct, rename="camel"):
    """The compressed numbers of a buffer view (EXT_meshopt_compression)."""

    buffer: Natural
    byte_length: Natural
    byte_stride: Annotated[int, msgspec.Meta(ge=2, le=256)]
    count: Natural
    mode: Literal["ATTRIBUTES", "TRIANGLES", "INDICES"]
    byte_offset: Natural = 0
    filter: Literal["NONE", "OCTAHEDRAL", "QUATERNION", "EXPONENTIAL", "COLOR"] = "NONE"


class ViewExtensions(msgspec.Struct):
    """The extensions of a buffer view that are read. Both names stand for the same format."""

    ext: MeshoptView | None = msgspec.field(default=None, name="EXT_meshopt_compression")
    khr: MeshoptView | None = msgspec.field(default=None, name="KHR_meshopt_compression")


class BufferView(msgspec.Struct, rename="camel"):
    """A part of a buffer."""

    buffer: Natural
    byte_length: Natural
    byte_offset: Natural = 0
    byte_stride: Annotated[int, msgspec.Meta(ge=1, le=252)] | None = None
    extensions: ViewExtensions = msgspec.field(default_factory=ViewExtensions)


class SparsePlaces(msgspec.Struct, rename="camel"):
    """The places of the numbers that a sparse accessor replaces."""

    buffer_view: Natural
    component_type: int
    byte_offset: Natural = 0


class SparseValues(msgspec.Struct, rename="camel"):
    """The numbers that a sparse accessor has at these places."""

    buffer_view: Natural
    byte_offset: Natural = 0


class Sparse(msgspec.Struct):
    """The numbers in which an accessor differs from its buffer view, or from 0 without one."""

    count: Natural
    indices: SparsePlaces
    values: SparseValues


class Accessor(msgspec.Struct, rename="camel"):
    """An array of numbers in a buffer view."""

    component_type: int
    count: Natural
    type: str
    buffer_view: Natural | None = None
    byte_offset: Natural = 0
    normalized: bool = False
    sparse: Sparse | None = None


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
    found: dict[bytes, bytes] = {}
    at = 12
    version, length = struct.unpack_from("<II", data, 4) if len(data) >= at else (2, at)
    if version != 2:
        raise InputError(_other_version(str(version), name))
    if length > len(data):
        raise InputError(f"{name} is corrupt or not GLB 2.0: it is shorter than its header says.")
    data = data[:length]
    while at + 8 <= len(data):
        size, kind = struct.unpack_from("<I4s", data, at)
        if at + 8 + size > len(data):
            raise InputError(f"{name} is corrupt: it ends within a chunk.")
        found.setdefault(kind, data[at + 8 : at + 8 + size])
        at += 8 + size
    if b"JSON" not in found:
        raise InputError(f"{name} is corrupt: it has no JSON chunk.")
    return found[b"JSON"], found.get(b"BIN\0")


def _other_version(version: str, name: str) -> str:
    return f"{name} is glTF {version}, which is not read. Export it as glTF 2.0."
