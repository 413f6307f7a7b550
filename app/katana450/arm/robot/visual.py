"""The shapes of a link in its URDF: primitives, and meshes that trimesh can read."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from katana450.caching import cached_property
from katana450.disk_cache import kept
from katana450.errors import RobotDescriptionError
from katana450.maths.geometry.arrays import FloatArray, frozen

T = TypeVar("T")

Color = tuple[int, int, int]
"""Red, green and blue, 0..255."""


GREY: Color = (150, 156, 163)
"""Colour of a shape that has none of its own."""

ROD_RADIUS = 0.008
"""[m] Radius of the rods that represent a link without shapes."""

ROD_LENGTH = 1e-3
"""[m] Shorter rods are not drawn."""


SINGLE_FILES = (".glb", ".ply", ".stl")
"""Suffixes of mesh files that refer to no other file."""

GEOMETRY_FILES = (*SINGLE_FILES, ".dae", ".obj")
"""Suffixes of mesh files that contain all their vertices; others of their files are for colours."""

UNIT = re.compile(rb"<unit\b[^>]*\bmeter\s*=\s*[\"']([^\"']+)[\"']")
"""The unit of a COLLADA file [m]."""


@dataclass(frozen=True, eq=False)
class PrimitiveShape:
    """A shape that is made on demand, because most robots are read only for their joints.

    Attributes:
        kind: name of the function of ``trimesh.creation`` that makes it.
        options: its arguments [m].
    """

    kind: str
    options: Mapping[str, Any]

    def mesh(self) -> Any:
        """Return a new trimesh [m]."""
        import trimesh

        return getattr(trimesh.creation, self.kind)(**self.options)


@dataclass(frozen=True, eq=False)
class Visual:
    """One shape.

    Attributes:
        T_body_visual: (4, 4) pose in its body [m].
        scale: (3,) factors on the coordinates in the file.
        file: its mesh file; None for a shape that is made.
        colour: red, green and blue, 0..255, for shapes that have no colour of their own.
        primitive: the primitive shape, if it is one.
        make: function that returns any other shape as a new trimesh [m].
    """

    T_body_visual: FloatArray
    scale: FloatArray
    file: Path | None
    colour: Color = GREY
    primitive: PrimitiveShape | None = None
    make: Any = None

    @property
    def glb(self) -> Path | None:
        """The GLB file, if it can be shown unchanged with its own materials; else None."""
        if self.file is None or self.file.suffix != ".glb":
            return None
        return self.file if (self.scale == 1.0).all() else None

    @property
    def is_rod(self) -> bool:
        """True if it only connects joints, in the place of a shape that the file lacks."""
        return self.primitive is not None and "segment" in self.primitive.options

    @cached_property
    def mesh(self) -> Any:
        """A trimesh of the shape in the body's frame [m].

        Raises RobotDescriptionError if the file cannot be read.
        """
        if self.file is not None:
            mesh = scene_in(self.file).to_mesh()
        else:
            mesh = self.make() if self.primitive is None else self.primitive.mesh()
        mesh.apply_transform(self.T_body_visual @ np.diag([*self.scale, 1.0]))
        return mesh

    def kept(self, make: Callable[[], T], kind: type[T], files: Sequence[str] = SINGLE_FILES) -> T:
        """Return the value of ``make``, kept on disk where the shape comes from one file.

        The value depends on the shape alone. ``kind``: its type. ``files``: suffixes of files that
        are sufficient for it.
        """
        if self.file is None or self.file.suffix.lower() not in files:
            return make()
        try:
            data = self.file.read_bytes()
        except OSError:
            # The reader of the mesh explains why.
            return make()
        own = (self.T_body_visual, self.scale, str(self.colour))
        return kept(make, kind, self.file.suffix, data, *own)


def scene_in(source: Path) -> Any:
    """Return the contents of a mesh file as a scene of trimesh [m].

    The unit that a COLLADA file states applies, as in RViz. Raises RobotDescriptionError for a file
    that its reader rejects, whatever the reader reports.
    """
    import trimesh

    try:
        scene: Any = trimesh.load_scene(source)
        unit = UNIT.search(source.read_bytes()) if source.suffix.lower() == ".dae" else None
        return scene if unit is None else scene.apply_scale(float(unit[1]))
    except Exception as error:
        kind = source.suffix or "its format"
        raise RobotDescriptionError(
            f"{source} cannot be read as a mesh: the file is corrupt, or {kind} is not supported. "
            "Export it again, for example as binary STL."
        ) from error


def rods(ends: Sequence[FloatArray]) -> tuple[Visual, ...]:
    """Return thin cylinders from a link's origin to each of ``ends`` (3,) [m] in its frame."""
    return tuple(
        Visual(
            frozen(np.eye(4)),
            frozen(np.ones(3)),
            None,
            primitive=PrimitiveShape(
                "cylinder", {"radius": ROD_RADIUS, "segment": [np.zeros(3), end]}
            ),
        )
        for end in ends
        if float(np.linalg.norm(end)) > ROD_LENGTH
    )


def mesh_file(name: str, folder: Path) -> Path:
    """Return the path of the mesh ``name``, relative to ``folder``.

    The path in ``package://name/path`` is searched for beside the file and in the folders above it.
    """
    # A relative folder does not name all folders above it.
    folder = folder.absolute()
    if not name.startswith("package://"):
        return (folder / name.removeprefix("file://")).resolve()
    whole = Path(name.removeprefix("package://"))
    rest = Path(*whole.parts[1:])
    places = [above / part for above in (folder, *folder.parents) for part in (rest, whole)]
    return next((place for place in places if place.is_file()), folder / rest).resolve()
