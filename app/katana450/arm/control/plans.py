"""Plans for the arm as it stands, made before it moves and off the control thread."""

from __future__ import annotations

import numpy as np

from katana450.arm.control.arm import ArmModel
from katana450.arm.control.session import TOOL_SPEED
from katana450.arm.control.state import State
from katana450.errors import BlockedError
from katana450.maths.collision.world import CollisionWorld
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.planning.joint_path import JointPath
from katana450.maths.planning.path import Path
from katana450.maths.planning.plan import MARGIN, Plan, check_clear, plan
from katana450.maths.planning.sampling import collision_free_path
from katana450.maths.planning.scaling import Bounds


def path_to(
    arm: ArmModel, world: CollisionWorld | None, state: State, q_goal: FloatArray, seed: int = 0
) -> JointPath:
    """The way of the joints from where ``state`` has them to ``q_goal`` (n,) [rad].

    Straight where that is clear of ``world``, else a way round found by chance from ``seed``.
    Raises InputError for a goal beyond the limits or where the arm is already, and BlockedError
    when no clear way was found.
    """
    chain = arm.chain_to(state.tool)
    straight = JointPath(chain, np.array((state.setpoint, chain.check_q(q_goal))))
    if world is None:
        return straight
    try:
        check_clear(straight, world, state.gripper_setpoint)
    except BlockedError:
        start, end = straight.start, straight.end
        return collision_free_path(chain, start, end, world, state.gripper_setpoint, seed)
    return straight


def plan_to(
    arm: ArmModel,
    world: CollisionWorld | None,
    state: State,
    q_goal: FloatArray,
    seed: int = 0,
    tool_speed: float = TOOL_SPEED,
) -> Plan:
    """The plan of `path_to`, timed: to be sent as `Follow`."""
    return plan_along(arm, world, state, [path_to(arm, world, state, q_goal, seed)], tool_speed)


def plan_along(
    arm: ArmModel,
    world: CollisionWorld | None,
    state: State,
    paths: list[Path],
    tool_speed: float = TOOL_SPEED,
    tool_acceleration: float | None = None,
) -> Plan:
    """The plan for ``paths`` one after another, as `katana450.maths.planning.plan.plan` has it."""
    bounds = Bounds(arm.limits, tool_speed, tool_acceleration)
    return plan(paths, bounds, world, state.gripper_setpoint, MARGIN)
