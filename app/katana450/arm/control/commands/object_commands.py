"""The commands about scene objects and their water; no joint moves."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated, ClassVar

import numpy as np
from msgspec import Meta
from msgspec.structs import force_setattr

from katana450.arm.control.commands.act import Command, Name, Request, Traits
from katana450.arm.control.commands.checked import Transform, check_finite, vector
from katana450.arm.control.state.scene_objects import (
    MAX_COORDINATE,
    MAX_OBJECTS,
    Attachment,
    SceneObject,
)
from katana450.errors import InputError
from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.water.units import ML

SCENE_TRAITS = Traits(
    while_stopped=True, supersedes=False, passive=True, joints_only=True, extension=True
)
"""Traits of the commands about objects and water."""

MOVING_TRAITS = replace(SCENE_TRAITS, gesture=True)
"""Traits of those that move an object as a hand does."""


class PlaceObject(Command, frozen=True):
    """Put an object at its pose, in place of the one of its name; a held object stays."""

    traits: ClassVar[Traits] = MOVING_TRAITS

    scene_object: SceneObject

    def __post_init__(self) -> None:
        if not isinstance(self.scene_object, SceneObject) or self.scene_object.held:
            raise InputError(
                f"Only a SceneObject that is not held can be placed, not {self.scene_object}."
            )


class Fill(Command, Request, frozen=True):
    """Fill the cup with water, and remove all water elsewhere.

    Attributes:
        ml: Volume in the cup [ml].
    """

    traits: ClassVar[Traits] = SCENE_TRAITS

    ml: Annotated[float, Meta(ge=0.0, le=1000.0)]

    def __post_init__(self) -> None:
        check_finite("The volume", self.ml)

    @property
    def volume(self) -> float:
        """Volume in the cup [m^3]."""
        return ML * self.ml


class Remove(Command, Request, frozen=True):
    """Remove an object; a held object stays.

    Attributes:
        name: Name of the object.
    """

    traits: ClassVar[Traits] = SCENE_TRAITS

    name: Name


class MoveObject(Command, frozen=True, eq=False):
    """Move or turn the object of that name; a held object stays.

    Attributes:
        name: name of the object.
        position: (3,) [m] of its frame in the base frame; None to keep its position.
        R: (3, 3) rotation of its frame in the base frame; None to keep its rotation.
    """

    traits: ClassVar[Traits] = MOVING_TRAITS

    name: str
    position: FloatArray | None = None
    R: FloatArray | None = None

    def __post_init__(self) -> None:
        if self.position is not None:
            position = vector(f"The position of {self.name!r}", self.position, 3)
            if np.abs(position).max() > MAX_COORDINATE:
                raise InputError(f"{self.name!r} would be more than {MAX_COORDINATE:g} m away.")
            force_setattr(self, "position", position)
        if self.R is not None:
            R = so3.validated(self.R, f"The rotation of {self.name!r}")
            force_setattr(self, "R", frozen(R))


class Attach(Command, Request, frozen=True, eq=False):
    """Fix an object to the hand, for example a camera or a tool, or release it to the world.

    Attributes:
        name: Name of the object.
        to: Body to which the object is fixed.
        T: (4, 4) Pose on the hand, in the frame of the arm's default tool. Without it the object
            stays where it is.
    """

    traits: ClassVar[Traits] = MOVING_TRAITS

    name: Name
    to: Attachment
    T: Transform | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.to, Attachment):
            raise InputError(f"`to` must be one of {list(Attachment)}, not {self.to!r}.")
        if self.T is not None:
            se3.validated(self.T)
            force_setattr(self, "T", frozen(self.T))


class ReplaceScene(Command, frozen=True, eq=False):
    """Replace all objects and the water in one step; a held object stays, and keeps its name.

    Attributes:
        objects: the new objects.
        volume: volume in the cup [m^3]; None for no water anywhere.
    """

    traits: ClassVar[Traits] = SCENE_TRAITS

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
