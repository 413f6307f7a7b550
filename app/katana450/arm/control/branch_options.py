"""The branches a person can choose from: where each would take the arm, and what it gives up."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from katana450.arm.control.arm import ArmModel
from katana450.arm.control.state import PoseTarget, State
from katana450.maths.collision.clearance import STOP
from katana450.maths.collision.contact import Contact
from katana450.maths.collision.world import CollisionWorld
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.branch import BRANCHES, Branch
from katana450.maths.kinematics.branch_metrics import BranchMetrics
from katana450.maths.kinematics.projection import Projection, project
from katana450.maths.kinematics.tool import ToolTarget
from katana450.maths.kinematics.tracker import leap


@dataclass(frozen=True, eq=False)
class BranchOption:
    """A branch to take. contact: what the arm would meet at its end; None when nothing."""

    metrics: BranchMetrics
    contact: Contact | None


def current_target(arm: ArmModel, state: State) -> ToolTarget:
    """The five numbers that a drag starts from: those last wished, else those of the goal."""
    if isinstance(state.target, ToolTarget):
        return state.target
    return ToolTarget.at(arm.chain_to(state.tool), state.goal)


def target_on_branch(arm: ArmModel, state: State, branch: Branch) -> ToolTarget:
    """The same wish in the numbers of ``branch``, whose plane may face the other way."""
    same = branch.shoulder == state.branch.shoulder
    return current_target(arm, state) if same else current_target(arm, state).turned_round()


def branch_option(arm: ArmModel, state: State, branch: Branch) -> Projection:
    """Where ``branch`` has the tool as it is wished, as near as the limits allow there."""
    chain = arm.chain_to(state.tool)
    if isinstance(state.target, PoseTarget):
        T = state.target.T
        return project(chain, T, priority=state.priority, branch=branch, q_hint=state.goal)
    return leap(chain, state.goal, target_on_branch(arm, state, branch), branch, state.priority)


def branch_options(
    arm: ArmModel, state: State, world: CollisionWorld | None = None
) -> tuple[BranchOption, ...]:
    """The choice on each of BRANCHES, seen from where the arm is.

    world: what must not be touched; without one nothing is said of contacts.
    """
    chain = arm.chain_to(state.tool)
    found = [
        BranchMetrics.of(chain, branch_option(arm, state, branch), state.q) for branch in BRANCHES
    ]
    return tuple(
        BranchOption(metrics, contact_at(world, metrics.q, state.gripper)) for metrics in found
    )


def contact_at(world: CollisionWorld | None, q: FloatArray, gripper: float) -> Contact | None:
    """The two parts that are too near to each other with the joints at ``q`` (n,) [rad]."""
    nearest = None if world is None else world.nearest(np.append(q, gripper))
    return nearest if nearest is not None and nearest.distance < STOP else None
