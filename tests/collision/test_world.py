"""The nearest pair, and the bounds that make most distance computations unnecessary."""

from __future__ import annotations

import math
from itertools import combinations, product

import numpy as np
import pytest

from katana450.arm.robot.collision import pairs_that_meet
from katana450.maths.collision.clearance import MIN_CLEARANCE
from katana450.maths.collision.linkage import Linkage, RigidGroup
from katana450.maths.collision.shape import box, half_space
from katana450.maths.collision.world import CollisionWorld, Part, obstacle
from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.planning.clearance import SweptClearance
from tests.collision.distances import distances


def test_nearest_pair_is_the_minimum_of_all_pairs(
    world: CollisionWorld, postures: FloatArray
) -> None:
    for x in postures[:60]:
        placed = world.at(x)
        every = distances(placed, np.arange(len(world.first)))
        contact = world.nearest(x)
        assert contact is not None
        assert contact.distance == every.min()
        one, other = (
            world.parts[world.part_of[side[every.argmin()]]].name
            for side in (world.first, world.second)
        )
        assert contact.parts == (one, other)


def test_points_and_normal_agree_with_the_distance(
    world: CollisionWorld, postures: FloatArray
) -> None:
    for x in postures[:60]:
        contact = world.nearest(x)
        assert contact is not None
        gap = contact.points[1] - contact.points[0]
        np.testing.assert_allclose(gap, contact.distance * contact.normal, atol=2e-6)


def test_no_pair_is_nearer_than_its_bound(world: CollisionWorld, postures: FloatArray) -> None:
    for x in postures[:30]:
        placed = world.at(x)
        pairs, bounds = placed.nearer_than(np.inf)
        assert len(pairs) == len(world.first)
        # The ball of the table is flat to a micrometre.
        assert (distances(placed, pairs) >= bounds - 2e-6).all()


def test_skipped_pairs_are_far(world: CollisionWorld, postures: FloatArray) -> None:
    limit = np.linspace(0.0, 0.2, len(world.first))
    for x in postures[:30]:
        placed = world.at(x)
        left = np.setdiff1d(np.arange(len(world.first)), placed.nearer_than(limit)[0])
        assert (distances(placed, left) >= limit[left] - 2e-6).all()


def test_distance_changes_by_at_most_the_travel(
    world: CollisionWorld, postures: FloatArray
) -> None:
    rng = np.random.default_rng(8)
    tightest = 0.0
    for x in postures[:60]:
        step = rng.uniform(-1.0, 1.0, 6) * 0.02 * (rng.random(6) < 0.5)
        placed, moved = world.at(x), world.at(x + step)
        travel = world.travel(placed, x, x + step)
        pairs = np.arange(len(world.first))
        change = np.abs(distances(moved, pairs) - distances(placed, pairs))
        apart = distances(placed, pairs) > 0.0
        assert (change <= travel + 2e-6)[apart].all()
        tightest = max(tightest, float((change / np.maximum(travel, 1e-6))[apart].max()))
    # The bound is tight enough to matter.
    assert tightest > 0.8


def test_joint_that_carries_both_bodies_keeps_their_distance(bare: CollisionWorld) -> None:
    # A wall does not turn with the arm.
    T = se3.from_rotation_translation(so3.rotation_y(-0.5 * np.pi), np.array([0.6, 0.0, 0.0]))
    world = bare.with_obstacles([obstacle("wall", T, half_space())])
    x = np.zeros(6)
    placed = world.at(x)
    travel = world.travel(placed, x, np.array([0.02, 0.0, 0.0, 0.0, 0.0, 0.0]))
    mover = world.mover_of
    both = (mover[world.first] > 0) & (mover[world.second] > 0)
    assert (travel[both] == 0.0).all()
    assert (travel[~both] > 0.0).all()


def test_joint_that_turns_about_the_normal_of_the_table_moves_nothing_towards_it(
    world: CollisionWorld, postures: FloatArray
) -> None:
    on_table = np.flatnonzero([world.parts[k].name == "table" for k in world.part_of[world.second]])
    assert on_table.size
    for x in postures[:30]:
        turned = x + np.array([0.16, 0.0, 0.0, 0.0, 0.0, 0.0])
        placed, moved = world.at(x), world.at(turned)
        assert (world.travel(placed, x, turned)[on_table] == 0.0).all()
        np.testing.assert_allclose(
            distances(moved, on_table), distances(placed, on_table), rtol=0.0, atol=2e-6
        )
        bent = world.travel(placed, x, x + np.array([0.0, 0.02, 0.0, 0.0, 0.0, 0.0]))[on_table]
        # The turn of joint 1 adds nothing to that of others.
        both = world.travel(placed, x, x + np.array([0.08, 0.02, 0.0, 0.0, 0.0, 0.0]))[on_table]
        assert (both == bent).all()
        assert bent.any()


MAX_POSTURES = 64
"""[1] While the turn counted as motion of the part, both searches needed 32,766 postures."""


def test_turn_of_a_part_on_the_table_is_decided_in_few_postures() -> None:
    turning = RigidGroup(0, np.eye(4), np.array([0.0, 0.0, 1.0]), 0)
    middle = se3.from_rotation_translation(np.eye(3), np.array([0.0, 0.0, 0.1]))
    part = Part("turntable", 1, (middle,), (box((0.3, 0.3, 0.2)),))
    world = CollisionWorld(Linkage([turning]), [part], []).with_obstacles(
        [obstacle("table", np.eye(4), half_space())]
    )
    start, end = np.array([0.0, 0.0]), np.array([math.pi, 0.0])
    postures = 0

    def at(sigma: float) -> FloatArray:
        nonlocal postures
        postures += 1
        return np.asarray(start + sigma * (end - start))

    def turned(low: float, high: float) -> FloatArray:
        return np.asarray((high - low) * (end - start))

    room = SweptClearance.about(world, 0.006, start, end)
    assert room.blocked(at, turned) is None
    nearest = room.nearest(at, turned)
    assert nearest is not None
    assert abs(nearest.contact.distance) < 1e-6
    assert postures <= MAX_POSTURES


def standing_box(gap: float) -> CollisionWorld:
    """A box on a joint, with its bottom ``gap`` [m] above the table."""
    turning = RigidGroup(0, np.eye(4), np.array([0.0, 0.0, 1.0]), 0)
    middle = se3.from_rotation_translation(np.eye(3), np.array([0.0, 0.0, 0.1 + gap]))
    part = Part("box", 1, (middle,), (box((0.1, 0.1, 0.2)),))
    table = obstacle("table", np.eye(4), half_space())
    return CollisionWorld(Linkage([turning]), [part], []).with_obstacles([table])


def test_bodies_that_touch_may_overlap_by_the_rounding_of_depths() -> None:
    """The processor decides whether they overlap or are 1e-17 m apart."""
    for gap in (-1e-9, 0.0, 1e-16, 5e-8):
        room = SweptClearance.about(standing_box(gap), 0.006, np.zeros(2))
        assert room.minimum.min() == pytest.approx(-1e-5, abs=1e-6), gap
    apart = SweptClearance.about(standing_box(1e-3), 0.006, np.zeros(2))
    assert apart.minimum.min() == pytest.approx(1e-3, abs=1e-6)


UP = np.array([0.0, 0.0, 1.0])


def names(world: CollisionWorld) -> set[tuple[str, str]]:
    return {(world.parts[a].name, world.parts[b].name) for a, b in world.pairs}


def test_neighbours_and_fingers_are_excluded(bare: CollisionWorld) -> None:
    pairs = names(bare)
    assert not pairs & {
        ("base_link", "arm_base_link"),
        ("arm_base_link", "pan_link"),
        ("base_link", "pan_link"),
        ("pan_link", "upper_arm_link"),
        ("forearm_link", "wrist_link"),
        ("gripper_link", "finger_right_link"),
        ("finger_right_link", "finger_left_link"),
    }


def test_parts_that_can_meet_are_included(bare: CollisionWorld) -> None:
    tools = ("roll_link", "gripper_link", "finger_right_link", "finger_left_link")
    assert names(bare) >= set(product(("base_link", "arm_base_link", "upper_arm_link"), tools))


def test_excluded_pairs_never_come_near(
    bare: CollisionWorld, limits: tuple[FloatArray, FloatArray]
) -> None:
    """Drive each pair as near as possible, from many postures, by the steepest of random steps."""
    lower, upper = limits
    candidates = {
        (a, b)
        for a, b in combinations(range(len(bare.parts)), 2)
        if len(bare.linkage.variables_between(bare.parts[a].mover, bare.parts[b].mover)) > 1
    }
    rng = np.random.default_rng(9)
    for pair in sorted(candidates - set(bare.pairs)):
        alone = CollisionWorld(bare.linkage, bare.parts, [pair])

        def distance(x: FloatArray, alone: CollisionWorld = alone) -> float:
            contact = alone.nearest(x)
            assert contact is not None
            return contact.distance

        starts = rng.uniform(lower, upper, (30, len(lower)))
        x = min(starts, key=distance)
        nearest = distance(x)
        reach = 0.3
        for _ in range(60):
            steps = np.clip(x + rng.normal(scale=reach, size=(4, len(x))), lower, upper)
            best = min(steps, key=distance)
            if distance(best) < nearest:
                x, nearest = best, distance(best)
            else:
                reach *= 0.9
        assert nearest > MIN_CLEARANCE, [alone.parts[number].name for number in pair]


def test_parts_that_overlap_by_design_are_excluded() -> None:
    """Test a sleeve on the second of two joints that turn about one line."""
    moved = se3.from_rotation_translation(np.eye(3), (1.0, 0.0, 0.0))
    linkage = Linkage([RigidGroup(0, np.eye(4), UP, 0), RigidGroup(1, np.eye(4), UP, 1)])
    cube = box((1.0, 1.0, 1.0))
    parts = [
        obstacle("post", np.eye(4), cube),
        obstacle("wall", moved, cube),
        Part("sleeve", 2, (np.eye(4),), (box((0.8, 0.8, 1.5)),)),
        Part("hand", 2, (moved,), (cube,)),
    ]
    lower, upper = np.full(2, -1.0), np.full(2, 1.0)
    pairs = pairs_that_meet(linkage, parts, lower, upper)
    assert (0, 2) not in pairs
    assert (1, 3) in pairs
