"""Plans from the present posture of the arm, made before it moves, outside the control thread."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress

import numpy as np

from katana450.arm.control.arm import ArmModel
from katana450.arm.control.session.session import TOOL_SPEED
from katana450.arm.control.state.state import State
from katana450.errors import BlockedError
from katana450.maths.collision.world import CollisionWorld
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.branch import Branch
from katana450.maths.planning.joint_path import JointPath
from katana450.maths.planning.path import Path
from katana450.maths.planning.plan import MARGIN, Plan, check_clear, plan
from katana450.maths.planning.sampling import BranchRegion, collision_free_paths
from katana450.maths.planning.scaling import Bounds

DETOUR_SEARCHES = 5
"""Maximum number of searches for a detour. In a narrow region one search can fail by bad luck."""


def path_to(
    arm: ArmModel, world: CollisionWorld | None, state: State, q_goal: FloatArray, seed: int = 0
) -> JointPath:
    """Return the joint path from the setpoint of ``state`` to ``q_goal`` (n,) [rad].

    The path is straight if that is clear of ``world``, else sampled at random with ``seed``. Raises
    InputError if the goal is beyond the limits or is the present posture, and BlockedError if no
    clear path was found.
    """
    (path,) = _paths_to(arm, world, state, q_goal, seed, None)
    return path


def _paths_to(
    arm: ArmModel,
    world: CollisionWorld | None,
    state: State,
    q_goal: FloatArray,
    seed: int,
    branch: Branch | None,
) -> list[JointPath]:
    """Return the paths as ``path_to``; those of a ``branch`` stay on it."""
    chain, fingers = arm.chain_to(state.tool), state.gripper_setpoint
    straight = JointPath(chain, np.array((state.setpoint, chain.check_q(q_goal))))
    start, end = straight.start, straight.end
    try:
        if world is not None:
            check_clear(straight, world, fingers)
        if branch is None or BranchRegion(chain, branch).holds_line(start, end):
            return [straight]
    except BlockedError:
        pass
    return collision_free_paths(chain, start, end, world, fingers, seed, branch)


def plan_to(
    arm: ArmModel,
    world: CollisionWorld | None,
    state: State,
    q_goal: FloatArray,
    seed: int = 0,
) -> Plan:
    """Return the plan along ``path_to``, to be sent as ``Follow``."""
    return plan_along(arm, world, state, [path_to(arm, world, state, q_goal, seed)])


def detour_from(arm: ArmModel, world: CollisionWorld | None, state: State) -> Plan:
    """Return the plan of a detour to the pose beyond the gap, to be sent as ``OfferDetour``.

    With five axes it stays on the branch of ``state``, which has that pose. Raises BlockedError if
    none is found.
    """
    assert state.beyond_gap is not None
    q_goal = state.beyond_gap.q
    # The end is on the branch, wherever the path leads.
    branch = Branch.parse(str(state.branch)) if arm.kinematics.is_pitched else None
    *seeds, last = range(DETOUR_SEARCHES)
    for seed in seeds:
        with suppress(BlockedError):
            return plan_along(arm, world, state, _paths_to(arm, world, state, q_goal, seed, branch))
    return plan_along(arm, world, state, _paths_to(arm, world, state, q_goal, last, branch))


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
    return plan(paths, bounds, world, state.gripper_setpoint, MARGIN)
