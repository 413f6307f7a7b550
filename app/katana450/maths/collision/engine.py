"""The library that measures distances: coal, or FCL where coal has no wheel (Windows)."""

from __future__ import annotations

from functools import cache
from importlib.util import find_spec
from typing import Any, Protocol

from katana450.maths.collision.contact import Witness
from katana450.maths.geometry.arrays import FloatArray


class Engine(Protocol):
    """Convex geometries and the distances between them.

    Geometries and transforms are opaque and valid only for the engine that made them.
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
        """Return the half-space z <= 0."""

    def transform(self, T: FloatArray) -> Any:
        """Return the pose ``T`` (4, 4) [m] in the form of the engine."""

    def distance(self, one: Any, T_one: Any, other: Any, T_other: Any) -> float:
        """Return the distance between two geometries [m]; a negative value is their depth."""

    def witness(self, one: Any, T_one: Any, other: Any, T_other: Any) -> Witness:
        """Return the nearest points of two geometries."""

    def triangles(self, points: FloatArray) -> FloatArray:
        """Return the corners (m, 3, 3) of the triangles of the hull of ``points`` (n, 3)."""


def library() -> str:
    """Return the name of the library, which need not be loaded for it."""
    return "fcl" if find_spec("coal") is None else "coal"


@cache
def engine() -> Engine:
    """Return the engine of this process. Raises ImportError without coal and python-fcl."""
    if library() == "coal":
        from katana450.maths.collision.coal_engine import CoalEngine

        return CoalEngine()
    from katana450.maths.collision.fcl_engine import FclEngine

    return FclEngine()
