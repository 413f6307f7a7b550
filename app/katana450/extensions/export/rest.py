"""The posture in which the arm starts, and the pairs of links that need no collision check."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations

import numpy as np

from katana450.arm.robot.collision import world_of
from katana450.arm.robot.robot import Robot
from katana450.arm.robot.structure import ARM_JOINTS
from katana450.extensions.bodies.pairs_at_rest import pairs_at_rest
from katana450.maths.collision.linkage import Linkage
from katana450.maths.collision.world import CollisionWorld, Part
from katana450.maths.geometry.arrays import FloatArray
from katana450.settings import Settings


def home_of(robot: Robot) -> Mapping[str, float]:
    """Return the value of every joint [rad or m] at the app's home; of a mechanism at zero."""
    arm = robot.arm
    if arm is None:
        return robot.every({})
    *q, gripper = home_vector(robot).tolist()
    return robot.every(arm.joint_values(np.array(q), gripper))


def home_vector(robot: Robot) -> FloatArray:
    """Return `home_of` as the joint values (k,) [rad or m] of a collision world of ``robot``."""
    arm = robot.arm
    if arm is None:
        home = robot.every({})
        return np.array([*(home[name] for name in robot.driven), 0.0])
    return np.append(arm.ready(Settings.ready), arm.gripper.clamp(0.0))


def excluded_pairs(robot: Robot) -> list[tuple[str, str]]:
    """Return the names of the pairs of links with collision shapes that cannot meet.

    For an arm of the five-axis family these are all pairs that this project does not check either:
    neighbours, pairs that no sampled posture brings near each other, and those that always overlap.
    For any other robot these are the neighbours, and the pairs whose hulls touch at home.
    """

    def at_home(linkage: Linkage, parts: Sequence[Part]) -> CollisionWorld:
        rest = pairs_at_rest(linkage, parts, home_vector(robot))
        return CollisionWorld(linkage, parts, rest.checked)

    links = {link.name for link in robot.links if link.collisions}
    if not links:
        return []
    family = robot.arm is not None and robot.arm.chain.n == ARM_JOINTS
    world, _ = world_of(robot, make=None if family else at_home)
    names = [] if world is None else [part.name for part in world.parts]
    checked = set() if world is None else {(names[a], names[b]) for a, b in world.pairs}
    return [
        pair
        for pair in combinations([name for name in names if name in links], 2)
        if pair not in checked
    ]
