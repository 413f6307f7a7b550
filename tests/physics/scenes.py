"""Scenes of free bodies without an arm, and what they do in ticks of 10 ms."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np

from katana450.maths.collision.linkage import Linkage, RigidGroup
from katana450.maths.collision.shape import CollisionShape, box, half_space
from katana450.maths.collision.world import Part, obstacle
from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.physics.model import BodyMotion, RigidBody
from katana450.maths.physics.simulation import BodySimulation
from tests.ticks import TICK

SIDE = 0.05
"""[m] Length of a side of the usual box."""

HALF = 0.5 * SIDE
CUBE = box((SIDE, SIDE, SIDE))

MAX_GRIP = 1e-4
"""[m] Motion of a body that stands still."""

TABLE = obstacle("table", np.eye(4), half_space())


def pose(x: float, y: float, z: float, R: FloatArray | None = None) -> FloatArray:
    return se3.from_rotation_translation(np.eye(3) if R is None else R, (x, y, z))


def body(
    name: str, shape: CollisionShape = CUBE, mass: float = 0.1, friction: float = 0.5
) -> RigidBody:
    """Return a body of one piece about its origin."""
    return RigidBody(name, (shape,), (np.eye(4),), mass, friction)


def slope(angle: float) -> Part:
    """Return the ground, falling along x by ``angle`` [rad]."""
    return obstacle("slope", pose(0.0, 0.0, 0.0, so3.rotation_y(angle)), half_space())


def above_slope(angle: float, height: float) -> FloatArray:
    """Return the pose of a body that lies on a slope, with its origin ``height`` [m] above it."""
    R = so3.rotation_y(angle)
    return se3.from_rotation_translation(R, height * R[:, 2])


def downhill(angle: float) -> FloatArray:
    """Return the direction (3,) down a slope."""
    return np.asarray(so3.rotation_y(angle)[:, 0])


class Scene:
    """Bodies among parts, and a motion of them that begins awake and without speed."""

    def __init__(
        self,
        bodies: Mapping[RigidBody, FloatArray],
        *parts: Part,
        linkage: Linkage | None = None,
    ) -> None:
        self.bodies = tuple(bodies)
        self.names = [piece.name for piece in bodies]
        self.poses = {piece.name: T for piece, T in bodies.items()}
        self.simulation = BodySimulation(linkage or Linkage(()), parts or (TABLE,), self.bodies)

    def begin(self, *resting: str) -> BodyMotion:
        """Return the first motion, in which all but ``resting`` bodies are awake."""
        awake = [name for name in self.names if name not in resting]
        return self.simulation.begin(self.poses, None, (), awake)

    def motions(
        self, motion: BodyMotion, seconds: float, *, sleepless: bool = False, speed: float = 0.0
    ) -> Iterator[BodyMotion]:
        """Yield the motion after each tick.

        Args:
            motion: the first motion, which is not yielded.
            seconds: time of the whole [s].
            sleepless: True to keep all bodies awake.
            speed: speed of the only variable of the arm, from 0 on [m/s].
        """
        for tick in range(round(seconds / TICK)):
            x, towards = (np.array((speed * TICK * number,)) for number in (tick, tick + 1))
            motion = self.simulation.step(motion, x, towards, TICK)
            if sleepless:
                motion = replace(motion, rest_time=frozen(np.zeros(len(motion.names))))
            yield motion

    def after(
        self, motion: BodyMotion, seconds: float, *, sleepless: bool = False, speed: float = 0.0
    ) -> BodyMotion:
        """Return the motion after ``seconds``; the arguments are those of ``motions``."""
        return [*self.motions(motion, seconds, sleepless=sleepless, speed=speed)][-1]


def pose_of(motion: BodyMotion, name: str) -> FloatArray:
    return motion.poses[name]


def position(motion: BodyMotion, name: str) -> FloatArray:
    return np.asarray(motion.place[motion.names.index(name), :3])


def with_velocity(motion: BodyMotion, name: str, *velocity: float) -> BodyMotion:
    """Return ``motion`` with a body that moves at ``velocity`` (3,) [m/s]."""
    velocities = motion.velocity.copy()
    velocities[motion.names.index(name), :3] = velocity
    return replace(motion, velocity=frozen(velocities))


def same_bits(one: BodyMotion, other: BodyMotion) -> bool:
    """Return whether two motions are equal to the bit."""
    return one.names == other.names and all(
        getattr(one, field).tobytes() == getattr(other, field).tobytes()
        for field in ("place", "velocity", "memory", "rest_time", "fingers")
    )


def slider() -> Linkage:
    """Return a linkage with one group, which slides along x."""
    return Linkage((RigidGroup(0, np.eye(4), np.eye(3)[0], 0, slides=True),))
