"""Where two parts come nearest to each other."""

from __future__ import annotations

from dataclasses import dataclass

from katana450.maths.geometry.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class Contact:
    """The nearest points of two parts.

    Attributes:
        parts: their names.
        distance: between them [m]; negative is how deep they are in each other.
        points: (2, 3) the nearest point of each, in the base frame [m].
        normal: (3,) unit direction from the first part to the second, in the base frame.
    """

    parts: tuple[str, str]
    distance: float
    points: FloatArray
    normal: FloatArray
