"""Drawers and doors: bodies on a joint, as mechanics gives their motion in closed form."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
import pytest

from katana450.errors import InputError
from katana450.maths.collision.shape import box
from katana450.maths.collision.world import Part
from katana450.maths.physics.joint import BodyJoint
from katana450.maths.physics.model import BodyMotion, RigidBody
from katana450.maths.water.units import GRAVITY
from tests.physics.scenes import HALF, TABLE, Scene, body, pose, position, same_bits, slider
from tests.ticks import TICK

POINT = (0.0, 0.0, 0.5)

DRAWER = BodyJoint(True, POINT, (1.0, 0.0, 0.0), 0.0, 0.3)

DOOR = BodyJoint(False, POINT, (0.0, 1.0, 0.0), -2.0, 2.0)
"""A flap, which hangs from a level axis."""

LENGTH = 0.4
"""[m] From the axis of the flap to its lower edge."""


def on_joint(joint: BodyJoint, mass: float = 2.0) -> Scene:
    """Return a scene with one body: a box about the point of a slide, or below that of a hinge."""
    size = (0.1, 0.1, 0.1) if joint.slides else (0.002, 0.2, LENGTH)
    T = pose(0.0, 0.0, 0.0 if joint.slides else -0.5 * LENGTH)
    return Scene({RigidBody("part", (box(size),), (T,), mass, 0.5, joint): pose(*joint.point)})


@pytest.mark.parametrize(("friction", "damping"), [(0.0, 0.0), (4.0, 0.0), (4.0, 6.0)])
def test_drawer_slides_by_its_weight_against_friction_and_damping(
    friction: float, damping: float
) -> None:
    angle, mass, seconds = math.radians(30.0), 2.0, 0.5
    axis = (math.cos(angle), 0.0, -math.sin(angle))
    joint = BodyJoint(True, POINT, axis, 0.0, 3.0, friction, damping)
    scene = on_joint(joint, mass)
    motion = scene.after(scene.begin(), seconds)
    force = mass * GRAVITY * math.sin(angle) - friction
    expected = force / mass * seconds
    if damping:
        expected = force / damping * (1.0 - math.exp(-damping * seconds / mass))
    assert motion.velocity[0, :3] @ axis == pytest.approx(expected, rel=0.02)
    assert np.cross(position(motion, "part") - POINT, axis) == pytest.approx(0.0, abs=1e-12)


def test_drawer_stays_below_its_friction_and_sleeps() -> None:
    angle, mass = math.radians(30.0), 2.0
    axis = (math.cos(angle), 0.0, -math.sin(angle))
    friction = 1.02 * mass * GRAVITY * math.sin(angle)
    scene = on_joint(BodyJoint(True, POINT, axis, 0.0, 1.0, friction), mass)
    motion = scene.after(scene.begin(), 1.0, sleepless=True)
    assert np.linalg.norm(position(motion, "part") - POINT) < 1e-4
    asleep = scene.after(motion, 0.4)
    assert asleep.resting.all()
    assert scene.after(asleep, 0.1).place.tobytes() == asleep.place.tobytes()


def test_drawer_stops_at_the_end_of_its_range() -> None:
    scene = on_joint(dataclasses.replace(DRAWER, axis=(0.0, 0.0, -1.0), upper=0.2))
    motions = [*scene.motions(scene.begin(), 1.5)]
    ways = [0.5 - position(motion, "part")[2] for motion in motions]
    # It arrives with 2 m/s.
    assert max(ways) < 0.2 + 2e-3
    assert ways[-1] == pytest.approx(0.2, abs=2e-4)
    assert motions[-1].resting.all()


def test_door_swings_as_a_pendulum() -> None:
    scene = on_joint(DOOR)
    angle = math.radians(60.0)
    speeds = [motion.velocity[0, 4] for motion in scene.motions(turned(scene, angle), 0.5)]
    inertia = (LENGTH**2 + 0.002**2) / 12.0 + 0.25 * LENGTH**2
    fastest = math.sqrt(GRAVITY * LENGTH * (1.0 - math.cos(angle)) / inertia)
    assert -min(speeds) == pytest.approx(fastest, rel=0.02)
    places = [motion.place[0, 5] for motion in scene.motions(turned(scene, 0.04), 0.7)]
    half_period = math.pi / math.sqrt(GRAVITY * 0.5 * LENGTH / inertia)
    assert TICK * (1 + int(np.argmin(places))) == pytest.approx(half_period, abs=1.01 * TICK)


def test_door_is_pushed_open_by_a_link() -> None:
    joint = BodyJoint(False, (0.0, 0.0, 0.1), (0.0, 0.0, 1.0), 0.0, 2.0, 0.05)
    door = RigidBody("door", (box((0.02, 0.3, 0.2)),), (pose(0.0, -0.15, 0.0),), 1.0, 0.3, joint)
    link = Part("hand", 1, (pose(-0.03, -0.25, 0.1),), (box((0.02, 0.02, 0.02)),))
    scene = Scene({door: pose(*joint.point)}, TABLE, link, linkage=slider())
    motion = scene.after(scene.begin(), 1.0, speed=0.15)
    angle = 2.0 * math.asin(motion.place[0, 6])
    # An edge of the link, 240 mm beside the axis, is in the face 10 mm before it.
    assert 0.24 * math.tan(angle) - 0.01 / math.cos(angle) == pytest.approx(0.13, rel=0.02)


def test_drawer_carries_what_lies_in_it() -> None:
    tray = RigidBody(
        "drawer", (box((0.3, 0.2, 0.01)),), (np.eye(4),), 1.0, 0.5,
        dataclasses.replace(DRAWER, friction=8.0),
    )  # fmt: skip
    scene = Scene({body("box", mass=0.1): pose(0.0, 0.0, 0.505 + HALF), tray: pose(*POINT)})
    motion = scene.after(scene.begin(), 0.5)
    assert position(motion, "box") == pytest.approx((0.0, 0.0, 0.505 + HALF), abs=2e-4)
    assert position(motion, "drawer") == pytest.approx(POINT, abs=1e-5)


def turned(scene: Scene, angle: float) -> BodyMotion:
    """Return the first motion of a flap that hangs at ``angle`` [rad]."""
    place = (*POINT, math.cos(0.5 * angle), 0.0, math.sin(0.5 * angle), 0.0)
    return dataclasses.replace(scene.begin(), place=np.array([place]))


def test_bits_are_those_of_a_second_simulation() -> None:
    scene, other = on_joint(DOOR), on_joint(DOOR)
    start = turned(scene, 1.0)
    half = scene.after(start, 0.3)
    scene.after(start, 0.1)
    assert same_bits(scene.after(half, 0.2), other.after(other.after(start, 0.3), 0.2))


@pytest.mark.parametrize(
    "change",
    [
        {"axis": (1.0, 1.0, 0.0)},
        {"axis": (math.nan, 0.0, 0.0)},
        {"lower": 0.1},
        {"upper": 0.0},
        {"upper": 1e9},
        {"friction": -1.0},
        {"damping": math.inf},
        {"mass": 0.0},
        {"point": (1e6, 0.0, 0.0)},
    ],
)
def test_impossible_joint_is_refused(change: dict[str, Any]) -> None:
    with pytest.raises(InputError, match="joint"):
        dataclasses.replace(DRAWER, **change)


def test_position_on_a_joint_is_that_of_its_motion() -> None:
    for joint in (DRAWER, DOOR):
        assert joint.position(joint.motion(0.25)) == pytest.approx(0.25, abs=1e-12)
        assert joint.position(joint.motion(2.5)) == joint.upper
