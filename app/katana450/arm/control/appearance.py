"""How links and objects are shown where that is not as they are made. Nothing moves by it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum

from katana450.errors import InputError
from katana450.maths.geometry.arrays import finite_array

MAX_CHANGED_PARTS = 256
"""Parts at a time that look otherwise than they are made."""

MAX_NAME_LENGTH = 100

Colour = tuple[float, float, float]
"""Red, green and blue in sRGB, 0..1."""


class DisplayMode(Enum):
    """What is shown of a part, as the Switch of its VRML file counts it."""

    HIDDEN = -1
    MADE = 0
    """What it is made of."""
    PAINTED = 1
    """All of it in one colour."""


class AppearanceTrait(Enum):
    """What can be changed."""

    CHOICE = "choice"
    COLOUR = "colour"
    TRANSPARENCY = "transparency"


@dataclass(frozen=True)
class LinkAppearance:
    """Of one part.

    Attributes:
        choice: what is shown of it.
        colour: of its paint; None for that of most of what it is made of.
        transparency: of its paint: 0 lets nothing through, 1 everything.
    """

    choice: DisplayMode = DisplayMode.MADE
    colour: Colour | None = None
    transparency: float = 0.0

    def having(
        self, trait: AppearanceTrait, value: float | tuple[float, ...] | None
    ) -> LinkAppearance:
        """With one ``trait`` changed: None for as it is made.

        Who changes the paint wants to see it, unless the part is hidden; without a paint of its
        own left it is shown as it is made. Raises InputError.
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
    """Of all parts: ``changed`` has name and look of those that do not look as they are made."""

    changed: tuple[tuple[str, LinkAppearance], ...] = ()

    def of(self, name: str) -> LinkAppearance:
        """That of the link or object ``name``."""
        return next((look for each, look in self.changed if each == name), AS_MADE)

    def having(
        self, name: str, trait: AppearanceTrait, value: float | tuple[float, ...] | None
    ) -> Appearance:
        """The same but for one trait of ``name``; see ``LinkAppearance.having``.

        As they are when MOST look otherwise already.
        """
        others = self.without(name)
        look = self.of(name).having(trait, value)
        if look == AS_MADE:
            return others
        room = len(others.changed) < MAX_CHANGED_PARTS
        return Appearance((*others.changed, (name, look))) if room else self

    def without(self, name: str) -> Appearance:
        """With ``name`` as it is made."""
        return Appearance(tuple(each for each in self.changed if each[0] != name))


ALL_AS_MADE = Appearance()


def _choice(value: object) -> DisplayMode:
    try:
        return DisplayMode(value)
    except ValueError:
        raise InputError(
            f"A choice is -1 for hidden, 0 for as it is made, 1 for painted, not {value!r}."
        ) from None


def _colour(value: object) -> Colour:
    red, green, blue = _fractions("A colour", value, 3)
    return red, green, blue


def _fractions(what: str, value: object, size: int) -> list[float]:
    fractions: list[float] = finite_array(value, (size,), what).tolist()  # type: ignore[arg-type]
    if not all(0.0 <= fraction <= 1.0 for fraction in fractions):
        raise InputError(f"{what} has numbers from 0 to 1, not {fractions}.")
    return fractions
