"""Meshes of scene objects, found by their content, and the scene when the server starts."""

from __future__ import annotations

import hashlib
import logging
import pickle
import threading
from collections.abc import Collection
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.state.solid import Solid
from katana450.arm.robot import surfaces
from katana450.arm.robot.surfaces import Colours
from katana450.atomic import write_files, writer_of
from katana450.caching import cached_property
from katana450.errors import InputError
from katana450.maths.geometry.arrays import FloatArray, IntArray

log = logging.getLogger(__name__)

MAX_MESHES = 64
"""Maximum number of stored meshes."""

MAX_BYTES = 200_000_000
"""[bytes] Maximum size of all stored meshes together."""


SUFFIX = ".mesh"
"""Suffix of the files of the meshes in a folder."""


@dataclass(frozen=True, eq=False)
class Mesh:
    """A mesh file as it was received, and its triangles.

    Attributes:
        file, format, unit, up: The file and how it was read: the extension of its name, the symbol
            of its unit, and its upward axis, None for the default of the format.
        name: Name derived from that of the file, valid as the name of an object.
        vertices: (n, 3) [m]; z = 0 is their underside, and the z axis goes through the middle of
            their axis-aligned bounding box.
        faces: (m, 3) indices of them.
        colours: (m, 4) of each face; None if the file has no colours.
        solid: The solid that represents it in collision checks.
        text: Sentences for people on what was read and how collisions are checked.
        scale: Factor with which it can be placed; 1 if it can be as it is.
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
    scale: float = 1.0

    @property
    def key(self) -> str:
        """Key under which the mesh is stored and requested."""
        return self.solid.key

    @property
    def sha256(self) -> str:
        """SHA-256 checksum of the mesh file, as a hexadecimal text."""
        return hashlib.sha256(self.file).hexdigest()

    @property
    def bytes(self) -> int:
        """Memory that the mesh takes [bytes]."""
        return len(self.file) + self.vertices.nbytes + self.faces.nbytes

    @cached_property
    def drawn(self) -> surfaces.Drawn:
        """Triangles of the mesh, for drawing."""
        return surfaces.drawn(self.vertices, self.faces, self.colours)


class Meshes:
    """A bounded, thread-safe store of meshes. Meshes in use are never removed."""

    def __init__(
        self, folder: Path | None = None, *, maximum: int = MAX_MESHES, max_bytes: int = MAX_BYTES
    ) -> None:
        """Create a store.

        ``folder``: private folder in which the meshes outlast this process; another process of this
        server may have put some there. None keeps them in memory alone.
        """
        self._folder = folder
        self._limit = maximum
        self._max_bytes = max_bytes
        self._lock = threading.Lock()
        self._storing = threading.Lock()
        self._kept: dict[str, Mesh] = {}

    def get(self, key: str) -> Mesh | None:
        """Return the mesh with ``key``, or None if it is not stored."""
        with self._lock:
            if key not in self._kept and self._folder is not None and key.isalnum():
                # A file that is being written or removed counts as missing.
                with suppress(OSError, EOFError, pickle.UnpicklingError):
                    self._kept[key] = pickle.loads((self._folder / f"{key}{SUFFIX}").read_bytes())
            return self._kept.get(key)

    def need(self, key: str) -> Mesh:
        """Return the mesh with ``key``. Raises InputError if it is not stored."""
        mesh = self.get(key)
        if mesh is None:
            raise InputError("There is no mesh with this key any more. Upload its file again.")
        return mesh

    def put(self, meshes: Collection[Mesh], used: Collection[str]) -> None:
        """Store all ``meshes`` at once, in place of the oldest ones that are not ``used``.

        Raises InputError, and stores none of them, if there is no room.
        """
        new = {mesh.key: mesh for mesh in meshes}
        with self._lock:
            together = {key: mesh for key, mesh in self._kept.items() if key not in new} | new
            for key in list(together):
                if self._fits(together):
                    break
                if key not in new and key not in used:
                    del together[key]
            if not self._fits(together):
                raise InputError(
                    f"There is room for {self._limit} meshes of {self._max_bytes // 1_000_000} MB "
                    "in total. Remove objects first."
                )
            removed, self._kept = self._kept.keys() - together.keys(), together
            if self._folder is not None:
                # In a thread, because the server's thread must not wait for a disk.
                work = (self._folder, tuple(new.values()), tuple(removed))
                threading.Thread(target=self._store, args=work, name="meshes").start()

    def _store(self, folder: Path, new: tuple[Mesh, ...], removed: tuple[str, ...]) -> None:
        """Write the files of the ``new`` meshes to ``folder``, and remove those of ``removed``."""
        with self._storing:
            for key in removed:
                with suppress(OSError):
                    (folder / f"{key}{SUFFIX}").unlink()
            for mesh in new:
                try:
                    content = writer_of(pickle.dumps(mesh))
                    write_files({folder / f"{mesh.key}{SUFFIX}": content}, 0o600)
                except InputError as error:
                    log.warning("A mesh will be lost if the page's server ends: %s", error)

    def _fits(self, meshes: dict[str, Mesh]) -> bool:
        total = sum(mesh.bytes for mesh in meshes.values())
        return len(meshes) <= self._limit and total <= self._max_bytes


class InitialScene(NamedTuple):
    """A scene in place of the robot's own.

    Attributes:
        command: Places its objects and its water.
        joints: (n,) initial joint angles [rad]; None for the ready posture.
        meshes: Meshes of its objects.
    """

    command: cmd.ReplaceScene
    joints: FloatArray | None
    meshes: tuple[Mesh, ...]
