"""A scene as a value, and what its text leaves to be read elsewhere."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from katana450.arm.control.solid import Look, Solid
from katana450.arm.control.things import Form, Thing
from katana450.errors import InputError
from katana450.extensions.programs.source import Problem, ScriptError, Value
from katana450.maths.geometry.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class Scene:
    """What stands around or is fixed to the hand, the water, and where the arm stood.

    Attributes:
        things: with nothing held.
        water: in the cup [m^3]; None for no water anywhere.
        joints: (n,) [rad]; None where nobody says.
    """

    things: tuple[Thing, ...]
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
class Entry:
    """One thing of a text, whose mesh is still in its file. ``at``: where it is in the text."""

    at: Value
    name: str
    form: Form
    size: tuple[float, ...]
    T: FloatArray
    can_be_held: bool
    mesh: MeshFile | None
    scale: float
    look: Look
    fixed: bool


@dataclass(frozen=True, eq=False)
class Draft:
    """A text that is understood. Poses of what is fixed are in the frame of the tool."""

    entries: tuple[Entry, ...]
    water: float | None
    joints: FloatArray | None

    def scene(self, solids: Mapping[MeshFile, Solid], T_palm_tool: FloatArray | None) -> Scene:
        """With its meshes read. ``T_palm_tool``: of the hand; None where there is none.

        Raises ScriptError with the places of all that cannot be.
        """
        things: list[Thing] = []
        problems: list[Problem] = []
        for entry in self.entries:
            try:
                if entry.fixed and T_palm_tool is None:
                    raise InputError("This arm's contacts are not looked at: it has no hand.")
                things.append(
                    Thing(
                        entry.name,
                        entry.form,
                        entry.size,
                        T_palm_tool @ entry.T
                        if entry.fixed and T_palm_tool is not None
                        else entry.T,
                        entry.can_be_held,
                        solid=None if entry.mesh is None else solids[entry.mesh],
                        scale=entry.scale,
                        look=entry.look,
                        fixed=entry.fixed,
                    )
                )
            except InputError as error:
                problems += entry.at.wrong(str(error)).problems
        if problems:
            raise ScriptError(tuple(problems))
        return Scene(tuple(things), self.water, self.joints)
