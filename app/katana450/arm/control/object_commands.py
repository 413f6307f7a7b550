"""The commands about scene objects, their water and their appearance; no joint moves."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from katana450.arm.control.appearance import AS_MADE, MAX_NAME_LENGTH, AppearanceTrait
from katana450.arm.control.checked import check_finite, vector
from katana450.arm.control.scene_objects import MAX_COORDINATE, MAX_OBJECTS, Attachment, SceneObject
from katana450.arm.control.traits import BaseCommand, CommandTraits
from katana450.errors import InputError
from katana450.maths.geometry import so3
from katana450.maths.geometry.arrays import FloatArray, frozen

SCENE_TRAITS = CommandTraits(while_stopped=True, supersedes=False, passive=True, joints_only=True)
"""Traits of the commands about objects, water and appearance."""


@dataclass(frozen=True)
class PlaceObject(BaseCommand):
    """Put an object at its pose, in place of the one of its name; a held object stays."""

    traits: ClassVar[CommandTraits] = SCENE_TRAITS

    scene_object: SceneObject

    def __post_init__(self) -> None:
        if not isinstance(self.scene_object, SceneObject) or self.scene_object.held:
            raise InputError(
                f"Only a SceneObject that is not held can be placed, not {self.scene_object}."
            )


@dataclass(frozen=True)
class Fill(BaseCommand):
    """Fill the cup with ``volume`` [m^3], and remove all other water."""

    traits: ClassVar[CommandTraits] = SCENE_TRAITS

    volume: float

    def __post_init__(self) -> None:
        check_finite("The volume", self.volume)


@dataclass(frozen=True)
class Remove(BaseCommand):
    """Remove the object of that name; a held object stays."""

    traits: ClassVar[CommandTraits] = SCENE_TRAITS

    name: str


@dataclass(frozen=True, eq=False)
class MoveObject(BaseCommand):
    """Move or turn the object of that name; a held object stays.

    Attributes:
        name: name of the object.
        position: (3,) [m] of its frame in the base frame; None to keep its position.
        R: (3, 3) rotation of its frame in the base frame; None to keep its rotation.
    """

    traits: ClassVar[CommandTraits] = SCENE_TRAITS

    name: str
    position: FloatArray | None = None
    R: FloatArray | None = None

    def __post_init__(self) -> None:
        if self.position is not None:
            position = vector(f"The position of {self.name!r}", self.position, 3)
            if np.abs(position).max() > MAX_COORDINATE:
                raise InputError(f"{self.name!r} would be more than {MAX_COORDINATE:g} m away.")
            object.__setattr__(self, "position", position)
        if self.R is not None:
            R = so3.validated(self.R, f"The rotation of {self.name!r}")
            object.__setattr__(self, "R", frozen(R))


@dataclass(frozen=True)
class SetAppearance(BaseCommand):
    """Change one trait of the appearance of the link or object ``name``.

    See ``LinkAppearance.having``.
    """

    traits: ClassVar[CommandTraits] = SCENE_TRAITS

    name: str
    trait: AppearanceTrait
    value: float | tuple[float, ...] | None

    def __post_init__(self) -> None:
        if not (isinstance(self.name, str) and 0 < len(self.name) <= MAX_NAME_LENGTH):
            raise InputError(
                f"A part's name must have 1 to {MAX_NAME_LENGTH} characters, not {self.name!r}."
            )
        AS_MADE.having(self.trait, self.value)


@dataclass(frozen=True)
class Attach(BaseCommand):
    """Fix the object of that name to the hand, or to the world again; a held object stays."""

    traits: ClassVar[CommandTraits] = SCENE_TRAITS

    name: str
    to: Attachment

    def __post_init__(self) -> None:
        if not isinstance(self.to, Attachment):
            raise InputError(f"`to` must be one of {list(Attachment)}, not {self.to!r}.")


@dataclass(frozen=True, eq=False)
class ReplaceScene(BaseCommand):
    """Replace all objects and the water in one step; a held object stays, and keeps its name.

    Attributes:
        objects: the new objects.
        volume: volume in the cup [m^3]; None for no water anywhere.
    """

    traits: ClassVar[CommandTraits] = SCENE_TRAITS

    objects: tuple[SceneObject, ...]
    volume: float | None = None

    def __post_init__(self) -> None:
        names = {scene_object.name for scene_object in self.objects}
        if len(names) < len(self.objects) or len(names) > MAX_OBJECTS:
            raise InputError(
                f"A scene must have at most {MAX_OBJECTS} objects, each with a different name."
            )
        if any(scene_object.held for scene_object in self.objects):
            raise InputError("The objects of a new scene must not be held.")
        if self.volume is not None:
            check_finite("The volume", self.volume)
