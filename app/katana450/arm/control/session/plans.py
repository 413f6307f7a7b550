"""Plans from the present posture of the arm, made before it moves, outside the control thread."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np

from katana450.arm.control.arm import ArmModel
from katana450.arm.control.session.session import TOOL_SPEED
from katana450.arm.control.session.slow_zones import SLOW_SPEED, slow_span
from katana450.arm.control.state.state import State
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
    """Return the joint path from the setpoint of ``state`` to ``q_goal`` (n,) [rad].

    The path is straight if that is clear of ``world``, else sampled at random with ``seed``. Raises
    InputError if the goal is beyond the limits or is the present posture, and BlockedError if no
    clear path was found.
    """
    chain, fingers = arm.chain_to(state.tool), state.gripper_setpoint
    straight = JointPath(chain, np.array((state.setpoint, chain.check_q(q_goal))))
    if world is None:
        return straight
    with suppress(BlockedError):
        check_clear(straight, world, fingers)
        return straight
    return collision_free_path(chain, straight.start, straight.end, world, fingers, seed)


def plan_to(
    arm: ArmModel,
    world: CollisionWorld | None,
    state: State,
    q_goal: FloatArray,
    seed: int = 0,
) -> Plan:
    """Return the plan along ``path_to``, to be sent as ``Follow``."""
    return plan_along(arm, world, state, [path_to(arm, world, state, q_goal, seed)])


def plan_along(
    arm: ArmModel,
    world: CollisionWorld | None,
    state: State,
    paths: Sequence[Path],
    tool_speed: float = TOOL_SPEED,
    tool_acceleration: float | None = None,
) -> Plan:
    """Return the plan for ``paths`` one after another; see ``katana450.maths.planning.plan.plan``.

    tool_speed, tool_acceleration: maximum of the tool point [m/s, m/s^2].
    """
    bounds = Bounds(arm.limits, tool_speed, tool_acceleration)
    timed_plan = plan(paths, bounds, world, state.gripper_setpoint, MARGIN)
    slow = SLOW_SPEED / TOOL_SPEED
    span = 0.0 if world is None else slow_span(timed_plan, world, state.objects, slow)
    return replace(timed_plan, slow_span=span, slow_fraction=slow) if span else timed_plan
