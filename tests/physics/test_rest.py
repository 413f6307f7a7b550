"""Bodies at rest stay where they are until something wakes them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from katana450.maths.geometry.arrays import frozen
from katana450.maths.physics.model import REST_TIME
from tests.physics.scenes import (
    HALF,
    SIDE,
    Scene,
    body,
    pose,
    position,
    same_bits,
    with_velocity,
)
from tests.ticks import TICK


def row(*gaps: float) -> Scene:
    """Return boxes side by side along x, with gaps between them [m]."""
    places = np.concatenate(((0.0,), np.cumsum(SIDE + np.array(gaps))))
    return Scene({body(f"box {n}"): pose(x, 0.0, HALF) for n, x in enumerate(places)})


def test_bodies_come_to_rest_after_the_time_for_it() -> None:
    scene = row(0.2, 0.2)
    motions = [*scene.motions(scene.begin(), 2.0 * REST_TIME)]
    first = next(n for n, motion in enumerate(motions) if motion.resting.all())
    assert (first + 1) * TICK == pytest.approx(REST_TIME, abs=2.0 * TICK)
    assert not motions[-1].velocity.any()


def test_bodies_at_rest_stay_to_the_bit() -> None:
    # Also one in the air, and two in each other: nothing moves them before they are woken.
    scene = Scene({
        body("table"): pose(0.0, 0.0, HALF),
        body("air"): pose(0.3, 0.0, 0.5),
        body("inside"): pose(0.01, 0.0, HALF),
    })  # fmt: skip
    start = scene.begin(*scene.names)
    motion = scene.after(start, 1.0)
    assert motion.resting.all()
    assert motion.place.tobytes() == start.place.tobytes()
    assert not motion.velocity.any()


def test_body_far_from_others_moves_alone() -> None:
    scene = row(0.3)
    start = with_velocity(scene.begin("box 1"), "box 0", 0.3, 0.0, 0.0)
    motion = scene.after(start, 0.2)
    assert position(motion, "box 0")[0] > 5e-3
    assert motion.resting.tolist() == [False, True]
    assert motion.place[1].tobytes() == start.place[1].tobytes()


def test_body_at_rest_wakes_when_another_comes_near() -> None:
    scene = row(0.08)
    start = with_velocity(scene.begin("box 1"), "box 0", 1.2, 0.0, 0.0)
    motions = [*scene.motions(start, 0.5)]
    woken = next(n for n, motion in enumerate(motions) if not motion.resting[1])
    gap = (position(motions[woken - 1], "box 1") - position(motions[woken - 1], "box 0"))[0] - SIDE
    assert 0.0 < gap < 0.05
    assert position(motions[-1], "box 1")[0] > position(start, "box 1")[0] + 1e-3


def test_body_that_lost_its_support_falls() -> None:
    scene = Scene({body("lower"): pose(0.0, 0.0, HALF), body("upper"): pose(0.0, 0.0, 3.0 * HALF)})
    start = with_velocity(scene.begin("upper"), "lower", 4.0, 0.0, 0.0)
    motion = scene.after(start, 1.0)
    assert position(motion, "upper")[2] < 1.5 * SIDE - 0.5 * HALF
    assert motion.resting[1]


@pytest.mark.parametrize("ratio", [1.0, 4.0])
def test_hit_body_at_rest_gets_the_momentum_it_would_get_awake(ratio: float) -> None:
    bodies = {
        body("one"): pose(0.0, 0.0, HALF),
        body("two", mass=0.1 * ratio): pose(0.08, 0.0, HALF),
    }
    final = []
    for resting in ((), ("two",)):
        scene = Scene(bodies)
        start = with_velocity(scene.begin(*resting), "one", 1.0, 0.0, 0.0)
        motions = [*scene.motions(start, 1.0)]
        speeds = np.array([motion.velocity[:, 0] for motion in motions])
        hit = int(np.argmax(speeds[:, 1] > 0.05))
        # Before the hit friction has braked the first one alone, and after it both.
        before, after = speeds[hit - 1, 0], speeds[hit]
        assert after[0] + ratio * after[1] == pytest.approx(before, abs=0.01 * 9.81 * (1 + ratio))
        assert after[0] == pytest.approx(after[1], abs=0.05)
        final.append(motions[-1].place[:, 0])
    assert final[1] == pytest.approx(final[0], abs=1e-3)


def test_slow_body_beside_one_at_rest_lets_it_rest() -> None:
    scene = row(1e-3)
    start = with_velocity(scene.begin("box 1"), "box 0", 4e-3, 0.0, 0.0)
    motion = scene.after(start, 0.1)
    assert motion.resting[1]
    assert motion.place[1].tobytes() == start.place[1].tobytes()


def test_begin_wakes_and_moves_only_the_named_bodies() -> None:
    scene = row(0.2, 0.2)
    resting = scene.begin(*scene.names)
    moving = replace(resting, velocity=frozen(np.ones((3, 6))))
    moved_to = pose(0.0, 0.3, HALF)
    poses = scene.poses | {"box 1": moved_to}
    motion = scene.simulation.begin(poses, moving, ("box 1",), ("box 0", "box 1"))
    assert motion.resting.tolist() == [False, False, True]
    assert motion.velocity.any(axis=1).tolist() == [True, False, True]
    assert motion.place[1, :3].tolist() == [0.0, 0.3, HALF]
    assert same_bits(scene.simulation.begin(poses, resting, (), ()), resting)
