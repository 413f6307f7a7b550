"""VRML worlds of other programs, flattened to one surface.

Source: ISO/IEC 14772-1:1997. Nodes that are not of the standard are left out and reported. A world
shows other worlds of the same upload, and no script is executed.
"""

from __future__ import annotations

import posixpath
import re
import zlib
from collections import Counter

from katana450.errors import InputError
from katana450.extensions.export.vrml_node import Node
from katana450.extensions.export.vrml_text import HEADER
from katana450.extensions.importers.companions import Companions
from katana450.extensions.importers.surface import MeshReading, MeshSurface
from katana450.extensions.importers.vrml_flattening import Flattening
from katana450.extensions.importers.vrml_prototypes import PrototypeExpansion
from katana450.extensions.importers.vrml_reader import Reader

GZIP = b"\x1f\x8b"
"""First bytes of a gzip file."""

OTHER_WORLDS = re.compile(r"\s*<|#VRML V1\.0|#X3D")
"""Beginning of X3D in XML, of VRML 1.0, and of X3D in the encoding of VRML97."""

SUFFIXES = (".wrl", ".wrz")
"""Suffixes of worlds."""


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
            nodes = [node for node in reader.nodes() if isinstance(node, Node)]
            self.left_out += reader.left_out
            expansion = PrototypeExpansion(name)
            world = tuple(map(expansion.expanded, nodes))
            return Flattening(name, self.left_out, self._shown).surface(world)
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
