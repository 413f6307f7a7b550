"""Motions that mechanics gives in closed form."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from katana450.maths.collision.shape import CollisionShape, box, cylinder, half_space, hull, sphere
from katana450.maths.collision.world import Part, obstacle
from katana450.maths.geometry import so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.physics.model import LINK_FRICTION
from katana450.maths.water.units import GRAVITY
from tests.physics.scenes import (
    CUBE,
    HALF,
    MAX_GRIP,
    SIDE,
    TABLE,
    Scene,
    above_slope,
    body,
    downhill,
    pose,
    pose_of,
    position,
    slider,
    slope,
    with_velocity,
)

CORNERS = np.array(list(product((-1.0, 1.0), repeat=3)))

WITHIN = 0.02
"""[1] Relative error of a motion."""


def acceleration_down(angle: float, scene: Scene) -> float:
    """Return the mean acceleration [m/s^2] down a slope, after a body has settled on it."""
    start = scene.after(scene.begin(), 0.1)
    end = scene.after(start, 1.0)
    speeds = [float(downhill(angle) @ motion.velocity[0, :3]) for motion in (start, end)]
    return speeds[1] - speeds[0]


def test_body_in_the_air_falls_freely() -> None:
    scene = Scene({body("ball", sphere(0.02)): pose(0.0, 0.0, 2.0)})
    motion = scene.after(with_velocity(scene.begin(), "ball", 1.0, 0.0, 0.5), 0.5)
    height = 2.0 + 0.5 * 0.5 - 0.5 * GRAVITY * 0.5**2
    assert position(motion, "ball") == pytest.approx((0.5, 0.0, height), rel=WITHIN)
    assert motion.velocity[0] == pytest.approx(
        (1.0, 0.0, 0.5 - GRAVITY * 0.5, 0.0, 0.0, 0.0), rel=1e-6, abs=1e-9
    )


@pytest.mark.parametrize("friction", [0.5, 0.8])
@pytest.mark.parametrize("mass", [0.01, 5.0])
def test_box_stays_on_a_slope_below_the_angle_of_friction(friction: float, mass: float) -> None:
    angle = np.arctan(friction) - np.radians(1.0)
    piece = body("box", mass=mass, friction=friction)
    scene = Scene({piece: above_slope(angle, HALF)}, slope(angle))
    start = scene.after(scene.begin(), 0.1, sleepless=True)
    end = scene.after(start, 1.0, sleepless=True)
    assert np.linalg.norm(position(end, "box") - position(start, "box")) < MAX_GRIP


@pytest.mark.parametrize("friction", [0.5, 0.8])
def test_box_slides_down_a_slope_above_the_angle_of_friction(friction: float) -> None:
    angle = np.arctan(friction) + np.radians(1.0)
    scene = Scene({body("box", friction=friction): above_slope(angle, HALF)}, slope(angle))
    start = scene.after(scene.begin(), 0.1)
    end = scene.after(start, 0.5)
    way = downhill(angle) @ (position(end, "box") - position(start, "box"))
    assert way > 0.02


@pytest.mark.parametrize(
    ("shape", "friction", "error"),
    [
        (CUBE, 0.5, WITHIN),
        (CUBE, 0.7, WITHIN),
        (hull(HALF * CORNERS), 0.5, WITHIN),
        # It rocks on its rim, because the engine knows only four points of that.
        (cylinder(0.04, SIDE), 0.5, 0.05),
    ],
    ids=["box", "rough box", "hull", "cylinder"],
)
def test_sliding_body_is_braked_by_coulomb_friction(
    shape: CollisionShape, friction: float, error: float
) -> None:
    angle = np.radians(45.0)
    piece = body("box", shape, friction=friction)
    scene = Scene({piece: above_slope(angle, HALF)}, slope(angle))
    expected = GRAVITY * (np.sin(angle) - friction * np.cos(angle))
    assert acceleration_down(angle, scene) == pytest.approx(expected, rel=error)


def test_sliding_box_stays_on_the_table() -> None:
    scene = Scene({body("box"): pose(0.0, 0.0, HALF)})
    start = scene.after(scene.begin(), 0.1, sleepless=True)
    motions = scene.motions(with_velocity(start, "box", 1.0, 0.0, 0.0), 0.5)
    assert max(position(motion, "box")[2] for motion in motions) < HALF + 2e-4


def test_sliding_box_comes_to_rest_after_its_braking_distance() -> None:
    scene = Scene({body("box"): pose(0.0, 0.0, HALF)})
    start = scene.after(scene.begin(), 0.1, sleepless=True)
    motion = scene.after(with_velocity(start, "box", 1.0, 0.0, 0.0), 1.0)
    assert motion.resting.all()
    assert position(motion, "box")[0] == pytest.approx(1.0 / (2.0 * 0.5 * GRAVITY), rel=WITHIN)


@pytest.mark.parametrize("degrees", [5.0, 20.0])
def test_ball_rolls_down_a_slope(degrees: float) -> None:
    angle = np.radians(degrees)
    scene = Scene({body("ball", sphere(0.03)): above_slope(angle, 0.03)}, slope(angle))
    expected = 5.0 / 7.0 * GRAVITY * np.sin(angle)
    assert acceleration_down(angle, scene) == pytest.approx(expected, rel=WITHIN)


@pytest.mark.parametrize("tilt", [-1.0, 1.0])
def test_box_topples_beyond_its_critical_angle(tilt: float) -> None:
    half, height = 0.02, 0.12
    critical = np.arctan2(half, 0.5 * height)
    angle = critical + np.radians(tilt)
    # On its edge, with the middle above the edge at the critical angle.
    radius = np.hypot(half, 0.5 * height)
    middle = radius * np.array((np.sin(angle - critical), 0.0, np.cos(angle - critical)))
    piece = body("box", box((2.0 * half, 0.08, height)))
    scene = Scene({piece: pose(middle[0], 0.0, middle[2], so3.rotation_y(angle))})
    motion = scene.after(scene.begin(), 2.5)
    assert motion.resting.all()
    upright = abs(pose_of(motion, "box")[2, 2])
    assert upright == pytest.approx(0.0 if tilt > 0.0 else 1.0, abs=1e-2)


@pytest.mark.parametrize("angle", [-1.0, 1.0])
def test_box_on_a_slope_topples_when_its_middle_is_beyond_its_edge(angle: float) -> None:
    half, height = 0.015, 0.12
    tilt = np.arctan2(half, 0.5 * height) + np.radians(angle)
    piece = body("box", box((2.0 * half, 0.08, height)))
    assert np.tan(tilt) < LINK_FRICTION
    scene = Scene({piece: above_slope(tilt, 0.5 * height)}, slope(tilt))
    motion = scene.after(scene.begin(), 2.0)
    upright = pose_of(motion, "box")[:3, 2] @ so3.rotation_y(tilt)[:, 2]
    assert (upright > 0.999) == (angle < 0.0)


@pytest.mark.parametrize("shape", [CUBE, sphere(HALF)], ids=["box", "ball"])
def test_impact_has_no_restitution(shape: CollisionShape) -> None:
    scene = Scene({body("box", shape): pose(0.0, 0.0, HALF + 0.2)})
    motions = [*scene.motions(scene.begin(), 0.8)]
    speeds = np.array([motion.velocity[0, 2] for motion in motions])
    impact = np.sqrt(2.0 * GRAVITY * 0.2)
    assert -speeds.min() == pytest.approx(impact, rel=0.06)
    assert speeds.max() < WITHIN * impact
    assert position(motions[-1], "box") == pytest.approx((0.0, 0.0, HALF), abs=1e-4)


def test_body_on_an_edge_of_the_table_falls_only_beyond_it() -> None:
    top = obstacle("table", pose(-0.5, 0.0, 0.5), box((1.0, 1.0, 0.1)))
    floor = obstacle("floor", np.eye(4), half_space())
    for overhang, falls in ((-0.05 * SIDE, False), (0.05 * SIDE, True)):
        scene = Scene({body("box"): pose(overhang, 0.0, 0.55 + HALF)}, top, floor)
        motion = scene.after(scene.begin(), 1.5)
        assert (position(motion, "box")[2] < 0.3) == falls


def pushed(offset: float, width: float) -> FloatArray:
    """Return the pose (4, 4) of a box at the origin that a link has pushed for 100 mm.

    Args:
        offset: y of the middle of the link beside that of the box [m].
        width: width of the link [m].
    """
    shape = box((0.02, width, 0.02))
    part = Part("hand", 1, (pose(-HALF - 0.01, offset, HALF),), (shape,))
    scene = Scene({body("box"): pose(0.0, 0.0, HALF)}, TABLE, part, linkage=slider())
    motion = scene.after(scene.begin(), 1.0, speed=0.1)
    return pose_of(motion, "box")


def test_pushed_box_follows_the_link() -> None:
    T = pushed(0.0, 0.04)
    assert T[:3, 3] == pytest.approx((0.1, 0.0, HALF), abs=2e-3)
    assert T[0, 0] > np.cos(np.radians(2.0))


@pytest.mark.parametrize("offset", [-0.015, 0.015])
def test_box_pushed_beside_its_middle_turns(offset: float) -> None:
    T = pushed(offset, 0.005)
    assert T[0, 3] > 0.03
    assert T[1, 0] * np.sign(offset) < -0.1


def test_stack_stands() -> None:
    check_stack(4.0)


@pytest.mark.long
def test_stack_stands_for_a_minute() -> None:
    check_stack(60.0)


def check_stack(seconds: float) -> None:
    """Check that ten boxes, kept awake, stand on each other."""
    pieces = {body(f"box {n}"): pose(0.0, 0.0, HALF + n * SIDE) for n in range(10)}
    scene = Scene(pieces)
    motion = scene.after(scene.begin(), seconds, sleepless=True)
    drift = motion.place[:, :3] - [T[:3, 3] for T in pieces.values()]
    assert np.linalg.norm(drift, axis=1).max() < 1e-3
