"""The branches that a person can choose from: where each takes the arm, and at what loss."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from katana450.arm.control.arm import ArmModel
from katana450.arm.control.messages import excluded
from katana450.arm.control.modes import JointTarget, PoseTarget
from katana450.arm.control.state import State
from katana450.errors import InputError
from katana450.maths.collision.clearance import STOP
from katana450.maths.collision.contact import Contact
from katana450.maths.collision.world import CollisionWorld
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.branch import AnyBranch
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.projection import Projection
from katana450.maths.kinematics.solution import Solution
from katana450.maths.kinematics.tool import ToolTarget
from katana450.maths.kinematics.velocity import singular_values


@dataclass(frozen=True, eq=False)
class BranchMetrics:
    """One branch at a pose, with its cost and its quality.

    Attributes:
        branch: the branch.
        q: joint angles (n,) of the branch [rad].
        within_limits: True if the arm can go there.
        position_error, rotation_error: difference [m], [rad] from the pose.
        distance: the largest angle that any joint has to turn [rad].
        time: duration until all joints are there, each at its own maximum speed [s].
        smallest_singular_value: 0 in a singularity [1].
    """

    branch: AnyBranch
    q: FloatArray
    within_limits: bool
    position_error: float
    rotation_error: float
    distance: float
    time: float
    smallest_singular_value: float

    @staticmethod
    def of(chain: Chain, found: Solution | Projection, q: npt.ArrayLike) -> BranchMetrics:
        """Return the metrics of `found`, seen from the joint angles `q` (n,) [rad].

        Between two postures inside the limits the straight path in joint space is inside too, so
        distance and time belong to a path that the arm can follow.
        """
        turns = np.abs(found.q - chain.check_q(q))
        return BranchMetrics(
            branch=found.branch,
            q=found.q,
            within_limits=chain.within_limits(found.q),
            position_error=found.position_error,
            rotation_error=found.rotation_error,
            distance=float(turns.max()),
            time=float((turns / chain.speed).max()),
            smallest_singular_value=float(singular_values(chain, found.q)[-1]),
        )


@dataclass(frozen=True, eq=False)
class BranchOption:
    """A branch that the arm can change to.

    Attributes:
        metrics: its posture, cost and distance from a singularity.
        contact: the contact that the arm would have at its end; None if there is none.
        refusal: why the arm cannot take the branch; empty if it can. If it cannot, the metrics are
            those of the nearest posture on another one.
    """

    metrics: BranchMetrics
    contact: Contact | None
    refusal: str = ""


def branch_named(arm: ArmModel, name: str) -> AnyBranch:
    """Return the branch of that name. Raises InputError with the names of all."""
    for branch in arm.kinematics.branches:
        if str(branch) == name:
            return branch
    names = ", ".join(map(str, arm.kinematics.branches))
    raise InputError(f"This arm has no branch {name!r}; its branches are {names}.")


def current_target(arm: ArmModel, state: State) -> ToolTarget:
    """Return the target that a drag starts from: the present tool target, or that of the goal."""
    if not isinstance(state.target, JointTarget | PoseTarget):
        return state.target
    return arm.kinematics_to(state.tool).target_at(state.goal)


def target_on_branch(arm: ArmModel, state: State, branch: AnyBranch) -> ToolTarget:
    """Return the present target in the numbers of ``branch``."""
    kinematics = arm.kinematics_to(state.tool)
    return kinematics.target_on(state, current_target(arm, state), branch)


def branch_option(arm: ArmModel, state: State, branch: AnyBranch) -> Projection:
    """Return the posture on ``branch`` whose tool is nearest to the target inside the limits."""
    kinematics = arm.kinematics_to(state.tool)
    if isinstance(state.target, PoseTarget):
        return kinematics.project(state, state.target.T, branch)
    return kinematics.leap(state, target_on_branch(arm, state, branch), branch)


def branch_options(
    arm: ArmModel, state: State, world: CollisionWorld | None = None
) -> tuple[BranchOption, ...]:
    """Return one option for each branch, measured from where the arm is.

    world: the collision world; without one no contacts are reported.
    """
    chain = arm.chain_to(state.tool)
    found = [(branch, branch_option(arm, state, branch)) for branch in arm.kinematics.branches]
    return tuple(
        BranchOption(
            replace(BranchMetrics.of(chain, best, state.q), branch=branch),
            contact_at(world, best.q, state.gripper),
            branch_refusal(branch, best),
        )
        for branch, best in found
    )


def branch_refusal(branch: AnyBranch, best: Projection) -> str:
    """Return why the arm cannot take ``branch``, of which ``best`` is the option; else empty."""
    taken = best.branch == branch or not best.limits
    return "" if taken else excluded(branch, best.limits)


def contact_at(world: CollisionWorld | None, q: FloatArray, gripper: float) -> Contact | None:
    """Return the two parts that are too near to each other with the joints at ``q`` (n,) [rad].

    gripper: the finger joint [rad or m].
    """
    nearest = None if world is None else world.nearest(np.append(q, gripper))
    return nearest if nearest is not None and nearest.distance < STOP else None
