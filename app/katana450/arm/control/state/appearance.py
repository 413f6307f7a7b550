"""Appearance of links and objects where it differs from how they are made; no joint moves."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum

from katana450.errors import InputError
from katana450.maths.geometry.arrays import finite_array

MAX_CHANGED_PARTS = 256
"""Maximum number of parts whose appearance is changed."""

MAX_NAME_LENGTH = 100

Colour = tuple[float, float, float]
"""Red, green and blue in sRGB, each from 0 to 1."""


class DisplayMode(Enum):
    """The display of a part, numbered as the Switch of its VRML file."""

    HIDDEN = -1
    MADE = 0
    """In the materials that it is made of."""
    PAINTED = 1
    """In one colour."""


class AppearanceTrait(Enum):
    """A trait of the appearance that can be changed."""

    CHOICE = "choice"
    COLOUR = "colour"
    TRANSPARENCY = "transparency"


@dataclass(frozen=True)
class LinkAppearance:
    """Appearance of one part.

    Attributes:
        choice: the display of the part.
        colour: colour of its paint; None for the colour of most of its material.
        transparency: of its paint, from 0 (opaque) to 1 (invisible).
    """

    choice: DisplayMode = DisplayMode.MADE
    colour: Colour | None = None
    transparency: float = 0.0

    def having(
        self, trait: AppearanceTrait, value: float | tuple[float, ...] | None
    ) -> LinkAppearance:
        """Return the appearance with one ``trait`` changed; the value None restores how it is made.

        A change of the paint also shows the paint, unless the part is hidden. A part whose paint is
        restored completely is shown as it is made. Raises InputError for an invalid value.
        """
        match trait:
            case AppearanceTrait.CHOICE:
                return replace(self, choice=_choice(0 if value is None else value))
            case AppearanceTrait.COLOUR:
                colour = None if value is None else _colour(value)
                changed = replace(self, colour=colour)
            case AppearanceTrait.TRANSPARENCY:
                (fraction,) = _fractions("A transparency", (0.0 if value is None else value,), 1)
                changed = replace(self, transparency=fraction)
        if self.choice is DisplayMode.HIDDEN:
            return changed
        plain = value is None and changed.colour is None and changed.transparency == 0.0
        return replace(changed, choice=DisplayMode.MADE if plain else DisplayMode.PAINTED)


AS_MADE = LinkAppearance()


@dataclass(frozen=True)
class Appearance:
    """Appearance of all parts.

    Attributes:
        changed: name and appearance of each part that does not look as it is made.
    """

    changed: tuple[tuple[str, LinkAppearance], ...] = ()

    def of(self, name: str) -> LinkAppearance:
        """Return the appearance of the link or object ``name``."""
        return next((appearance for key, appearance in self.changed if key == name), AS_MADE)

    def having(
        self, name: str, trait: AppearanceTrait, value: float | tuple[float, ...] | None
    ) -> Appearance:
        """Return the appearance with one trait of ``name`` changed; see ``LinkAppearance.having``.

        Returns the same if MAX_CHANGED_PARTS other parts are changed already.
        """
        others = self.without(name)
        appearance = self.of(name).having(trait, value)
        if appearance == AS_MADE:
            return others
        has_room = len(others.changed) < MAX_CHANGED_PARTS
        return Appearance((*others.changed, (name, appearance))) if has_room else self

    def without(self, name: str) -> Appearance:
        """Return the appearance with ``name`` as it is made."""
        return Appearance(tuple(change for change in self.changed if change[0] != name))


ALL_AS_MADE = Appearance()


def _choice(value: object) -> DisplayMode:
    try:
        return DisplayMode(value)
    except ValueError:
        raise InputError(
            f"A choice must be -1 for hidden, 0 for as made or 1 for painted, not {value!r}."
        ) from None


def _colour(value: object) -> Colour:
    red, green, blue = _fractions("A colour", value, 3)
    return red, green, blue


def _fractions(what: str, value: object, size: int) -> list[float]:
    fractions: list[float] = finite_array(value, (size,), what).tolist()  # type: ignore[arg-type]
    if not all(0.0 <= fraction <= 1.0 for fraction in fractions):
        raise InputError(f"{what} must have numbers from 0 to 1, not {fractions}.")
    return fractions
