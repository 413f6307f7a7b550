"""Meshes of objects by their content: their files, their triangles, and their collision bodies."""

from __future__ import annotations

import hashlib
import threading
from collections.abc import Collection
from dataclasses import dataclass
from functools import cached_property

from katana450.arm.control.solid import Solid
from katana450.arm.robot import creases
from katana450.arm.robot.creases import Colours
from katana450.errors import InputError
from katana450.maths.geometry.arrays import FloatArray, IntArray

MAX_MESHES = 64
"""Meshes kept."""

MAX_BYTES = 200_000_000
"""Of all of them together."""


@dataclass(frozen=True, eq=False)
class Mesh:
    """A file as it came, and what it shows.

    Attributes:
        file, format, unit, up: The file and how it was read: the ending of its name, the sign of
            its unit, and its upward axis, None where that of the format was taken.
        name: from the file's, fit for an object.
        vertices: (n, 3) [m]; z = 0 is their underside, and the z axis goes through the middle of
            the box along the axes that holds them.
        faces: (m, 3) indices of them. colours: (m, 4) a face; None where the file says none.
        solid: what it counts as where contacts are looked for.
        said: for people: what was read, and how it counts.
    """

    file: bytes
    format: str
    unit: str
    up: str | None
    name: str
    vertices: FloatArray
    faces: IntArray
    colours: Colours | None
    solid: Solid
    text: str

    @property
    def key(self) -> str:
        """By which it is asked for."""
        return self.solid.key

    @property
    def sha256(self) -> str:
        """Of its file."""
        return hashlib.sha256(self.file).hexdigest()

    @property
    def bytes(self) -> int:
        """That it takes."""
        return len(self.file) + self.vertices.nbytes + self.faces.nbytes

    @cached_property
    def drawn(self) -> creases.Drawn:
        """Its triangles, for drawing."""
        return creases.drawn(self.vertices, self.faces, self.colours)


class Meshes:
    """A bounded store, for all threads. What is in use is never given up."""

    def __init__(self, maximum: int = MAX_MESHES, max_bytes: int = MAX_BYTES) -> None:
        self._limit = maximum
        self._max_bytes = max_bytes
        self._lock = threading.Lock()
        self._kept: dict[str, Mesh] = {}

    def get(self, key: str) -> Mesh | None:
        """That of the key, if it is kept."""
        with self._lock:
            return self._kept.get(key)

    def need(self, key: str) -> Mesh:
        """The same. Raises InputError where it is not kept."""
        found = self.get(key)
        if found is None:
            raise InputError("There is no mesh of that key, or no more: upload its file again.")
        return found

    def put(self, meshes: Collection[Mesh], used: Collection[str]) -> None:
        """Keep ``meshes``, at one go; the oldest that is not ``used`` gives way.

        Raises InputError, and keeps none of them, where there is no room.
        """
        new = {mesh.key: mesh for mesh in meshes}
        with self._lock:
            kept = {key: mesh for key, mesh in self._kept.items() if key not in new} | new
            for key in list(kept):
                if self._fits(kept):
                    break
                if key not in new and key not in used:
                    del kept[key]
            if not self._fits(kept):
                raise InputError(
                    f"There is room for {self._limit} meshes of {self._max_bytes // 1_000_000} MB "
                    "together: take objects away."
                )
            self._kept = kept

    def _fits(self, kept: dict[str, Mesh]) -> bool:
        total = sum(mesh.bytes for mesh in kept.values())
        return len(kept) <= self._limit and total <= self._max_bytes
