"""The shapes of a link as its URDF gives them: primitives, and meshes trimesh can read."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from katana450.errors import RobotDescriptionError
from katana450.maths.geometry.arrays import FloatArray, frozen

GREY = (150, 156, 163)
"""Red, green and blue of 255 of a shape without a colour of its own."""

ROD_RADIUS = 0.008
"""[m] Of the rods that stand for a link without shapes."""

ROD_LENGTH = 1e-3
"""[m] Shorter links are not drawn."""


@dataclass(frozen=True, eq=False)
class Visual:
    """One shape.

    Attributes:
        T_body_visual: (4, 4) where it sits in its body [m].
        scale: (3,) factors on the coordinates in the file.
        source: a mesh file, or a trimesh made here.
        colour: red, green and blue of 255, for shapes that bring none.
    """

    T_body_visual: FloatArray
    scale: FloatArray
    source: Path | Any
    colour: tuple[int, int, int] = GREY

    @property
    def glb(self) -> Path | None:
        """The file, if it can be shown as it is, with its own materials."""
        if not isinstance(self.source, Path) or self.source.suffix != ".glb":
            return None
        return self.source if (self.scale == 1.0).all() else None

    @cached_property
    def mesh(self) -> Any:
        """A trimesh of it in the body's own frame [m]; RobotDescriptionError if it is none."""
        import trimesh

        if isinstance(self.source, Path):
            try:
                mesh = trimesh.load_scene(self.source).to_mesh()
            except Exception as error:
                raise unreadable_mesh(self.source) from error
        else:
            mesh = self.source.copy()
        mesh.apply_transform(self.T_body_visual @ np.diag([*self.scale, 1.0]))
        return mesh


def unreadable_mesh(source: Path) -> RobotDescriptionError:
    """Return the error for a mesh file that its reader refuses, whatever the reader says."""
    kind = source.suffix or "its format"
    return RobotDescriptionError(
        f"{source} cannot be read as a mesh: the file is corrupt, or {kind} is not understood. "
        "Export it anew, for example as binary STL."
    )


def visuals_of(
    elements: Sequence[Any], materials: Sequence[Any], folder: Path
) -> tuple[tuple[Visual, ...], list[Path]]:
    """The shapes of yourdfpy visuals or collisions, and the mesh files that are not there.

    ``materials``: those of the whole robot, which a shape may name. ``folder``: that mesh files are
    named from.
    """
    named = {material.name: material for material in materials}
    found: list[Visual] = []
    missing: list[Path] = []
    for visual in elements:
        T = frozen(np.eye(4) if visual.origin is None else visual.origin)
        geometry, colour = visual.geometry, _colour(getattr(visual, "material", None), named)
        if geometry.mesh is None:
            source: Any = _primitive(geometry)
            scale = np.ones(3)
        else:
            source = mesh_file(geometry.mesh.filename, folder)
            factors = 1.0 if geometry.mesh.scale is None else geometry.mesh.scale
            scale = np.broadcast_to(np.asarray(factors, dtype=float), 3)
            if not source.is_file():
                missing.append(source)
                continue
        if source is not None:
            found.append(Visual(T, frozen(scale), source, colour))
    return tuple(found), missing


def rods(ends: Sequence[npt.NDArray[Any]]) -> tuple[Visual, ...]:
    """Thin cylinders from a link's origin to each of ``ends`` (3,) [m] in its frame."""
    import trimesh

    return tuple(
        Visual(
            frozen(np.eye(4)),
            frozen(np.ones(3)),
            trimesh.creation.cylinder(radius=ROD_RADIUS, segment=[np.zeros(3), end]),
        )
        for end in ends
        if float(np.linalg.norm(end)) > ROD_LENGTH
    )


def _primitive(geometry: Any) -> Any:
    import trimesh

    if geometry.box is not None:
        return trimesh.creation.box(extents=geometry.box.size)
    if geometry.cylinder is not None:
        return trimesh.creation.cylinder(
            radius=geometry.cylinder.radius, height=geometry.cylinder.length
        )
    if geometry.sphere is not None:
        return trimesh.creation.icosphere(subdivisions=3, radius=geometry.sphere.radius)
    return None


def mesh_file(name: str, folder: Path) -> Path:
    """``package://name/rest`` is looked for as rest beside the file and in the folders above."""
    if not name.startswith("package://"):
        return (folder / name.removeprefix("file://")).resolve()
    whole = Path(name.removeprefix("package://"))
    rest = Path(*whole.parts[1:])
    places = [above / part for above in (folder, *folder.parents) for part in (rest, whole)]
    return next((place for place in places if place.is_file()), folder / rest).resolve()


def _colour(material: Any, named: Mapping[str, Any]) -> tuple[int, int, int]:
    if material is not None and material.color is None:
        material = named.get(material.name)
    if material is None or material.color is None:
        return GREY
    red, green, blue = (
        round(255.0 * min(max(float(part), 0.0), 1.0)) for part in material.color.rgba[:3]
    )
    return red, green, blue
