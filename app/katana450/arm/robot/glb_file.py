"""Binary glTF 2.0 files under construction (Khronos Group, ISO/IEC 12113:2022)."""

from __future__ import annotations

import json
import struct
from typing import Any

import numpy as np
import numpy.typing as npt

ARRAY, ELEMENT = 34962, 34963
"""Targets of a buffer view: values of vertices, and indices."""

COMPONENTS = {"f": 5126, "H": 5123, "I": 5125}
"""Component type of an accessor, by numpy's character of the type of its numbers."""


class GlbFile:
    """A file whose numbers are added before the document that refers to them."""

    def __init__(self) -> None:
        """Begin without numbers."""
        self._data = bytearray()
        self._views: list[dict[str, int]] = []
        self._accessors: list[dict[str, Any]] = []

    def add(self, rows: npt.NDArray[Any]) -> int:
        """Append rows (n, width) of vertices, or (n, 1) of indices; return their accessor."""
        is_index = rows.dtype.kind in "iu"
        # The largest number of each type of index is not allowed.
        index = np.uint16 if is_index and rows.max(initial=0) < (1 << 16) - 1 else np.uint32
        rows = rows.astype(index if is_index else np.float32)
        raw = rows.tobytes()
        target = ELEMENT if is_index else ARRAY
        self._views.append(
            {"buffer": 0, "byteOffset": len(self._data), "byteLength": len(raw), "target": target}
        )
        self._data += raw + bytes(-len(raw) % 4)
        accessor: dict[str, Any] = {
            "bufferView": len(self._views) - 1,
            "componentType": COMPONENTS[rows.dtype.char],
            "count": len(rows),
            "type": {1: "SCALAR", 3: "VEC3", 4: "VEC4"}[rows.shape[1]],
        }
        if not is_index:
            accessor |= {"min": rows.min(axis=0).tolist(), "max": rows.max(axis=0).tolist()}
        self._accessors.append(accessor)
        return len(self._accessors) - 1

    def content(self, **parts: Any) -> bytes:
        """Return the content of the file. ``parts``: its nodes, meshes and so on; empty ones go."""
        parts |= {
            "accessors": self._accessors,
            "bufferViews": self._views,
            "buffers": [{"byteLength": len(self._data)}] if self._data else [],
        }
        document = {"asset": {"version": "2.0", "generator": "katana450"}, "scene": 0}
        document |= {name: part for name, part in parts.items() if part}
        text = json.dumps(document, separators=(",", ":"), allow_nan=False).encode()
        text += b" " * (-len(text) % 4)
        chunks = struct.pack("<I4s", len(text), b"JSON") + text
        if self._data:
            chunks += struct.pack("<I4s", len(self._data), b"BIN\0") + bytes(self._data)
        return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks
