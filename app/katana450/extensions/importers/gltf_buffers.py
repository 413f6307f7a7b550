"""The numbers of a glTF file: buffers, their views, accessors, and both kinds of compression.

Source: Khronos Group, glTF 2.0 Specification (ISO/IEC 12113:2022); KHR_draco_mesh_compression;
EXT_meshopt_compression. The libraries that decompress are imported when a file needs them.
"""

from __future__ import annotations

import base64
import binascii
from typing import Any
from urllib.parse import unquote_to_bytes

import numpy as np
import numpy.typing as npt

from katana450.errors import InputError
from katana450.extensions.importers.companions import Companions
from katana450.extensions.importers.gltf_document import Accessor, Document, DracoPart, MeshoptView
from katana450.extensions.importers.library_errors import failures_in_words
from katana450.extensions.importers.surface import doubles
from katana450.extras import library
from katana450.maths.geometry.arrays import FloatArray

COMPONENTS = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
"""Component types: numpy types by their numbers in the specification."""

WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
"""Number of components of each accessor type."""

MAX_ROWS = 600_000
"""Maximum number of rows of an accessor that no buffer holds."""

MAX_VIEW_BYTES = 64_000_000
"""[bytes] Maximum size of a buffer view after decompression."""


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
        if accessor.buffer_view is None:
            if accessor.count > MAX_ROWS:
                raise self.broken(f"{what} has {accessor.count} rows, but no buffer")
            rows = np.zeros((accessor.count, columns), kind)
        else:
            rows = self._part(
                accessor.buffer_view, accessor.byte_offset, accessor.count, columns, kind, what
            )
        return rows if accessor.sparse is None else self._replaced(rows, accessor, what)

    def draco(self, part: DracoPart) -> tuple[dict[str, npt.NDArray[Any]], npt.NDArray[Any]]:
        """Return the attributes of a compressed primitive by their names, and its triangles."""
        data = self._view(part.buffer_view)
        decoder = library("DracoPy", "meshes", "glTF files with Draco compression")
        with failures_in_words(self._name):
            found = decoder.decode(data)
            by_id = {each["unique_id"]: each["data"] for each in found.attributes}
            faces = np.asarray(getattr(found, "faces", np.zeros((0, 3), np.uint32)))
        attributes = {
            name: np.asarray(by_id[number]).reshape(len(by_id[number]), -1)
            for name, number in part.attributes.items()
            if number in by_id
        }
        return attributes, faces.astype(np.int64).ravel()

    def broken(self, what: str) -> InputError:
        """Return the error of a file that contradicts itself."""
        return InputError(f"{self._name} is corrupt: {what}.")

    def _replaced(self, rows: npt.NDArray[Any], accessor: Accessor, what: str) -> npt.NDArray[Any]:
        """Return ``rows`` with the values of a sparse accessor in their places."""
        sparse = accessor.sparse
        assert sparse is not None
        kind = COMPONENTS.get(sparse.indices.component_type, "")
        if kind not in ("u1", "<u2", "<u4"):
            raise self.broken(f"{what} has sparse indices of a wrong type")
        view, offset = sparse.indices.buffer_view, sparse.indices.byte_offset
        places = self._part(view, offset, sparse.count, 1, kind, what).ravel()
        view, offset = sparse.values.buffer_view, sparse.values.byte_offset
        values = self._part(view, offset, sparse.count, rows.shape[1], rows.dtype.str, what)
        if len(places) and int(places.max()) >= len(rows):
            raise self.broken(f"{what} has a sparse index beyond its end")
        rows = rows.copy()
        rows[places] = values
        return rows

    def _part(
        self, number: int, offset: int, count: int, columns: int, kind: str, what: str
    ) -> npt.NDArray[Any]:
        """Return (count, columns) numbers of a buffer view from byte ``offset`` on."""
        data = self._view(number)
        size = np.dtype(kind).itemsize
        item = size * columns
        view = self._document.buffer_views[number]
        packed = view.extensions.ext or view.extensions.khr
        stride = (view.byte_stride if packed is None else packed.byte_stride) or item
        if count == 0:
            return np.zeros((0, columns), kind)
        if stride < item or offset + stride * (count - 1) + item > len(data):
            raise self.broken(f"{what} goes beyond its buffer")
        return np.ndarray((count, columns), kind, data, offset, (stride, size))

    def _view(self, number: int) -> bytes:
        """Return the bytes of a buffer view."""
        if number not in self._views:
            view = self._document.buffer_views[number]
            packed = view.extensions.ext or view.extensions.khr
            if packed is not None:
                self._views[number] = self._unpacked(packed)
            else:
                self._views[number] = self._bytes(view.buffer, view.byte_offset, view.byte_length)
        return self._views[number]

    def _unpacked(self, view: MeshoptView) -> bytes:
        data = self._bytes(view.buffer, view.byte_offset, view.byte_length)
        if view.count * view.byte_stride > MAX_VIEW_BYTES:
            raise InputError(
                f"{self._name} has over {MAX_VIEW_BYTES // 1_000_000} MB in one part when "
                "unpacked. Save it with fewer triangles."
            )
        with failures_in_words(self._name):
            import meshopt

            found: npt.NDArray[Any] = meshopt.decode_gltf_buffer(
                data, view.count, view.byte_stride, view.mode, view.filter
            )
            return found.tobytes()

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
        found = self._companions.find([uri])
        if found is None:
            raise InputError(
                f"{self._name} has its shapes in another file, {uri[:60]!r}, which is not there. "
                "Add both together, as their folder or as a .zip; or save it as .glb."
            )
        return found[1]
