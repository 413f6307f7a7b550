"""The solid of a mesh for collision checks, and the appearance of an object."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from katana450.errors import InputError
from katana450.maths.geometry.arrays import FloatArray, finite_array, frozen

MAX_CORNERS = 64
"""Maximum number of corners: such a body is measured as quickly as any link."""

MAX_KEY_LENGTH = 64

MIN_OPACITY = 0.05
"""Minimum opacity; an invisible object is ``ObjectAppearance.hidden`` instead."""

Colour = tuple[int, int, int]
"""Red, green and blue, each from 0 to 255."""


@dataclass(frozen=True, eq=False)
class Solid:
    """A mesh without its triangles, which stay with the view so that a state is small.

    Attributes:
        key: identifies the triangles by their content.
        size: of their bounding box along the axes [m].
        corners: (k, 3) corners of a convex body around them [m]. z = 0 is its underside, and the z
            axis goes through the middle of the box.
    """

    key: str
    size: tuple[float, float, float]
    corners: FloatArray

    def __post_init__(self) -> None:
        if not (self.key.isalnum() and len(self.key) <= MAX_KEY_LENGTH):
            raise InputError(
                f"The key of a mesh must be at most {MAX_KEY_LENGTH} letters and digits."
            )
        size = finite_array(self.size, (3,), "The size of a mesh")
        if size.min() < 0.0 or size.max() <= 0.0:
            raise InputError(f"The size of a mesh must be three lengths, not {self.size}.")
        x, y, z = size.tolist()
        object.__setattr__(self, "size", (x, y, z))
        corners = np.asarray(self.corners, dtype=np.float64)
        if not 4 <= len(corners) <= MAX_CORNERS:
            raise InputError(f"A mesh must have 4 to {MAX_CORNERS} corners, not {len(corners)}.")
        corners = finite_array(corners, (len(corners), 3), "The corners of a mesh")
        object.__setattr__(self, "corners", frozen(corners))


@dataclass(frozen=True)
class ObjectAppearance:
    """Appearance of an object.

    Attributes:
        colour: the colour; None for the colours of the object itself.
        opacity: from MIN_OPACITY to 1, which is solid.
        hidden: whether it is not drawn. A hidden object still counts in collision checks.
    """

    colour: Colour | None = None
    opacity: float = 1.0
    hidden: bool = False

    def __post_init__(self) -> None:
        if self.colour is not None and not (
            len(self.colour) == 3 and all(type(c) is int and 0 <= c <= 255 for c in self.colour)
        ):
            raise InputError(
                f"A colour must be three whole numbers from 0 to 255, not {self.colour}."
            )
        if not MIN_OPACITY <= self.opacity <= 1.0:
            raise InputError(f"An opacity must be from {MIN_OPACITY} to 1, not {self.opacity}.")


PLAIN = ObjectAppearance()
"""The default appearance of an object."""
