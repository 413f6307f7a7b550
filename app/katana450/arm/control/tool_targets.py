"""Transforms of the state of an arm towards targets of its tool: poses, drags, branches, jogs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from katana450.arm.control.arm import ArmModel
from katana450.arm.control.branch_options import branch_option, current_target, target_on_branch
from katana450.arm.control.findings import of_jog, of_projection, of_tracked
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
from katana450.arm.control.motion_stepper import jog_twist
from katana450.arm.control.state import CAUSES, GRIPPER_REASONS, Reason, State
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.kinematics.branch import Branch, branch_of
from katana450.maths.kinematics.forward import forward
from katana450.maths.kinematics.projection import Projection, project
from katana450.maths.kinematics.tool import ToolTarget
from katana450.maths.kinematics.tracker import track
from katana450.maths.kinematics.velocity import JogFrame

NO_RATES = frozen(np.zeros(5))
"""The rates of a jog that ends."""

KEPT_REASONS = (Reason.PAUSED, Reason.CONTACT, Reason.WAITING, *CAUSES, *GRIPPER_REASONS)
"""The reasons that a jog keeps; it computes all others again."""


def with_pose_target(arm: ArmModel, state: State, target: PoseTarget) -> State:
    """Return ``state`` with the nearest pose to ``target`` on its branch as the goal."""
    chain = arm.chain_to(state.tool)
    best = project(chain, target.T, priority=state.priority, branch=state.branch, q_hint=state.goal)
    findings = of_projection(chain, best, state.priority, yaw_was_given=True)
    return with_goal(state, best.q, findings, Positioning(target))


def dragged(arm: ArmModel, state: State, target: ToolTarget, *, let_go: bool = False) -> State:
    """Return ``state`` that tracks ``target`` from now on, along the path of the drag.

    let_go: whether the drag has ended already.
    """
    since = current_target(arm, state) if state.since is None else state.since
    return with_mode(state, Tracking(target, since, let_go))


def stepped(arm: ArmModel, state: State, by: FloatArray, frame: JogFrame) -> State:
    """Return ``state`` with its tool target moved ``by`` (5,): see ``commands.StepTool``."""
    target = current_target(arm, state)
    moved = by[:3]
    if frame is JogFrame.TOOL:
        moved = forward(arm.chain_to(state.tool), state.goal)[:3, :3] @ moved
    pitch, roll = target.pitch + float(by[3]), target.roll + float(by[4])
    target = replace(target, position=frozen(target.position + moved), pitch=pitch, roll=roll)
    return dragged(arm, state, target, let_go=True)


def tracked(arm: ArmModel, state: State, tracking: Tracking) -> State:
    """Return ``state`` with its goal moved towards the dragged target, as far as a tick allows."""
    chain = arm.chain_to(state.tool)
    found = track(
        chain,
        state.goal,
        tracking.target,
        branch=state.branch,
        priority=state.priority,
        since=tracking.since,
    )
    if found.since is not None:
        return with_mode(replace(state, goal=found.best.q), replace(tracking, since=found.since))
    target = JointTarget(found.best.q) if tracking.let_go else tracking.target
    findings = of_tracked(chain, found, state.priority)
    mode = Positioning(target, found.beyond_gap)
    return with_goal(state, found.best.q, findings, mode)


def gone(arm: ArmModel, state: State) -> State:
    """Return ``state`` that follows the detour on offer to the pose beyond the gap."""
    assert state.beyond_gap is not None
    chain = arm.chain_to(state.tool)
    losses = of_projection(chain, state.beyond_gap, state.priority, yaw_was_given=False)
    return go_on_detour(state, losses)


def with_reapplied_priority(arm: ArmModel, state: State) -> State:
    """Return ``state`` with its pose or tool target projected again, under the present priority."""
    match state.intent:
        case Positioning(target=PoseTarget() as target):
            return with_pose_target(arm, state, target)
        case Positioning(target=ToolTarget() as target):
            return dragged(arm, state, target)
        case Positioning(target=target, beyond_gap=Projection()):
            # The pose beyond the gap was nearest by the earlier priority.
            return with_mode(state, Positioning(target))
        case Tracking() as tracking:
            return dragged(arm, state, tracking.target, let_go=tracking.let_go)
    return state


def with_branch(arm: ArmModel, state: State, branch: Branch) -> State:
    """Return ``state`` that moves to ``branch`` with the tool at its target."""
    best = branch_option(arm, state, branch)
    target: Target = JointTarget(best.q)
    if isinstance(state.target, PoseTarget):
        target = state.target
    elif isinstance(state.target, ToolTarget):
        target = target_on_branch(arm, state, branch)
    findings = of_projection(
        arm.chain_to(state.tool), best, state.priority, yaw_was_given=isinstance(target, PoseTarget)
    )
    return with_goal(replace(state, branch=branch), best.q, findings, Positioning(target))


def jogged(arm: ArmModel, state: State, jogging: Jogging, rest: FloatArray) -> State:
    """Return ``state`` after a tick of a jog, with ``rest`` (n,) as the goal.

    rest: the posture at which a brake begun now ends. So the arm comes to rest there if the jog
    is not renewed.
    """
    chain = arm.chain_to(state.tool)
    kept = tuple(f for f in state.findings if f.reason in KEPT_REASONS)
    held = of_jog(chain, state.setpoint, jog_twist(chain, state.setpoint, jogging))
    aimed = replace(state, goal=rest, branch=branch_of(chain, rest), findings=kept + held)
    if state.t < jogging.until:
        return aimed
    # The end of a jog brakes all joints in proportion, so the tool stays on its path.
    return with_mode(aimed, IDLE if state.motion.at_rest else replace(jogging, rates=NO_RATES))
