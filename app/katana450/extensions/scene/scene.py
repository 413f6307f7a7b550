"""A scene as a value, and what its text leaves to be read elsewhere."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from katana450.arm.control.scene_objects import SceneObject, Shape
from katana450.arm.control.solid import ObjectAppearance, Solid
from katana450.errors import InputError
from katana450.extensions.programs.source import Problem, ScriptError, YamlValue
from katana450.maths.geometry.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class Scene:
    """What stands around or is fixed to the hand, the water, and where the arm stood.

    Attributes:
        objects: with nothing held.
        water: in the cup [m^3]; None for no water anywhere.
        joints: (n,) [rad]; None where nobody says.
    """

    objects: tuple[SceneObject, ...]
    water: float | None = None
    joints: FloatArray | None = None


@dataclass(frozen=True)
class MeshFile:
    """A file beside the scene: its relative path, how it is read, and what it has to be.

    unit, up: as `read_mesh` of exchange has them, None to guess. sha256: of its bytes, None
    where anything will do.
    """

    path: str
    unit: str | None = None
    up: str | None = None
    sha256: str | None = None


@dataclass(frozen=True, eq=False)
class SceneEntry:
    """One object of a text, whose mesh is still in its file. ``at``: where it is in the text."""

    at: YamlValue
    name: str
    shape: Shape
    size: tuple[float, ...]
    T: FloatArray
    can_be_held: bool
    mesh: MeshFile | None
    scale: float
    appearance: ObjectAppearance
    fixed: bool


@dataclass(frozen=True, eq=False)
class SceneDraft:
    """A text that is understood. Poses of what is fixed are in the frame of the tool."""

    entries: tuple[SceneEntry, ...]
    water: float | None
    joints: FloatArray | None

    def scene(self, solids: Mapping[MeshFile, Solid], T_palm_tool: FloatArray | None) -> Scene:
        """With its meshes read. ``T_palm_tool``: of the hand; None where there is none.

        Raises ScriptError with the places of all that cannot be.
        """
        objects: list[SceneObject] = []
        problems: list[Problem] = []
        for entry in self.entries:
            try:
                if entry.fixed and T_palm_tool is None:
                    raise InputError("This arm's contacts are not looked at: it has no hand.")
                objects.append(
                    SceneObject(
                        entry.name,
                        entry.shape,
                        entry.size,
                        T_palm_tool @ entry.T
                        if entry.fixed and T_palm_tool is not None
                        else entry.T,
                        entry.can_be_held,
                        solid=None if entry.mesh is None else solids[entry.mesh],
                        scale=entry.scale,
                        appearance=entry.appearance,
                        fixed=entry.fixed,
                    )
                )
            except InputError as error:
                problems += entry.at.wrong(str(error)).problems
        if problems:
            raise ScriptError(tuple(problems))
        return Scene(tuple(objects), self.water, self.joints)
