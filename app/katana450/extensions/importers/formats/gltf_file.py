"""glTF, as .glb, or as .gltf with buffers in itself or in other files.

Source: Khronos Group, glTF 2.0 Specification (ISO/IEC 12113:2022).
"""

from __future__ import annotations

from collections import Counter

import numpy as np

from katana450.errors import InputError
from katana450.extensions.importers.archive import Companions
from katana450.extensions.importers.formats.gltf_document import (
    FAN,
    LINE_MODES,
    STRIP,
    TRIANGLES,
    Buffers,
    Document,
    Primitive,
    decoded,
)
from katana450.extensions.importers.formats.surface import (
    MAX_COPIES,
    NOTHING,
    MeshBuilder,
    MeshReading,
    MeshSurface,
    check_triangles,
    of_polygons,
)
from katana450.maths.geometry.arrays import FloatArray, IntArray
from katana450.srgb import to_srgb

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
                if primitive.mode in (TRIANGLES, STRIP, FAN):
                    builder.add(self._surface(primitive))
                elif primitive.mode in LINE_MODES:
                    self._left_out["lines and points"] += 1
                else:
                    self._left_out[f"primitives of mode {primitive.mode}"] += 1
            self._meshes[number] = builder.surface()
        return self._meshes[number]

    def _surface(self, primitive: Primitive) -> MeshSurface:
        if "POSITION" not in primitive.attributes:
            return NOTHING
        mode, own = primitive.mode, None
        draco = primitive.extensions.draco
        if draco is not None:
            attributes, index = self._buffers.draco(draco)
            if attributes.get("POSITION", index).shape[1:] != (3,):
                raise self._buffers.broken("compressed vertices do not have three coordinates")
            points = self._buffers.scaled(attributes["POSITION"], primitive.attributes["POSITION"])
            if "COLOR_0" in attributes and "COLOR_0" in primitive.attributes:
                own = self._buffers.scaled(attributes["COLOR_0"], primitive.attributes["COLOR_0"])
            mode = TRIANGLES
        else:
            points = self._buffers.numbers(primitive.attributes["POSITION"], 3)
            index = np.arange(len(points))
            if primitive.indices is not None:
                index = self._buffers.rows(primitive.indices, 1).ravel().astype(np.int64)
            colour = primitive.attributes.get("COLOR_0")
            own = None if colour is None else self._buffers.numbers(colour, None)
        corners = self._corners(index, mode)
        if primitive.targets:
            self._left_out["changes of shape"] += 1
        return of_polygons(
            points,
            corners,
            np.full(len(corners) // 3, 3),
            self._name,
            vertex_colours=self._colours(primitive, own, len(points)),
        )

    def _corners(self, index: IntArray, mode: int) -> IntArray:
        """Return the corners (3 m,) of triangles, strips or fans."""
        if mode == TRIANGLES:
            if len(index) % 3:
                self._left_out["corners that form no triangle"] += 1
            return index[: len(index) // 3 * 3]
        count = max(len(index) - 2, 0)
        check_triangles(count, self._name)
        rows = np.arange(count)
        if mode == FAN:
            places = np.column_stack((np.zeros_like(rows), rows + 1, rows + 2))
        else:
            odd = rows % 2
            places = np.column_stack((rows, rows + 1 + odd, rows + 2 - odd))
        return index[places.ravel()] if count else index[:0]

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
