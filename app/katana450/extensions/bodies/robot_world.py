"""The collision world of any robot."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from katana450.arm.robot.collision import as_modelled, world_of
from katana450.arm.robot.robot import Robot
from katana450.arm.robot.structure import ARM_JOINTS
from katana450.extensions.bodies.pairs_at_rest import pairs_at_rest
from katana450.extensions.bodies.pieces import pieces
from katana450.extensions.bodies.table import standing
from katana450.maths.collision.linkage import Linkage
from katana450.maths.collision.world import CollisionWorld, Part
from katana450.maths.geometry.arrays import FloatArray
from katana450.settings import Settings


def robot_world(robot: Robot) -> tuple[CollisionWorld | None, tuple[str, ...]]:
    """Return the bodies and pairs of ``robot``, and sentences for a person on what is left out.

    x is that of ``world_of``. An arm of the five-axis family keeps the pairs that sampled postures
    bring near each other, and its collision shapes count as convex. All other shapes are divided by
    ``pieces``. A robot that is driven joint by joint has its table here, an arm in its session. The
    world is None if no link has a shape.
    """
    if robot.arm is not None and robot.arm.chain.n == ARM_JOINTS:
        return world_of(robot, as_modelled if robot.collides else pieces)
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

    world, notes = world_of(robot, pieces, make)
    return world, (*notes, *found)


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
