"""The collision world of any robot."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from katana450.arm.robot.collision import as_modelled, table, world_of
from katana450.arm.robot.robot import Robot
from katana450.arm.robot.structure import ARM_JOINTS
from katana450.extensions.bodies.cautions import cautions
from katana450.extensions.bodies.estimated_shapes import with_estimates
from katana450.extensions.bodies.pairs_at_rest import pairs_at_rest
from katana450.extensions.bodies.pieces import pieces
from katana450.extensions.bodies.table import standing
from katana450.maths.collision.linkage import Linkage
from katana450.maths.collision.world import CollisionWorld, Part
from katana450.maths.geometry.arrays import FloatArray
from katana450.settings import Settings

if TYPE_CHECKING:
    from katana450.extension import RobotWorld


def robot_world(robot: Robot) -> RobotWorld:
    """Return the bodies and pairs of ``robot``, sentences on what is left out, and cautions.

    x is that of ``world_of``. An arm of the five-axis family keeps the pairs that sampled postures
    bring near each other, and its collision shapes count as convex. All other shapes are divided by
    ``pieces``. Links of unknown shape get those of ``with_estimates``. A robot that is driven joint
    by joint has its table here, an arm in its session. The world is None if no link has a shape.
    """
    five_axes = robot.arm is not None and robot.arm.chain.n == ARM_JOINTS
    divide = cache(as_modelled if five_axes and robot.collides else pieces)
    complete, unknown = with_estimates(robot, divide)
    found: list[str] = []

    def make(linkage: Linkage, parts: Sequence[Part]) -> CollisionWorld:
        rest = pairs_at_rest(linkage, parts, _at_rest(robot), _at_home(robot))
        touching = [f"{parts[a].name} and {parts[b].name}" for a, b in rest.touching]
        if touching:
            found.append(f"Not checked, because they touch at rest: {'; '.join(touching)}.")
        if robot.arm is not None:
            return CollisionWorld(linkage, parts, rest.checked, rest.close)
        under = standing(linkage, parts, robot.joint_group)
        found.extend(under.notes)
        return CollisionWorld(
            linkage,
            (*parts, *under.table),
            (*rest.checked, *under.pairs.checked),
            {**rest.close, **under.pairs.close},
        )

    world, notes = world_of(complete, divide, None if five_axes else make)
    on_table = world if world is None or robot.arm is None else world.with_obstacles((table(),))
    start = _at_home(robot)
    x = _at_rest(robot) if start is None else start
    return world, (*notes, *found), tuple(cautions(robot, unknown, on_table, x))


def _at_rest(robot: Robot) -> FloatArray:
    """Return x with every joint at zero, or at the limit nearest to zero."""
    if robot.arm is None:
        return np.append(robot.joint_group.ready, 0.0)
    chain, gripper = robot.arm.chain, robot.arm.gripper
    return np.append(np.clip(0.0, chain.lower, chain.upper), gripper.clamp(0.0))


def _at_home(robot: Robot) -> FloatArray | None:
    """Return x where an arm starts and Home leads; None for a robot that is driven by joints."""
    if robot.arm is None:
        return None
    return np.append(robot.arm.ready(Settings.ready), robot.arm.gripper.clamp(0.0))
