"""The library that measures distances: coal, or FCL where coal has no wheel (Windows)."""

from __future__ import annotations

from functools import cache
from importlib.util import find_spec
from typing import Any, NamedTuple, Protocol

from katana450.maths.geometry.arrays import FloatArray


class Witness(NamedTuple):
    """The nearest points of two bodies.

    Attributes:
        distance: between them [m]; negative is how deep they are in each other.
        points: (2, 3) the nearest point of each [m].
        normal: (3,) unit direction from the first body to the second.
    """

    distance: float
    points: FloatArray
    normal: FloatArray


class Engine(Protocol):
    """Convex geometries and the distances between them.

    Geometries and transforms of one engine are opaque to everybody else, and are not understood by
    another engine.
    """

    def hull(self, corners: FloatArray) -> Any:
        """Return the convex hull of ``corners`` (n, 3) [m], which span a volume."""

    def box(self, size: FloatArray) -> Any:
        """Return a box of ``size`` (3,) [m] about its middle."""

    def cylinder(self, radius: float, length: float) -> Any:
        """Return a cylinder along z about its middle [m]."""

    def sphere(self, radius: float) -> Any:
        """Return a sphere about its middle [m]."""

    def half_space(self) -> Any:
        """Return everything with z <= 0."""

    def transform(self, T: FloatArray) -> Any:
        """Return the pose ``T`` (4, 4) [m] in the form that the engine takes."""

    def distance(self, one: Any, T_one: Any, other: Any, T_other: Any) -> float:
        """Return the distance between two geometries [m]; negative is their depth."""

    def witness(self, one: Any, T_one: Any, other: Any, T_other: Any) -> Witness:
        """Return the nearest points of two geometries."""

    def triangles(self, points: FloatArray) -> FloatArray:
        """Return the corners (m, 3, 3) of the triangles of the hull of ``points`` (n, 3)."""


@cache
def engine() -> Engine:
    """Return the engine of this process. Raises ImportError without coal and python-fcl."""
    if find_spec("coal") is not None:
        from katana450.maths.collision.coal_engine import CoalEngine

        return CoalEngine()
    from katana450.maths.collision.fcl_engine import FclEngine

    return FclEngine()
