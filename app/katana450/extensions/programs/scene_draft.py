"""A scene as a value, and the draft of a scene before its meshes are read."""

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
    """The scene objects, the water, and the posture of the arm.

    Attributes:
        objects: the objects; the fingers hold none of them.
        water: volume of the water in the cup [m^3]; None for no water.
        joints: (n,) posture of the arm [rad]; None if not given.
    """

    objects: tuple[SceneObject, ...]
    water: float | None = None
    joints: FloatArray | None = None


@dataclass(frozen=True)
class MeshFile:
    """A mesh file of a scene.

    Attributes:
        path: path relative to the folder of the scene.
        unit: unit of its coordinates, such as ``mm``; None to guess it.
        up: axis that points up, ``y`` or ``z``; None for the default of the file format.
        sha256: SHA-256 of the file in hexadecimal; None to accept any content.
    """

    path: str
    unit: str | None = None
    up: str | None = None
    sha256: str | None = None


@dataclass(frozen=True, eq=False)
class SceneEntry:
    """An object in the text of a scene, before its mesh file is read.

    Attributes:
        at: its place in the text, for error messages.
        mesh: its mesh file; None for other shapes.
        T: (4, 4) its pose [m] in the base frame, or in the tool frame if it is ``fixed``.

    All others are as in ``SceneObject``.
    """

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
    """A parsed scene, before its mesh files are read. The values are as in ``Scene``."""

    entries: tuple[SceneEntry, ...]
    water: float | None
    joints: FloatArray | None

    def scene(self, solids: Mapping[MeshFile, Solid], T_palm_tool: FloatArray | None) -> Scene:
        """Return the scene, with the solid of each mesh file from ``solids``.

        ``T_palm_tool``: (4, 4) pose of the default tool in the frame of the palm; None without a
        hand. Raises ScriptError with all errors and their places in the text.
        """
        objects: list[SceneObject] = []
        problems: list[Problem] = []
        for entry in self.entries:
            try:
                if entry.fixed and T_palm_tool is None:
                    raise InputError(
                        "Nothing can be attached to the hand: this arm has no model of a hand. "
                        "Remove `attach: hand`."
                    )
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
