"""The commands about what stands around, the water in it, and how it is shown: no joint moves."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from katana450.arm.control.checked import check_finite, vector
from katana450.arm.control.looks import AS_MADE, LONGEST_NAME, Trait
from katana450.arm.control.things import FARTHEST, MOST, Mount, Thing
from katana450.arm.control.traits import BaseCommand, Traits
from katana450.errors import InputError
from katana450.maths.geometry import so3
from katana450.maths.geometry.arrays import FloatArray, frozen

SCENE_TRAITS = Traits(while_stopped=True, supersedes=False, passive=True)
"""Traits of the commands about objects and water."""


@dataclass(frozen=True)
class Place(BaseCommand):
    """Put a thing where it says, in place of one of its name; what is held stays in the hand."""

    traits: ClassVar[Traits] = SCENE_TRAITS

    thing: Thing

    def __post_init__(self) -> None:
        if not isinstance(self.thing, Thing) or self.thing.held:
            raise InputError(f"What is put somewhere is a thing out of the hand, not {self.thing}.")


@dataclass(frozen=True)
class Fill(BaseCommand):
    """Fill the cup with ``volume`` [m^3] of water, and wipe up what is elsewhere."""

    traits: ClassVar[Traits] = SCENE_TRAITS

    volume: float

    def __post_init__(self) -> None:
        check_finite("The volume", self.volume)


@dataclass(frozen=True)
class Remove(BaseCommand):
    """Take the thing of that name away; what is held stays."""

    traits: ClassVar[Traits] = SCENE_TRAITS

    name: str


@dataclass(frozen=True, eq=False)
class Shift(BaseCommand):
    """Put the thing of that name elsewhere, or turn it; what is held stays.

    position: (3,) [m], R: (3, 3), of its frame in the base; None to keep what it has.
    """

    traits: ClassVar[Traits] = SCENE_TRAITS

    name: str
    position: FloatArray | None = None
    R: FloatArray | None = None

    def __post_init__(self) -> None:
        if self.position is not None:
            position = vector(f"The position of {self.name!r}", self.position, 3)
            if np.abs(position).max() > FARTHEST:
                raise InputError(f"{self.name!r} would be more than {FARTHEST:g} m away.")
            object.__setattr__(self, "position", position)
        if self.R is not None:
            R = so3.validated(self.R, f"The rotation of {self.name!r}")
            object.__setattr__(self, "R", frozen(R))


@dataclass(frozen=True)
class Dress(BaseCommand):
    """Change one trait of how the link or thing ``name`` is shown; see ``Look.having``."""

    traits: ClassVar[Traits] = Traits(
        while_stopped=True, supersedes=False, passive=True, joints_only=True
    )

    name: str
    trait: Trait
    value: float | tuple[float, ...] | None

    def __post_init__(self) -> None:
        if not (isinstance(self.name, str) and 0 < len(self.name) <= LONGEST_NAME):
            raise InputError(
                f"A part's name has 1 to {LONGEST_NAME} characters, not {self.name!r}."
            )
        AS_MADE.having(self.trait, self.value)


@dataclass(frozen=True)
class Attach(BaseCommand):
    """Fix the thing of that name to the hand, or to the world again; what is held stays."""

    traits: ClassVar[Traits] = SCENE_TRAITS

    name: str
    to: Mount

    def __post_init__(self) -> None:
        if not isinstance(self.to, Mount):
            raise InputError(f"A thing is fixed to one of {list(Mount)}, not {self.to!r}.")


@dataclass(frozen=True, eq=False)
class Furnish(BaseCommand):
    """Have these things about and no others, at one go; what is held stays, as the only one of its
    name. ``volume``: of water in the cup [m^3]; None for no water anywhere."""

    traits: ClassVar[Traits] = SCENE_TRAITS

    things: tuple[Thing, ...]
    volume: float | None = None

    def __post_init__(self) -> None:
        names = {thing.name for thing in self.things}
        if len(names) < len(self.things) or len(names) > MOST:
            raise InputError(f"A scene has up to {MOST} things, each with a name of its own.")
        if any(thing.held for thing in self.things):
            raise InputError("What is put somewhere is a thing out of the hand.")
        if self.volume is not None:
            check_finite("The volume", self.volume)
