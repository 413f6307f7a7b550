"""The branches that a person can choose from: where each takes the arm, and at what loss."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from katana450.arm.control.arm import ArmModel
from katana450.arm.control.modes import PoseTarget
from katana450.arm.control.state import State
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
    """A branch that the arm can change to.

    Attributes:
        metrics: its posture, cost and distance from a singularity.
        contact: the contact that the arm would have at its end; None if there is none.
    """

    metrics: BranchMetrics
    contact: Contact | None


def current_target(arm: ArmModel, state: State) -> ToolTarget:
    """Return the target that a drag starts from: the present tool target, or that of the goal."""
    if isinstance(state.target, ToolTarget):
        return state.target
    return ToolTarget.at(arm.chain_to(state.tool), state.goal)


def target_on_branch(arm: ArmModel, state: State, branch: Branch) -> ToolTarget:
    """Return the present target in the numbers of ``branch``.

    The plane of another branch may face the other way.
    """
    same = branch.shoulder == state.branch.shoulder
    return current_target(arm, state) if same else current_target(arm, state).turned_round()


def branch_option(arm: ArmModel, state: State, branch: Branch) -> Projection:
    """Return the posture on ``branch`` whose tool is nearest to the target inside the limits."""
    chain = arm.chain_to(state.tool)
    if isinstance(state.target, PoseTarget):
        T = state.target.T
        return project(chain, T, priority=state.priority, branch=branch, q_hint=state.goal)
    return leap(chain, state.goal, target_on_branch(arm, state, branch), branch, state.priority)


def branch_options(
    arm: ArmModel, state: State, world: CollisionWorld | None = None
) -> tuple[BranchOption, ...]:
    """Return one option for each of BRANCHES, measured from where the arm is.

    world: the collision world; without one no contacts are reported.
    """
    chain = arm.chain_to(state.tool)
    found = [
        BranchMetrics.of(chain, branch_option(arm, state, branch), state.q) for branch in BRANCHES
    ]
    return tuple(
        BranchOption(metrics, contact_at(world, metrics.q, state.gripper)) for metrics in found
    )


def contact_at(world: CollisionWorld | None, q: FloatArray, gripper: float) -> Contact | None:
    """Return the two parts that are too near to each other with the joints at ``q`` (n,) [rad].

    gripper: the finger joint [rad or m].
    """
    nearest = None if world is None else world.nearest(np.append(q, gripper))
    return nearest if nearest is not None and nearest.distance < STOP else None
