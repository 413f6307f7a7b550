"""Meshes that were read, by their content: their files, their triangles, what they count as."""

from __future__ import annotations

import hashlib
import threading
from collections.abc import Collection
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from katana450.arm.control.solid import Solid
from katana450.errors import InputError
from katana450.extensions.importers import creases
from katana450.extensions.importers.shape_file import (
    UNITS,
    Format,
    ShapeFile,
    Up,
    read_shape_guarded,
)
from katana450.extensions.importers.surface import Colours
from katana450.maths.collision.outer import Outer
from katana450.maths.geometry.arrays import FloatArray, IntArray

MOST = 64
"""Meshes kept."""

MOST_BYTES = 200_000_000
"""Of all of them together."""

FAR_OFF = 2e-3
"""[m] That a hull stands off is worth a word from here on."""

HOLLOW = 1.2
"""[1] Likewise how many times as large it is."""


@dataclass(frozen=True, eq=False)
class Mesh:
    """A file as it came, and what it shows.

    Attributes:
        file, format, unit, up: what was read, and how; the unit by its sign.
        name: from the file's, fit for a thing.
        vertices: (n, 3) [m]; z = 0 is their underside, and the z axis goes through the middle of
            the box along the axes that holds them.
        faces: (m, 3) indices of them. colours: (m, 4) a face; None where the file says none.
        solid: what it counts as where contacts are looked for.
        said: for people: what was read, and how it counts.
    """

    file: bytes
    format: Format
    unit: str
    up: Up | None
    name: str
    vertices: FloatArray
    faces: IntArray
    colours: Colours | None
    solid: Solid
    said: str

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


def read_mesh(data: bytes, file: str, unit: str | None = None, up: Up | None = None) -> Mesh:
    """The mesh in a file of that name.

    unit: a key of UNITS; None to guess. up: as `read_shape` has it. Reads in a process of its own,
    and takes up to some seconds. Raises InputError with what is wrong.
    """
    format = Format.of(file)
    metres = None if unit is None else unit_of(unit)
    shape, found = read_shape_guarded(data, format, file, metres, up)
    sign = next(sign for sign, length in UNITS.items() if length == shape.unit)
    low, high = shape.vertices.min(axis=0), shape.vertices.max(axis=0)
    foot = np.array((*(0.5 * (low + high)[:2]), low[2]))
    told = f"{format.value} {sign} {'' if up is None else up.value}\n".encode()
    key = hashlib.sha256(told + data).hexdigest()[:32]
    x, y, z = (high - low).tolist()
    return Mesh(
        data,
        format,
        sign,
        up,
        shape.name,
        shape.vertices - foot,
        shape.faces,
        shape.colours,
        Solid(key, (x, y, z), found.corners - foot),
        f"{shape.said} {_counted(shape, found)}",
    )


def unit_of(sign: str) -> float:
    """[m] Of a unit by its sign. Raises InputError."""
    if sign not in UNITS:
        raise InputError(f"A unit is one of {', '.join(UNITS)}, not {sign!r}.")
    return UNITS[sign]


def _counted(shape: ShapeFile, found: Outer) -> str:
    """What it counts as where contacts are looked for."""
    said = ["Contacts are looked for with its convex hull"]
    if found.thickened:
        said.append("it is flat, and counts as a little thick")
    if found.off > FAR_OFF:
        said.append(f"that is simplified, and reaches up to {1e3 * found.off:.1f} mm over it")
    volume = _volume(shape)
    if volume is not None and found.volume > HOLLOW * volume:
        said.append(f"its hollows count as filled: {found.volume / volume:.1f} times what it is")
    return "; ".join(said) + "."


def _volume(shape: ShapeFile) -> float | None:
    """[m^3] Of a closed surface, by the tetrahedra over its faces; None of another."""
    edges = np.sort(shape.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    counts = np.unique(edges, axis=0, return_counts=True)[1]
    if not (counts == 2).all():
        return None
    a, b, c = (shape.vertices - shape.vertices.mean(axis=0))[shape.faces].transpose(1, 0, 2)
    volume = abs(float(np.einsum("ij,ij->", a, np.cross(b, c)))) / 6.0
    return volume if volume > 0.0 else None


class Meshes:
    """A bounded store, for all threads. What is in use is never given up."""

    def __init__(self, most: int = MOST, most_bytes: int = MOST_BYTES) -> None:
        self._most = most
        self._most_bytes = most_bytes
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
                    f"There is room for {self._most} meshes of {self._most_bytes // 1_000_000} MB "
                    "together: take objects away."
                )
            self._kept = kept

    def _fits(self, kept: dict[str, Mesh]) -> bool:
        total = sum(mesh.bytes for mesh in kept.values())
        return len(kept) <= self._most and total <= self._most_bytes
