"""VRML worlds of other programs, flattened to one surface.

Sources: ISO/IEC 14772-1:1997; ISO/IEC 19776-2 (X3D in the same encoding). This reader is more
tolerant than the one for our own files: nodes that are not of the standard are left out and
reported. A world shows other files of the same upload, and no script is executed.
"""

from __future__ import annotations

import posixpath
import re
import zlib
from collections import Counter
from collections.abc import Callable
from contextlib import suppress

import numpy as np

from katana450.errors import InputError
from katana450.extensions.export.vrml_node import Node
from katana450.extensions.export.vrml_text import HEADER
from katana450.extensions.importers.companions import Companions
from katana450.extensions.importers.surface import MeshReading, MeshSurface
from katana450.extensions.importers.vrml_flattening import Flattening, nodes
from katana450.extensions.importers.vrml_foreign import BUILT_IN, ForeignReader, parsed
from katana450.extensions.importers.vrml_prototypes import Instance, Prototype, PrototypeExpansion
from katana450.extensions.importers.vrml_standard import STANDARD

GZIP = b"\x1f\x8b"
"""First bytes of a gzip file."""

OTHER_WORLDS = re.compile(r"\s*<|#VRML V1\.0")
"""Beginning of X3D in XML, and of VRML 1.0."""

SUFFIXES = (".wrl", ".wrz", ".x3dv")
"""Suffixes of worlds."""

BODY = "humanoidBody"
"""Field with all links of a robot of OpenHRP, which the prototypes of some files do not show."""

MESHES = (".stl", ".obj", ".ply", ".off", ".glb", ".gltf", ".dae")
"""Suffixes of other files that worlds show."""

Other = Callable[[str, bytes], MeshReading]
"""A function that reads such a file by its path and content."""

Y_FROM_Z = np.array(((1, 0, 0, 0), (0, 0, 1, 0), (0, -1, 0, 0), (0, 0, 0, 1)), dtype=np.float64)
"""Rotation (4, 4) of what has z up to y up."""


def read_wrl(
    data: bytes, name: str, maximum: int, companions: Companions, other: Other
) -> MeshReading:
    """Return all surfaces that are shown at first, in the world frame with y up.

    ``maximum`` [bytes] limits the unpacked size of a compressed file. Raises InputError with the
    line of an error.
    """
    worlds = _Worlds(name, maximum, companions, other)
    surface = worlds.read(data, "")
    unit = worlds.lengths.get("")
    return MeshReading(surface, tuple(worlds.left_out), unit=unit, note=worlds.note)


class _Worlds:
    """The worlds of one upload: each is read once, with the worlds and prototypes it names."""

    def __init__(self, name: str, maximum: int, companions: Companions, other: Other) -> None:
        self._name, self._maximum, self._companions = name, maximum, companions
        self._other = other
        self.left_out: Counter[str] = Counter()
        self.note = ""
        # Units of length [m] of the worlds that state one.
        self.lengths: dict[str, float] = {}
        self._surfaces: dict[str, MeshSurface] = {}
        self._prototypes: dict[str, ForeignReader] = {}
        self._open: list[str] = []

    def read(self, data: bytes, path: str) -> MeshSurface:
        """Return the surface of the world at ``path`` of the upload; empty for the first file."""
        name = path or self._name
        text = self._text(data, name)
        self._open.append(path)
        try:
            found, reader = self._parsed(text, name)
            self.left_out += reader.left_out
            if reader.length is not None:
                self.lengths[path] = reader.length
            expansion = PrototypeExpansion(name, lambda prototype: self._external(prototype, path))
            world = tuple(map(expansion.expanded, found))
            surface = Flattening(name, self.left_out, self._shown).surface(world)
            # A world that another shows stays as empty as it is.
            if path or not surface.is_empty:
                return surface
            return self._sample(found, world, reader, expansion, name) or surface
        finally:
            self._open.pop()

    def _sample(
        self,
        found: tuple[Node, ...],
        world: tuple[Node, ...],
        reader: ForeignReader,
        expansion: PrototypeExpansion,
        name: str,
    ) -> MeshSurface | None:
        """Return a surface for a world of nodes ``found`` that shows nothing; None if it has none.

        This is the body of a robot whose prototype does not show it. Or its first prototype with a
        surface, with default values, since a library of prototypes shows nothing by itself. Or what
        a Switch hides at first.
        """
        robots = (each.get(BODY) for each in found)
        body = tuple(expansion.expanded(each) for robot in robots for each in nodes(robot))
        shown = Flattening(name, self.left_out, self._shown).surface(body)
        if not shown.is_empty:
            self.note = f"The world shows nothing at first: this is what {BODY} of a robot holds."
            return shown
        samples: dict[str, tuple[Node, ...]] = {"": world}
        for hidden in (False, True):
            for each in ("", *reader.prototypes):
                if each not in samples:
                    instance = Instance(each, (), None, reader.prototypes[each])
                    samples[each] = (expansion.expanded(instance),)
                left_out: Counter[str] = Counter()
                sample = Flattening(name, left_out, self._shown, hidden).surface(samples[each])
                if not sample.is_empty:
                    self.left_out |= left_out
                    parts = [f"its prototype {each[:40]!r}"] if each else []
                    parts += ["what a Switch hides"] if hidden else []
                    self.note = f"The world shows nothing at first: this is {' with '.join(parts)}."
                    return sample
        return None

    def _shown(self, urls: tuple[str, ...]) -> MeshSurface | None:
        """Return the surface of the first world of ``urls`` that is there; else None."""
        found = self._companions.find((url.partition("#")[0] for url in urls), self._open[-1])
        if found is None:
            return None
        path, data = found
        if path in self._open:
            self.left_out["worlds that show themselves"] += 1
            return None
        if path not in self._surfaces and path.lower().endswith(MESHES):
            self._surfaces[path] = self._mesh(data, path)
        if path not in self._surfaces and path.lower().endswith(SUFFIXES):
            self._surfaces[path] = self.read(data, path)
        if path not in self._surfaces:
            self.left_out[f"{posixpath.basename(path)}, which is not VRML"] += 1
            return None
        own, other = (self.lengths.get(each, 1.0) for each in (self._open[-1], path))
        surface = self._surfaces[path]
        return surface if own == other else surface.moved(np.diag([*[other / own] * 3, 1.0]))

    def _mesh(self, data: bytes, path: str) -> MeshSurface:
        """Return the surface of a file of another format, with y up."""
        reading = self._other(path, data)
        self.left_out.update(reading.left_out)
        if reading.unit is not None:
            self.lengths[path] = reading.unit
        elif not path.lower().endswith((".glb", ".gltf")):
            # A file without a unit has that of the world.
            self.lengths[path] = self.lengths.get(self._open[-1], 1.0)
        return reading.surface.moved(Y_FROM_Z) if reading.up == "z" else reading.surface

    def _external(self, prototype: Prototype, path: str) -> Prototype | None:
        """Return a prototype that is in another file; None if that is not there."""
        urls = [url for url in prototype.urls if not url.startswith(BUILT_IN)]
        found = self._companions.find((url.partition("#")[0] for url in urls), path)
        if found is None:
            return None
        where, data = found
        if where not in self._prototypes:
            self._prototypes[where] = self._parsed(self._text(data, where), where)[1]
        known = self._prototypes[where].prototypes
        wanted = {url.partition("#")[2] for url in urls} - {""}
        return next((known[each] for each in known if each in wanted or not wanted), None)

    def _text(self, data: bytes, name: str) -> str:
        if data.startswith(GZIP):
            data = _unpacked(data, name, self._maximum)
        return data.decode("utf-8", "replace").removeprefix("\ufeff")

    def _parsed(self, text: str, name: str) -> tuple[tuple[Node, ...], ForeignReader]:
        if re.match("#(VRML V2.0|X3D V[34])", text):
            return parsed(text, name)
        if OTHER_WORLDS.match(text):
            raise InputError(
                f"{name} is VRML 1.0 or X3D in XML, which is not read. Export it as VRML97 or GLB."
            )
        # Parts of robots are often saved without the first line.
        with suppress(InputError):
            found = parsed(f"{HEADER}\n{text}", name)
            if any(node.kind in STANDARD for node in found[0]):
                return found
        raise InputError(f"{name} is not VRML: it must begin with {HEADER!r}.")


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
