"""Distances between convex bodies, measured by MuJoCo.

MuJoCo measures distances between geoms of a compiled model, at the poses that its data hold. Here a
model of unused geoms is compiled once, and the bodies of a world are written into it when they are
measured. So an object that is added needs no compilation.
"""

from __future__ import annotations

import ctypes
import re
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from copy import copy
from dataclasses import dataclass, field, replace
from functools import cache, lru_cache
from importlib.resources import files
from math import hypot
from typing import Any, Final, NamedTuple

import numpy as np

from katana450.caching import cached_property
from katana450.maths.geometry.arrays import FloatArray, frozen


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


GEOMETRIES, VERTICES = 512, 32768
"""Number of geometries that a thread keeps, and of all their vertices. Then it starts again."""

TOLERANCE = 1e-9
"""Tolerance [m] of a search for bodies that are not both polyhedra."""

ITERATIONS = 200
"""Maximum number of iterations of a search."""

ARENA = 1 << 20
"""Memory of a search [bytes], of which ITERATIONS need a sixth."""

FAR = ctypes.c_double(1e10)
"""Distance [m] that no bodies have."""

LIBRARY = re.compile(r"(lib)?mujoco(\.[0-9.]+)?\.(so|dll|dylib)([0-9.]*)")
"""Name of the file of the library."""

KINDS: Final = {"half-space": 0, "sphere": 2, "cylinder": 5, "box": 6, "hull": 7}
"""Each kind of geometry, and its number in MuJoCo (mjtGeom)."""

TOUCHING = 2e-9
"""Distances [m] as small as this are measured again: a search also ends so between two bodies with
the same middle.
"""

ASIDE = frozen((3e-9, -5e-9, 7e-9))
"""Motion [m] of a body before it is measured again."""

STEP = 1e-5
"""Motion [m] of a body that shows the normal of a contact."""

SHORT = 1e-7
"""Nearest points closer than this [m] give no direction."""

MANY_POINTS = 1000
"""Number of points from which those inside the hull are removed, because each is looked at."""


@dataclass(frozen=True, eq=False)
class Geometry:
    """A convex body about its own middle.

    Attributes:
        kind: one of KINDS.
        size: (3,) the size of the geom [m].
        points: (n, 3) points whose hull a mesh is [m]; none for others.
    """

    kind: str
    size: tuple[float, float, float] = (0.0, 0.0, 0.0)
    points: FloatArray = field(default_factory=lambda: np.empty((0, 3)))

    @cached_property
    def vertices(self) -> FloatArray:
        """The corners (k, 3) of a mesh, and perhaps points inside it [m]."""
        points = self.points
        if len(points) < MANY_POINTS:
            return points
        return np.asarray(points[np.unique(hull_triangles(points))])


@dataclass(frozen=True, eq=False)
class Placement:
    """Geometries at their places.

    Attributes:
        geometries: the geometries; the same tuple for other places of the same geometries.
        positions: (b, 3) the middle of each [m].
        rotations: (b, 9) the rotation of each, row by row.
    """

    geometries: tuple[Geometry, ...]
    positions: FloatArray
    rotations: FloatArray

    def moved(self, number: int, step: FloatArray) -> Placement:
        """Return the placement with one geometry moved by ``step`` (3,) [m]."""
        positions = self.positions.copy()
        positions[number] += step
        return replace(self, positions=positions)


def distance(placement: Placement, one: int, other: int) -> float:
    """Return the distance between two geometries [m]; a negative value is their depth.

    ``one`` and ``other`` are their numbers in ``placement``.
    """
    return _BENCHES.bench.distance(placement, one, other)


def witness(placement: Placement, one: int, other: int) -> Witness:
    """Return the nearest points of two geometries; the arguments are those of ``distance``."""
    gap = distance(placement, one, other)
    (x, y, z), (x_other, y_other, z_other) = points = _BENCHES.bench.points.tolist()
    direction: tuple[float, ...] = x_other - x, y_other - y, z_other - z
    if gap < 0.0:
        direction = x - x_other, y - y_other, z - z_other
    if abs(gap) <= SHORT:
        # The distance grows fastest along the normal.
        direction = tuple(
            distance(placement.moved(other, step), one, other)
            - distance(placement.moved(other, -step), one, other)
            for step in STEP * np.eye(3)
        )
    length = hypot(*direction)
    normal = [part / length for part in direction] if length > 0.0 else (0.0, 0.0, 1.0)
    return Witness(gap, frozen(points), frozen(normal))


def load(geometries: tuple[Geometry, ...]) -> None:
    """Load MuJoCo and prepare ``geometries``, so that no later distance in this thread waits."""
    _BENCHES.bench.choose(geometries)


def hull_triangles(points: FloatArray, corners: int = -1) -> Any:
    """Return the indices (m, 3) of ``points`` (n, 3) that are the triangles of their hull.

    The points span a volume. A triangle has its corners in any order. After so many ``corners``,
    if they are given, the search ends with the hull of those that were found, farthest ones first.
    """
    import mujoco

    low, high = points.min(axis=0), points.max(axis=0)
    scaled = (points - 0.5 * (low + high)) / (high - low).max()
    spec = mujoco.MjSpec()
    # The inertia of a surface, because that of a solid is refused for flat ones.
    shell = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
    spec.add_mesh(name="hull", uservert=scaled.ravel(), inertia=shell, maxhullvert=corners)
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname="hull")
    graph = spec.compile().mesh_graph
    return graph[-3 * graph[1] :].reshape(-1, 3).copy()


class _Bench:
    """The model and data of one thread, and the geometries that are written into it.

    Attributes:
        points: (2, 3) the nearest points of the geometries that were measured last [m].
    """

    def __init__(self) -> None:
        self.points = np.zeros((2, 3))
        self._points = ctypes.c_void_p(self.points.ctypes.data)
        self._function = _function()
        self._start(GEOMETRIES, VERTICES)

    def _start(self, geometries: int, vertices: int) -> None:
        """Begin with a new model that has room for so many."""
        import mujoco

        self._model = copy(_empty_model(geometries, vertices))
        self._data = mujoco.MjData(self._model)
        # As C expects them, because each call converts them otherwise.
        self._addresses = addresses(self._model, self._data)
        self._positions, self._rotations = self._data.geom_xpos, self._data.geom_xmat
        self._forget()

    def _forget(self) -> None:
        """Forget all geometries."""
        self._meshes: dict[Geometry, int] = {}
        self._used = 0
        self._placement: Placement | None = None
        self._geometries: tuple[Geometry, ...] = ()

    def distance(self, placement: Placement, one: int, other: int) -> float:
        """Return the distance [m], and keep the nearest ``points``."""
        if placement is not self._placement:
            self._place(placement)
        gap: float = self._function(*self._addresses, one, other, FAR, self._points)
        if -TOUCHING <= gap <= TOUCHING:
            gap = self._checked(gap, placement, one, other)
        if gap >= FAR.value:
            raise ArithmeticError("A distance was asked of a pose that is not finite.")
        return gap

    def _checked(self, gap: float, placement: Placement, one: int, other: int) -> float:
        """Return ``gap`` if the bodies are no deeper in each other a bit aside, else the depth."""
        self._place(placement.moved(other, ASIDE))
        depth: float = self._function(*self._addresses, one, other, FAR, self._points)
        return depth if depth < -SHORT else gap

    def _place(self, placement: Placement) -> None:
        if placement.geometries is not self._geometries:
            self.choose(placement.geometries)
        count = len(placement.geometries)
        self._positions[:count] = placement.positions
        self._rotations[:count] = placement.rotations
        self._placement = placement

    def choose(self, geometries: tuple[Geometry, ...]) -> None:
        """Make the first geoms those of ``geometries``."""
        new = dict.fromkeys(shape for shape in geometries if shape not in self._meshes)
        vertices = sum(len(shape.vertices) for shape in new)
        model, count = self._model, len(geometries)
        if (
            count > model.ngeom
            or len(self._meshes) + len(new) > model.nmesh
            or (self._used + vertices > model.nmeshvert)
        ):
            self._forget()
            new = dict.fromkeys(geometries)
            vertices = sum(len(shape.vertices) for shape in new)
            if count > model.ngeom or vertices > model.nmeshvert:
                # With room for objects to come.
                self._start(max(GEOMETRIES, 2 * count), max(VERTICES, 2 * vertices))
                model = self._model
        for geometry in new:
            self._add(geometry)
        model.geom_type[:count] = [KINDS[shape.kind] for shape in geometries]
        model.geom_size[:count] = [shape.size for shape in geometries]
        model.geom_dataid[:count] = [self._meshes[shape] for shape in geometries]
        self._geometries = geometries

    def _add(self, geometry: Geometry) -> None:
        """Write the vertices of ``geometry`` as the next mesh."""
        model, mesh = self._model, len(self._meshes)
        start, end = self._used, self._used + len(geometry.vertices)
        model.mesh_vert[start:end] = geometry.vertices
        model.mesh_vertadr[mesh], model.mesh_vertnum[mesh] = start, end - start
        self._meshes[geometry], self._used = mesh, end


class _Benches(threading.local):
    """The bench of each thread, because it is changed for each distance."""

    @cached_property
    def bench(self) -> _Bench:
        return _Bench()


_BENCHES = _Benches()


@lru_cache(maxsize=2)
def _empty_model(count: int, vertices: int) -> Any:
    """Return a model with room for ``count`` geometries and ``vertices`` together.

    Its meshes meet nothing, so MuJoCo makes no hulls of them, and looks at each vertex of a mesh.
    """
    import mujoco

    spec = mujoco.MjSpec()
    spec.memory = ARENA
    spec.option.ccd_tolerance, spec.option.ccd_iterations = TOLERANCE, ITERATIONS
    corners = np.eye(4, 3).ravel()
    faces = np.array((0, 2, 1, 0, 1, 3, 1, 2, 3, 0, 3, 2))
    shell = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
    for number in range(count):
        name = str(number)
        points = corners if number else np.append(corners, np.zeros(3 * vertices))
        spec.add_mesh(name=name, uservert=points, userface=faces, inertia=shell)
        spec.worldbody.add_geom(
            type=mujoco.mjtGeom.mjGEOM_MESH, meshname=name, contype=0, conaffinity=0
        )
    return spec.compile()


def addresses(*structs: Any) -> tuple[ctypes.c_void_p, ...]:
    """Return the addresses of structs of MuJoCo, as its functions of C expect them."""
    return tuple(ctypes.c_void_p(struct._address) for struct in structs)


@cache
def library() -> Any:
    """Return the library of MuJoCo, whose functions keep the lock of the interpreter.

    Those of its Python package give it away. A control loop that does so for a microsecond may wait
    5 ms for it while another thread plans.
    """
    import mujoco

    file = next(file for file in files(mujoco).iterdir() if LIBRARY.fullmatch(file.name))
    return ctypes.PyDLL(str(file))


@cache
def _function() -> Any:
    """Return the function of MuJoCo that measures a distance."""
    function = library().mj_geomDistance
    function.restype = ctypes.c_double
    return function


@contextmanager
def silence() -> Iterator[None]:
    """Keep MuJoCo from writing warnings to the console and to a file in the working folder."""
    import mujoco

    usual, config = mujoco.MjLogConfig.get(), mujoco.MjLogConfig.get()
    config.logto_console = config.logto_file = False
    config.set()
    try:
        yield
    finally:
        usual.set()
