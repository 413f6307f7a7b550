"""Transforms of the state of an arm towards targets of its tool: poses, drags, branches, jogs."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from katana450.arm.control.arm import ArmModel
from katana450.arm.control.commands.tool_commands import StepTool, TurnCommand
from katana450.arm.control.session.goals import with_goal, with_mode
from katana450.arm.control.state.findings import of_elbow, of_jog
from katana450.arm.control.state.messages import excluded
from katana450.arm.control.state.modes import (
    IDLE,
    Jogging,
    JointTarget,
    PoseTarget,
    Positioning,
    Target,
    Tracking,
)
from katana450.arm.control.state.state import CAUSES, GRIPPER_REASONS, Reason, State
from katana450.errors import InputError
from katana450.maths.collision.clearance import MIN_CLEARANCE
from katana450.maths.collision.engine import Contact
from katana450.maths.collision.world import CollisionWorld
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.kinematics.branch import AnyBranch
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.forward import forward, jacobian_body
from katana450.maths.kinematics.projection import Projection
from katana450.maths.kinematics.tool import ToolTarget
from katana450.maths.kinematics.velocity import JogFrame, singular_values
from katana450.maths.motion.arm_angle import elbow_turn


@dataclass(frozen=True, eq=False)
class BranchOption:
    """A branch that the arm can change to, with its cost and its quality.

    Attributes:
        branch: the branch.
        q: joint angles (n,) of the branch [rad]; of the nearest posture on another one if the arm
            cannot take the branch.
        within_limits: True if the arm can go there.
        position_error, rotation_error: difference [m], [rad] from the pose.
        distance: the largest angle that any joint has to turn [rad]. Inside the limits the straight
            path in joint space is one that the arm can follow.
        time: duration until all joints are there, each at its own maximum speed [s].
        smallest_singular_value: 0 in a singularity [1].
        contact: the contact that the arm would have at its end; None if there is none.
        refusal: why the arm cannot take the branch; empty if it can.
    """

    branch: AnyBranch
    q: FloatArray
    within_limits: bool
    position_error: float
    rotation_error: float
    distance: float
    time: float
    smallest_singular_value: float
    contact: Contact | None = None
    refusal: str = ""


ELBOW_RATE = 1.0
"""[rad/s] Maximum rate at which the arm angle turns by an angle."""

ELBOW_EXACT = 1e-6
"""[rad] Rest of a turn of the elbow that counts as none."""

TOOL_EXACT = 1e-6
"""[m], [1] Change of the pose of the tool up to which the elbow keeps it."""

SLOW = 1e-6
"""[rad/s], [m/s] Twist of the tool below which it rests, so that its pose can be kept."""


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
    chain, options = arm.chain_to(state.tool), []
    for branch in arm.kinematics.branches:
        best = branch_option(arm, state, branch)
        turns = np.abs(best.q - state.q)
        option = BranchOption(
            branch=branch,
            q=best.q,
            within_limits=chain.within_limits(best.q),
            position_error=best.position_error,
            rotation_error=best.rotation_error,
            distance=float(turns.max()),
            time=float((turns / chain.speed).max()),
            smallest_singular_value=float(singular_values(chain, best.q)[-1]),
            contact=contact_at(world, best.q, state.gripper),
            refusal=branch_refusal(branch, best),
        )
        options.append(option)
    return tuple(options)


def branch_refusal(branch: AnyBranch, best: Projection) -> str:
    """Return why the arm cannot take ``branch``, of which ``best`` is the option; else empty."""
    if best.branch == branch:
        return ""
    if not best.limits:
        return f"No posture of branch {branch} has the tool at its target"
    return excluded(branch, best.limits)


def contact_at(world: CollisionWorld | None, q: FloatArray, gripper: float) -> Contact | None:
    """Return the two parts that are too near to each other with the joints at ``q`` (n,) [rad].

    gripper: the finger joint [rad or m].
    """
    nearest = None if world is None else world.nearest(np.append(q, gripper))
    return nearest if nearest is not None and nearest.distance < MIN_CLEARANCE else None


KEPT_REASONS = (
    Reason.PAUSED,
    Reason.CONTACT,
    Reason.WAITING,
    Reason.SLOW_ZONE,
    *CAUSES,
    *GRIPPER_REASONS,
)
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
    pan = kinematics.pan(state.goal)
    return dragged(arm, state, command.turned(current_target(arm, state), pan))


def stepped(arm: ArmModel, state: State, step: StepTool) -> State:
    """Return ``state`` with its tool target moved by ``step``."""
    kinematics = arm.kinematics_to(state.tool)
    target = kinematics.stepped(state, current_target(arm, state), step)
    return dragged(arm, state, target, let_go=True)


def tracked(arm: ArmModel, state: State, tracking: Tracking) -> State:
    """Return ``state`` with its goal moved towards the dragged target, as far as a tick allows."""
    kinematics = arm.kinematics_to(state.tool)
    progress = kinematics.track(state, tracking.target, tracking.since)
    state = replace(state, branch=progress.best.branch)
    if progress.since is not None:
        return with_mode(
            replace(state, goal=progress.best.q), replace(tracking, since=progress.since)
        )
    target = JointTarget(progress.best.q) if tracking.let_go else tracking.target
    findings = kinematics.tracking_losses(state, progress)
    mode = Positioning(target, progress.beyond_gap)
    return with_goal(state, progress.best.q, findings, mode)


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


def with_jog(state: State, jogging: Jogging) -> State:
    """Return ``state`` that moves as ``jogging`` says, or continues a jog so."""
    return with_mode(state, jogging if state.jogging is None else state.jogging.continued(jogging))


def with_elbow_turn(state: State, by: float) -> State:
    """Return ``state`` whose elbow turns by ``by`` [rad] more than it has yet to."""
    left = 0.0 if state.jogging is None else state.jogging.turn or 0.0
    rates = frozen((0.0,) * 6 + (ELBOW_RATE,))
    return with_jog(state, Jogging(rates, JogFrame.BASE, state.t, turn=left + by))


def jogged(
    arm: ArmModel, state: State, jogging: Jogging, start: FloatArray, rest: FloatArray
) -> State:
    """Return ``state`` after a tick of a jog, with ``rest`` (n,) as the goal.

    Args:
        arm: the arm.
        state: the state after the tick.
        jogging: its mode.
        start: the setpoint before the tick.
        rest: the posture at which a brake begun now ends. So the arm comes to rest there if the jog
            is not renewed.
    """
    kinematics, q = arm.kinematics_to(state.tool), state.setpoint
    chain = kinematics.chain
    other_findings = tuple(f for f in state.findings if f.reason in KEPT_REASONS)
    V = kinematics.jog_twist(q, jogging.rates, jogging.frame)
    held = of_jog(chain, q, V)
    # At a limit or a contact the elbow comes to rest before its angle.
    ends = jogging.kept is not None and state.motion.at_rest and not state.paused
    jogging = _with_progress(chain, state, jogging, start)
    if jogging.elbow_rate:
        held += of_elbow(chain, q, jogging.elbow_rate)
    branch = kinematics.branch_of(rest)
    aimed = replace(state, goal=rest, branch=branch, findings=other_findings + held)
    if state.t < jogging.until or (jogging.turn and not ends):
        return with_mode(aimed, jogging)
    # The end of a jog brakes all joints in proportion, so the tool stays on its path.
    return with_mode(aimed, IDLE if state.motion.at_rest else jogging.ending())


def _with_progress(chain: Chain, state: State, jogging: Jogging, start: FloatArray) -> Jogging:
    """Return ``jogging`` after a tick from the setpoint ``start`` (n,) to that of ``state``."""
    q = state.setpoint
    if jogging.turn is not None:
        left = jogging.turn - elbow_turn(chain, start, q)
        jogging = replace(jogging, turn=0.0 if abs(left) < ELBOW_EXACT else left)
    T = forward(chain, q)
    if jogging.kept is not None:
        # A brake of every joint by itself, before a contact, has moved the tool.
        moved = np.abs(T - jogging.kept).max() > TOOL_EXACT
        return replace(jogging, kept=None) if moved else jogging
    # The tool of an arm that was moving comes to rest first.
    if not jogging.keeps_tool or np.abs(jacobian_body(chain, q) @ state.motion.qd).max() > SLOW:
        return jogging
    return replace(jogging, kept=frozen(T))
