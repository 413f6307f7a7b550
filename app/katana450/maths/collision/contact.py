"""The nearest points of two bodies, and of two parts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from katana450.maths.geometry.arrays import FloatArray


class Witness(NamedTuple):
    """The nearest points of two bodies.

    Attributes:
        distance: distance between them [m]; a negative value is their depth.
        points: the nearest point of each, (2, 3) [m].
        normal: unit direction (3,) from the first body to the second.
    """

    distance: float
    points: FloatArray
    normal: FloatArray


@dataclass(frozen=True, eq=False)
class Contact:
    """The nearest points of two parts.

    Attributes:
        parts: the names of the parts.
        distance: distance between them [m]; a negative value is their depth.
        points: the nearest point of each, (2, 3) in the base frame [m].
        normal: unit direction (3,) from the first part to the second, in the base frame.
    """

    parts: tuple[str, str]
    distance: float
    points: FloatArray
    normal: FloatArray
