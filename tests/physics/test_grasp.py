"""A body between two fingers: held up to the limit of friction, and carried without a slip."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from katana450.maths.collision.linkage import Linkage, RigidGroup
from katana450.maths.collision.shape import box
from katana450.maths.collision.world import Part
from katana450.maths.geometry import se3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.physics.model import PAD_FRICTION, BodyMotion, FingerDrive, RigidBody
from katana450.maths.physics.simulation import BodySimulation
from katana450.maths.water.units import GRAVITY
from tests.physics.scenes import CUBE, HALF, pose_of
from tests.ticks import TICK

THICK = 0.01
"""[m] Thickness of a finger."""

FORCE = 5.0
"""[N] Greatest force of each finger."""

FIRM = 2.0 * PAD_FRICTION * FORCE / GRAVITY
"""[kg] Mass of which the weight is the friction of both fingers."""


def hand() -> tuple[Linkage, tuple[Part, ...]]:
    """Return a palm that slides along z and turns about it, with two fingers that close along y.

    The variables are the height, the turn, and the distance of each finger from the middle.
    """
    _, y, z = np.eye(3)
    groups = (
        RigidGroup(0, np.eye(4), z, 0, slides=True),
        RigidGroup(1, np.eye(4), z, 1),
        RigidGroup(2, np.eye(4), y, 2, slides=True),
        RigidGroup(2, np.eye(4), y, 2, -1.0, slides=True),
    )
    finger = box((0.03, THICK, 0.03))
    parts = (Part("left", 3, (np.eye(4),), (finger,)), Part("right", 4, (np.eye(4),), (finger,)))
    return Linkage(groups), parts


def held(mass: float, path: FloatArray, rates: FloatArray) -> Iterator[tuple[BodyMotion, float]]:
    """Yield the motion of a body of ``mass`` [kg] and its height in the hand [m] after each tick.

    The fingers close on it in the first half second, at rest. Then height and turn of the palm
    follow ``path`` (n, 2) [m, rad] with ``rates`` (n, 2) [m/s, rad/s].
    """
    linkage, parts = hand()
    drive = FingerDrive(2, 2.0 * FORCE / 1e-3, 2.0 * FORCE, 2, np.zeros(3))
    body = RigidBody("cube", (CUBE,), (np.eye(4),), mass, 0.3)
    shelf = Part("shelf", 0, (se3.from_rotation_translation(np.eye(3), (0.0, 0.0, -0.035)),),
                 (box((0.05, 0.05, 0.02)),))  # fmt: skip
    touching, closed = HALF + 0.5 * THICK, HALF + 0.5 * THICK - 0.002
    for support in ((shelf,), ()):
        simulation = BodySimulation(linkage, (*parts, *support), (body,), drive)
        if support:
            motion = simulation.begin({"cube": np.eye(4)}, None, (), ("cube",))
            x = np.array((0.0, 0.0, touching))
            for _ in range(50):
                motion = simulation.step(motion, x, x, TICK, None, closed)
    x, rate = np.array((0.0, 0.0, touching)), np.zeros(3)
    for place, speed in zip(path, rates, strict=True):
        towards, rate_there = np.append(place, touching), np.append(speed, 0.0)
        motion = simulation.step(motion, x, towards, TICK, (rate, rate_there), closed)
        x, rate = towards, rate_there
        yield motion, float(pose_of(motion, "cube")[2, 3] - x[0])


@pytest.mark.parametrize("load", [0.9, 0.98])
def test_friction_holds_up_to_its_limit(load: float) -> None:
    still = np.zeros((200, 2))
    heights = [height for _, height in held(load * FIRM, still, still)]
    assert abs(heights[-1] - heights[0]) < 1e-4


def test_a_heavier_body_slips() -> None:
    still = np.zeros((20, 2))
    (*_, (motion, _)) = held(1.02 * FIRM, still, still)
    speed = -float(motion.velocity[0, 2])
    # It begins as fast as the rest of its weight says.
    assert speed == pytest.approx(0.2 * GRAVITY * (1.0 - 1.0 / 1.02), rel=0.1)


def test_forces_of_the_fingers_are_those_of_their_drive() -> None:
    still = np.zeros((50, 2))
    (*_, (motion, _)) = held(0.5 * FIRM, still, still)
    for contact in motion.contacts:
        assert contact.force == pytest.approx(FORCE, rel=0.01)
        assert contact.friction == pytest.approx(0.25 * FIRM * GRAVITY, rel=0.05)
    assert {contact.finger for contact in motion.contacts} == {"left", "right"}


def test_a_carried_body_keeps_its_place_in_the_hand() -> None:
    """It is lifted with 5 m/s^2 and turned by a revolution, as smoothly as the arm moves."""
    t = TICK * np.arange(1, 201)
    omega = np.pi
    heights = 0.125 * (1.0 - np.cos(2.0 * omega * t))
    angles = np.pi * (1.0 - np.cos(0.5 * omega * t))
    rates = (0.25 * omega * np.sin(2.0 * omega * t), 0.5 * np.pi * omega * np.sin(0.5 * omega * t))
    path = np.column_stack((heights, angles))
    slips = [height for _, height in held(0.3 * FIRM, path, np.column_stack(rates))]
    assert max(np.abs(slips)) < 1e-4
