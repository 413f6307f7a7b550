"""Transforms of the state of an arm towards targets of its tool: poses, drags, branches, jogs."""

from __future__ import annotations

from dataclasses import replace

from katana450.arm.control.arm import ArmModel
from katana450.arm.control.branch_options import (
    branch_option,
    branch_refusal,
    current_target,
    target_on_branch,
)
from katana450.arm.control.findings import of_jog
from katana450.arm.control.goals import go_on_detour, with_goal, with_mode
from katana450.arm.control.modes import (
    IDLE,
    Jogging,
    JointTarget,
    PoseTarget,
    Positioning,
    Target,
    Tracking,
)
from katana450.arm.control.state import CAUSES, GRIPPER_REASONS, Reason, State
from katana450.arm.control.tool_commands import StepTool, TurnCommand
from katana450.errors import InputError
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.branch import AnyBranch
from katana450.maths.kinematics.tool import ToolTarget

KEPT_REASONS = (Reason.PAUSED, Reason.CONTACT, Reason.WAITING, *CAUSES, *GRIPPER_REASONS)
"""The reasons that a jog keeps; it computes all others again."""


def with_pose_target(arm: ArmModel, state: State, target: PoseTarget) -> State:
    """Return ``state`` with the nearest pose to ``target`` on its branch as the goal."""
    kinematics = arm.kinematics_to(state.tool)
    best = kinematics.project(state, target.T, state.branch)
    findings = kinematics.losses(state, best, yaw_was_given=True)
    return with_goal(state, best.q, findings, Positioning(target))


def dragged(arm: ArmModel, state: State, target: ToolTarget, *, let_go: bool = False) -> State:
    """Return ``state`` that tracks ``target`` from now on, along the path of the drag.

    let_go: whether the drag has ended already.
    """
    since = current_target(arm, state) if state.since is None else state.since
    return with_mode(state, Tracking(target, since, let_go))


def turned(arm: ArmModel, state: State, command: TurnCommand) -> State:
    """Return ``state`` that tracks its tool target with the orientation of ``command``."""
    kinematics = arm.kinematics_to(state.tool)
    target = kinematics.turned(state, current_target(arm, state), command)
    return dragged(arm, state, target)


def stepped(arm: ArmModel, state: State, step: StepTool) -> State:
    """Return ``state`` with its tool target moved by ``step``."""
    kinematics = arm.kinematics_to(state.tool)
    target = kinematics.stepped(state, current_target(arm, state), step)
    return dragged(arm, state, target, let_go=True)


def tracked(arm: ArmModel, state: State, tracking: Tracking) -> State:
    """Return ``state`` with its goal moved towards the dragged target, as far as a tick allows."""
    kinematics = arm.kinematics_to(state.tool)
    found = kinematics.track(state, tracking.target, tracking.since)
    if found.since is not None:
        return with_mode(replace(state, goal=found.best.q), replace(tracking, since=found.since))
    target = JointTarget(found.best.q) if tracking.let_go else tracking.target
    findings = kinematics.tracking_losses(state, found)
    mode = Positioning(target, found.beyond_gap)
    return with_goal(state, found.best.q, findings, mode)


def gone(arm: ArmModel, state: State) -> State:
    """Return ``state`` that follows the detour on offer to the pose beyond the gap."""
    assert state.beyond_gap is not None
    kinematics = arm.kinematics_to(state.tool)
    losses = kinematics.losses(state, state.beyond_gap, yaw_was_given=False)
    return go_on_detour(state, losses)


def with_reapplied_priority(arm: ArmModel, state: State) -> State:
    """Return ``state`` with its pose or tool target projected again, under the present priority."""
    match state.intent:
        case Positioning(target=PoseTarget() as target):
            return with_pose_target(arm, state, target)
        case Positioning(target=JointTarget() as target):
            # A pose beyond a gap was nearest by the earlier priority.
            gap = state.beyond_gap is not None
            return with_mode(state, Positioning(target)) if gap else state
        case Positioning():
            return dragged(arm, state, current_target(arm, state))
        case Tracking() as tracking:
            return dragged(arm, state, tracking.target, let_go=tracking.let_go)
    return state


def with_branch(arm: ArmModel, state: State, branch: AnyBranch) -> State:
    """Return ``state`` that moves to ``branch`` with the tool at its target.

    Raises InputError if the limits exclude the branch.
    """
    best = branch_option(arm, state, branch)
    if refusal := branch_refusal(branch, best):
        raise InputError(f"{refusal}.")
    target: Target = JointTarget(best.q)
    if isinstance(state.target, PoseTarget):
        target = state.target
    elif not isinstance(state.target, JointTarget):
        target = target_on_branch(arm, state, branch)
    findings = arm.kinematics_to(state.tool).losses(
        state, best, yaw_was_given=isinstance(target, PoseTarget)
    )
    return with_goal(replace(state, branch=best.branch), best.q, findings, Positioning(target))


def jogged(arm: ArmModel, state: State, jogging: Jogging, rest: FloatArray) -> State:
    """Return ``state`` after a tick of a jog, with ``rest`` (n,) as the goal.

    rest: the posture at which a brake begun now ends. So the arm comes to rest there if the jog
    is not renewed.
    """
    kinematics, q = arm.kinematics_to(state.tool), state.setpoint
    kept = tuple(f for f in state.findings if f.reason in KEPT_REASONS)
    V = kinematics.jog_twist(q, jogging.rates, jogging.frame)
    held = of_jog(kinematics.chain, q, V)
    branch = kinematics.branch_of(rest)
    aimed = replace(state, goal=rest, branch=branch, findings=kept + held)
    if state.t < jogging.until:
        return aimed
    # The end of a jog brakes all joints in proportion, so the tool stays on its path.
    return with_mode(aimed, IDLE if state.motion.at_rest else jogging.ending())
