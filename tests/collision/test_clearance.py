"""Limits on a step: full length with room, never too near, and always free to move away."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from katana450.arm.robot.arm_reader import MountedArm
from katana450.maths.collision.clearance import (
    MAX_UNCHECKED_PATH,
    MIN_CLEARANCE,
    MIN_STOP_TIME,
    MIN_TRAVEL,
    advance,
)
from katana450.maths.collision.linkage import Linkage, RigidGroup
from katana450.maths.collision.shape import box, cylinder
from katana450.maths.collision.world import CollisionWorld, Part, obstacle
from katana450.maths.geometry import se3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.geometry.curve import JointCurve

TICK = 0.01
SLIGHTLY = 2e-5  # m: what the search for nearest points leaves open, many ticks together


def approach(x: FloatArray, end: FloatArray, speed: FloatArray, dt: float) -> FloatArray:
    """Return the end of a step of ``dt`` [s] from ``x`` (k,) towards ``end`` at maximum speed."""
    needed = float(np.max(np.abs(end - x) / speed))
    return end if needed <= dt else np.asarray(x + (end - x) * (dt / needed))


def at(x: float, y: float, z: float) -> FloatArray:
    return se3.from_rotation_translation(np.eye(3), (x, y, z))


@pytest.fixture(scope="module")
def bar() -> CollisionWorld:
    """A bar 1 m long that turns about z, a wall a quarter turn away, and a reed half way."""
    linkage = Linkage([RigidGroup(0, np.eye(4), np.array([0.0, 0.0, 1.0]), 0)])
    parts = [
        Part("bar", 1, (at(0.6, 0.0, 0.0),), (box((1.0, 0.02, 0.02)),)),
        obstacle("wall", at(0.0, 1.0, 0.0), box((0.02, 1.0, 1.0))),
        obstacle("reed", at(0.6, -0.6, 0.0), cylinder(0.0005, 1.0)),
    ]
    return CollisionWorld(linkage, parts, [(0, 1), (0, 2)])


def turned(bar: CollisionWorld, start: float, goal: float, speed: float) -> Iterator[FloatArray]:
    """Yield the postures of the bar, tick by tick, until it rests."""
    x, end = np.array([start]), np.array([goal])
    for _ in range(2000):
        step = advance(bar, x, approach(x, end, np.array([speed]), TICK), TICK)
        if (step.x == x).all():
            return
        x = step.x
        yield x
    raise AssertionError("the bar never came to rest")


@pytest.mark.parametrize("speed", [0.2, 2.0, 20.0])
def test_the_bar_stops_before_the_wall(bar: CollisionWorld, speed: float) -> None:
    *_, last = turned(bar, 0.0, 3.0, speed)
    contact = bar.nearest(last)
    assert contact is not None
    assert contact.parts == ("bar", "wall")
    assert (
        MIN_CLEARANCE - SLIGHTLY
        <= contact.distance
        < MIN_CLEARANCE + 10.0 * MIN_TRAVEL / (TICK / MIN_STOP_TIME)
    )


def test_bar_slows_down_before_the_wall(bar: CollisionWorld) -> None:
    angles = [0.0, *(float(x[0]) for x in turned(bar, 0.0, 3.0, 2.0))]
    steps = np.diff(angles)
    assert steps.max() == pytest.approx(2.0 * TICK)
    slowing = steps[steps < 0.99 * steps.max()]
    assert len(slowing) > 10
    assert (np.diff(slowing) < 0.0).all()


@pytest.mark.parametrize("speed", [2.0, 8.0, 20.0])
def test_bar_does_not_jump_over_a_thin_reed(bar: CollisionWorld, speed: float) -> None:
    *_, last = turned(bar, 0.0, -1.5, speed)
    assert last[0] > -np.pi / 4
    contact = bar.nearest(last)
    assert contact is not None
    assert contact.parts == ("bar", "reed")
    assert contact.distance >= MIN_CLEARANCE - SLIGHTLY


def test_motion_away_is_not_slowed(bar: CollisionWorld) -> None:
    *_, last = turned(bar, 0.0, 3.0, 2.0)
    step = advance(bar, last, last - 2.0 * TICK, TICK)
    assert step.contact is None
    assert (step.x == last - 2.0 * TICK).all()


@pytest.mark.parametrize("depth", [0.0, 0.002, 0.008])
def test_from_too_near_only_motion_away_is_allowed(bar: CollisionWorld, depth: float) -> None:
    """Test a wall that was placed onto the bar, or a driver that overshot."""
    *_, last = turned(bar, 0.0, 3.0, 2.0)
    x = last + (MIN_CLEARANCE - 0.004 + depth) / 1.1
    contact = bar.nearest(x)
    assert contact is not None
    assert contact.distance < MIN_CLEARANCE
    inwards = advance(bar, x, x + 0.01, TICK)
    assert inwards.stopped
    assert (inwards.x == x).all()
    assert inwards.contact is not None
    assert inwards.contact.parts == ("bar", "wall")
    for _ in range(20):
        outwards = advance(bar, x, x - 2.0 * TICK, TICK)
        assert not outwards.stopped
        x = outwards.x
    away = bar.nearest(x)
    assert away is not None
    assert away.distance > 2.0 * MIN_CLEARANCE


def test_step_with_room_is_unchanged(bar: CollisionWorld) -> None:
    x, towards = np.array([0.1]), np.array([0.1 + 1e-3])
    step = advance(bar, x, towards, TICK)
    assert step.x is towards
    assert step.contact is None
    assert not step.stopped
    assert advance(bar, x, np.array([0.1]), TICK).x is x


def test_advance_is_deterministic(world: CollisionWorld, postures: FloatArray) -> None:
    for x, towards in zip(postures[:50], postures[50:100], strict=True):
        end = x + 0.02 * np.sign(towards - x)
        one, two = advance(world, x, end, TICK), advance(world, x, end, TICK)
        assert one.x.tobytes() == two.x.tobytes()


def test_driven_at_random_at_full_speed_the_arm_never_comes_too_near(
    arm: MountedArm, world: CollisionWorld, limits: tuple[FloatArray, FloatArray]
) -> None:
    """Drive to goals, most of them in the table or in the arm itself; also check between ticks."""
    rng = np.random.default_rng(10)
    speed = np.append(arm.chain.speed, arm.gripper.speed)
    x = np.append(np.radians((0.0, -68.0, 85.0, 8.0, 0.0)), 0.0)
    stops = 0
    for goal in rng.uniform(*limits, (25, 6)):
        for _ in range(250):
            step = advance(world, x, approach(x, goal, speed, TICK), TICK)
            if step.contact is not None:
                middle = world.nearest(0.5 * (x + step.x))
                end = world.nearest(step.x)
                assert middle is not None
                assert end is not None
                assert middle.distance > 0.5 * MIN_CLEARANCE
                assert end.distance >= MIN_CLEARANCE - SLIGHTLY
            x = step.x
            if step.stopped:
                stops += 1
                break
    assert stops >= 5


def test_unchecked_path_is_shorter_than_any_part(world: CollisionWorld) -> None:
    thinnest = min(2.0 * float(half.min()) for half in world.box_half)
    assert thinnest > MAX_UNCHECKED_PATH


@pytest.mark.parametrize(
    ("sag", "clear"), [(0.0, True), (0.9e-3, True), (0.999e-3, True), (1.001e-3, False)]
)
def test_a_curve_is_clear_between_its_ends_too(sag: float, clear: bool) -> None:
    # A block slides along a wall, 6 mm from it at both ends, and ``sag`` [m] nearer in the middle.
    axes = np.eye(3)
    linkage = Linkage(
        [
            RigidGroup(0, np.eye(4), axes[0], 0, slides=True),
            RigidGroup(1, np.eye(4), axes[1], 1, slides=True),
        ]
    )
    parts = [
        Part("block", 2, (at(0.0, 0.016, 0.0),), (box((0.02, 0.02, 0.02)),)),
        obstacle("wall", at(0.0, -0.01, 0.0), box((0.2, 0.02, 0.2))),
    ]
    world = CollisionWorld(linkage, parts, [(0, 1)])
    start, end = np.zeros(2), np.array((0.02, 0.0))
    curve = JointCurve(
        lambda part: np.array((0.02 * part, -4.0 * sag * part * (1.0 - part))),
        lambda low, high: np.array((0.0, 8.0 * sag * (high - low) ** 2)),
    )
    assert (advance(world, start, end, MIN_STOP_TIME).x == end).all()
    step = advance(world, start, end, MIN_STOP_TIME, curve=curve)
    assert step.stopped != clear
    assert (step.x == (end if clear else start)).all()
    assert clear == (step.contact is None)
