"""The pair table, which is computed and not listed."""

from __future__ import annotations

from itertools import combinations, product

import numpy as np

from katana450.arm.robot.collision import pairs_that_meet
from katana450.maths.collision.clearance import MIN_CLEARANCE
from katana450.maths.collision.linkage import Linkage, RigidGroup
from katana450.maths.collision.shape import box
from katana450.maths.collision.world import CollisionWorld, Part, obstacle
from katana450.maths.geometry import se3
from katana450.maths.geometry.arrays import FloatArray

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
