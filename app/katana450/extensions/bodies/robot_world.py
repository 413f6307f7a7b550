"""The collision world of any robot."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from katana450.arm.robot.collision import Pieces, as_modelled, world_of
from katana450.arm.robot.robot import Robot
from katana450.arm.robot.structure import ARM_JOINTS
from katana450.arm.robot.visual import GEOMETRY_FILES, Visual
from katana450.extensions.bodies.pairs_at_rest import pairs_at_rest
from katana450.maths.collision.convex_body import convex_body
from katana450.maths.collision.linkage import Linkage
from katana450.maths.collision.world import CollisionWorld, Part
from katana450.maths.geometry.arrays import FloatArray


def one_body(shape: Visual) -> Sequence[FloatArray]:
    """Return the corners of one convex body round the whole ``shape``."""
    return [shape.kept(lambda: convex_body(shape.mesh.vertices).corners, files=GEOMETRY_FILES)]


def robot_world(
    robot: Robot, pieces: Pieces = one_body
) -> tuple[CollisionWorld | None, tuple[str, ...]]:
    """Return the bodies and pairs of ``robot``, and sentences for a person on what is left out.

    x is that of ``world_of``. An arm of the five-axis family keeps the pairs that sampled postures
    bring near each other. ``pieces`` divides the shapes that were not made as convex bodies for
    such an arm. The world is None if no link has a shape.
    """
    if robot.arm is not None and robot.arm.chain.n == ARM_JOINTS:
        return world_of(robot, as_modelled if robot.collides else pieces)
    touching: list[str] = []

    def make(linkage: Linkage, parts: Sequence[Part]) -> CollisionWorld:
        found = pairs_at_rest(linkage, parts, _at_rest(robot))
        touching.extend(f"{parts[a].name} and {parts[b].name}" for a, b in found.touching)
        return CollisionWorld(linkage, parts, found.checked, found.close)

    world, notes = world_of(robot, pieces, make)
    if touching:
        listed = "; ".join(touching)
        notes = (*notes, f"Not checked, because they touch at rest: {listed}.")
    return world, notes


def _at_rest(robot: Robot) -> FloatArray:
    """Return x with every joint at zero, or at the limit nearest to zero."""
    if robot.arm is None:
        return np.append(robot.joint_group.ready, 0.0)
    chain, gripper = robot.arm.chain, robot.arm.gripper
    return np.append(np.clip(0.0, chain.lower, chain.upper), gripper.clamp(0.0))
