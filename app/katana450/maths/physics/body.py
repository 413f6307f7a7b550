"""A body that moves freely, and the motion of all such bodies."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from katana450.maths.collision.engine import hull_triangles
from katana450.maths.collision.shape import CollisionShape
from katana450.maths.geometry.arrays import FloatArray, frozen

BoolArray = npt.NDArray[np.bool_]

REST_TIME = 0.25
"""[s] Time for which a body must be slow until it counts as at rest."""


@dataclass(frozen=True, eq=False)
class RigidBody:
    """A body of convex pieces.

    Attributes:
        name: unique among the bodies and parts of a scene.
        shapes: its convex pieces.
        T_body_shape: pose (4, 4) of each piece in the frame of the body [m].
        mass: [kg], spread evenly over the volume of the pieces.
        friction: coefficient of Coulomb friction [1]. Between two bodies the greater one counts.
    """

    name: str
    shapes: tuple[CollisionShape, ...]
    T_body_shape: tuple[FloatArray, ...]
    mass: float
    friction: float


class FingerContact(NamedTuple):
    """The contact of a finger, or of the palm, with a body.

    Attributes:
        finger, body: names of the part and the body.
        force: sum of the normal forces [N].
        friction: length of the sum of the tangential forces [N].
    """

    finger: str
    body: str
    force: float
    friction: float


@dataclass(frozen=True, eq=False)
class BodyMotion:
    """The motion of all free bodies of a scene.

    It is all that the engine remembers, so that equal motions continue with equal bits.

    Attributes:
        names: names of the bodies.
        place: (b, 7) position [m] and quaternion of each body.
        velocity: (b, 6) linear velocity [m/s] in the base frame, and angular velocity [rad/s] in
            the frame of the body.
        memory: (k,) accelerations from which the engine begins its search for the next forces.
        rest_time: (b,) time for which each body has been slow [s].
        fingers: (f, 2) place and velocity of the joint of each finger [rad or m]; (0, 2) while none
            of them touches a body: they are at their setpoint then.
        contacts: the contacts of the fingers with bodies.
    """

    names: tuple[str, ...]
    place: FloatArray
    velocity: FloatArray
    memory: FloatArray
    rest_time: FloatArray
    fingers: FloatArray = field(default_factory=lambda: frozen(np.empty((0, 2))))
    contacts: tuple[FingerContact, ...] = ()

    @property
    def resting(self) -> BoolArray:
        """(b,) True for a body at rest: it stays where it is until something wakes it."""
        return np.asarray(self.rest_time >= REST_TIME)


def volume(shape: CollisionShape) -> float:
    """Return the volume of a shape [m^3]."""
    geometry = shape.geometry
    a, b, c = geometry.size
    match geometry.kind:
        case "sphere":
            return 4.0 / 3.0 * np.pi * a**3
        case "cylinder":
            return 2.0 * np.pi * a**2 * b
        case "box":
            return 8.0 * a * b * c
    points = geometry.points
    corners = points[hull_triangles(points)]
    return float(np.abs(np.linalg.det(corners)).sum()) / 6.0
