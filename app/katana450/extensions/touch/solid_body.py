"""The convex body of a held object, and its weight and inertia against the friction of fingers."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from katana450.arm.control.objects.pouring import is_vessel
from katana450.arm.control.objects.support import surface_below
from katana450.arm.control.state.scene_objects import MAX_OBJECTS, SceneObject, Shape
from katana450.arm.control.state.state import State
from katana450.extensions.convex_body import hull_faces
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.water.units import DENSITY as WATER_DENSITY
from katana450.maths.water.units import FEMTOLITRE


@dataclass(frozen=True, eq=False)
class SolidBody:
    """A convex body about its own middle: a part of half-spaces, a cylinder and a ball.

    A point x is inside if n @ x <= h for each plane, if it is nearer to the axis z than the radius
    of the cylinder, and nearer to the middle than that of the ball.

    Attributes:
        normals: (m, 3) outward unit normals n.
        heights: (m,) heights h [m].
        cylinder: radius about z [m]; None without this bound.
        ball: radius about the middle [m]; None without this bound.
        volume: [m^3].
    """

    normals: FloatArray
    heights: FloatArray
    volume: float
    cylinder: float | None = None
    ball: float | None = None

    def depth(self, points: FloatArray) -> FloatArray:
        """Return the distance (n,) of each point (n, 3) inside to the nearest face [m].

        It is negative outside: there it is the distance to the farthest of the planes.
        """
        depth = np.full(len(points), np.inf)
        if len(self.normals):
            depth = (self.heights - points @ self.normals.T).min(axis=1)
        if self.cylinder is not None:
            depth = np.minimum(depth, self.cylinder - np.hypot(points[:, 0], points[:, 1]))
        if self.ball is not None:
            depth = np.minimum(depth, self.ball - np.sqrt(np.einsum("ij,ij->i", points, points)))
        return depth


def body_of(scene_object: SceneObject) -> SolidBody:
    """Return the body of ``scene_object`` about the middle of its collision shape."""
    size = scene_object.extent
    match scene_object.shape:
        case Shape.BOX:
            x, y, z = size
            normals = np.concatenate((np.eye(3), -np.eye(3)))
            return SolidBody(frozen(normals), frozen(0.5 * np.array((*size, *size))), x * y * z)
        case Shape.CYLINDER | Shape.VESSEL:
            radius, height = size
            normals = np.array(((0.0, 0.0, 1.0), (0.0, 0.0, -1.0)))
            volume = np.pi * radius**2 * height
            return SolidBody(frozen(normals), frozen((0.5 * height,) * 2), volume, cylinder=radius)
        case Shape.SPHERE:
            (radius,) = size
            volume = 4.0 / 3.0 * np.pi * radius**3
            return SolidBody(frozen(np.empty((0, 3))), frozen(()), volume, ball=radius)
    assert scene_object.solid is not None
    corners = scene_object.solid.corners.tobytes()
    return _hull(corners, scene_object.scale, 0.5 * scene_object.height)


@lru_cache(maxsize=2 * MAX_OBJECTS)
def _hull(corners: bytes, scale: float, middle: float) -> SolidBody:
    """Return the body of a mesh about its middle, from the triangles of its convex hull."""
    points = scale * np.frombuffer(corners).reshape(-1, 3) - (0.0, 0.0, middle)
    normals, heights, areas = hull_faces(points)
    volume = float(heights @ areas) / 3.0
    planes = np.round(np.column_stack((normals, heights)), 9) + 0.0
    _, first = np.unique(planes, axis=0, return_index=True)
    return SolidBody(frozen(normals[first]), frozen(heights[first]), volume)


FRICTION = 0.8
"""[1] Coefficient of friction between a pad and an object: rubber on smooth plastic. Assumed."""

DENSITY = 500.0
"""[kg/m^3] Density of an object of unknown mass: light wood, or a printed part that is not solid.
Assumed."""

VESSEL_DENSITY = 212.0
"""[kg/m^3] Mass of an empty vessel over the volume in its outline: that of the cup."""

SLIDING_RESISTANCE = 20.0
"""[N s/m] Growth of the friction with the speed of an object that slides. Assumed: the friction of
rubber grows with speed, and the cup, held by almost no force, slides at 30 mm/s."""

MAX_SLIDING_SPEED = 0.2
"""[m/s] Maximum speed of an object that slides. Assumed."""

STEP = 1e-3
"""[s] Step of the difference that gives the acceleration."""


def mass(scene_object: SceneObject, state: State, masses: Mapping[str, float]) -> float:
    """Return the mass of ``scene_object`` [kg], for a vessel with what is in it.

    ``masses``: known masses [kg] by name; another object has DENSITY.
    """
    known = masses.get(scene_object.name)
    if known is None:
        density = VESSEL_DENSITY if is_vessel(scene_object) else DENSITY
        known = density * body_of(scene_object).volume
    poured = state.poured
    water = None if poured is None else poured.water.vessel(scene_object.name)
    return known + WATER_DENSITY * FEMTOLITRE * water.kept if water else known


def acceleration(
    state: State, point: FloatArray, palm: Callable[[FloatArray], FloatArray]
) -> FloatArray:
    """Return the acceleration (3,) of a point of the hand by the setpoints [m/s^2].

    Args:
        state: the state.
        point: (3,) in the frame of the palm [m].
        palm: returns the pose (4, 4) of the palm in the base frame at x (k,).
    """
    motion = state.motion
    if motion.at_rest:
        return np.zeros(3)

    def place(t: float) -> FloatArray:
        q = motion.q + t * motion.qd + 0.5 * t * t * motion.qdd
        T = palm(np.append(q, state.gripper_setpoint))
        return np.asarray(T[:3, :3] @ point + T[:3, 3])

    return (place(STEP) - 2.0 * place(0.0) + place(-STEP)) / STEP**2


def along_pads(load: FloatArray, axis: FloatArray) -> FloatArray:
    """Return the part (3,) of ``load`` (3,) [N] across ``axis`` (3,), the unit closing direction.

    The other part presses the object against a finger and needs no friction.
    """
    return load - (load @ axis) * axis


def sliding_speed(excess: float) -> float:
    """Return the speed [m/s] of an object whose load is beyond its friction by ``excess`` [N]."""
    return min(max(excess, 0.0) / SLIDING_RESISTANCE, MAX_SLIDING_SPEED)


def height_above_support(state: State, held: SceneObject, T_base_object: FloatArray) -> float:
    """Return the height [m] of the ``held`` object above what would carry it."""
    standing = replace(held, T=T_base_object, held=False)
    return float(T_base_object[2, 3] - surface_below(state.objects, standing))
