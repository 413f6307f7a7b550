"""Transforms of a state: to another goal, another mode, a pause, or a place on a plan."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from katana450.arm.control.arm import ArmModel
from katana450.arm.control.commands.commands import JOG_TIME, ClearStop, Command, Servo, TimedServo
from katana450.arm.control.state.modes import (
    IDLE,
    Following,
    Intent,
    JointTarget,
    Leaving,
    Positioning,
    Servoing,
    Tracking,
)
from katana450.arm.control.state.state import CAUSES, GRIPPER_REASONS, Finding, Reason, State
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.motion.limiter import Limits
from katana450.maths.motion.stream import Stream
from katana450.maths.planning.plan import Plan

START_TOLERANCE = 1e-6
"""[rad] Distance from the start of a plan up to which the arm counts as standing there. It is below
the resolution of any encoder."""

MAX_SAMPLE_AGE = 0.1
"""[s] Age of a sample above which its time is ignored: it comes from another clock."""


def with_mode(state: State, mode: Intent | Following) -> State:
    """Return ``state`` in ``mode``; an arm on a plan leaves the plan first."""
    along = state.following
    if along is None or isinstance(mode, Following):
        return replace(state, mode=mode)
    return replace(state, mode=Leaving(along, mode))


def with_goal(
    state: State,
    goal: FloatArray,
    findings: tuple[Finding, ...] = (),
    mode: Intent | Following | None = None,
) -> State:
    """Return ``state`` with ``goal`` (n,), the reasons ``findings`` for it, and ``mode``.

    Without a mode the state is positioning at the goal.
    """
    of_gripper = tuple(f for f in state.findings if f.reason in GRIPPER_REASONS)
    pause = tuple(f for f in state.findings if f.reason is Reason.PAUSED)
    # The contact that the arm brakes for stays a finding when a new goal comes.
    contacts = tuple(f for f in state.findings if f.reason is Reason.CONTACT and state.blocked)
    aimed = replace(state, goal=goal, findings=pause + contacts + findings + of_gripper)
    return with_mode(aimed, Positioning(JointTarget(goal)) if mode is None else mode)


def without_finding(state: State, *reasons: Reason) -> State:
    """Return ``state`` without the findings of those ``reasons``."""
    return replace(state, findings=tuple(f for f in state.findings if f.reason not in reasons))


def without_cause(state: State) -> State:
    """Return ``state`` after a command that ends a pause or a stop by the server."""
    if not any(f.reason is Reason.WAITING or f.reason in CAUSES for f in state.findings):
        return state
    return without_finding(state, Reason.WAITING, *CAUSES)


def end_drag(state: State) -> State:
    """Return ``state`` after the end of a drag: the goal becomes the target.

    An arm that waits before a contact stays where it is. The findings stay, because they explain
    why the handle springs back.
    """
    match state.intent:
        case Tracking() as tracking:
            return with_mode(state, replace(tracking, let_go=True))
        case Positioning() as positioning:
            state = replace(state, goal=state.setpoint if state.blocked else state.goal)
            ended = replace(positioning, target=JointTarget(state.goal))
            return with_mode(replace(state, blocked=False), ended)
    goal = state.setpoint if state.blocked else state.goal
    return replace(state, goal=goal, blocked=False)


def paused(state: State, cause: Finding | None = None) -> State:
    """Return ``state`` that comes to rest on its path and keeps its goal.

    cause: that of a pause by the server, which leaves an earlier pause as it is; None for a person,
    whose pause lasts.
    """
    if state.paused and cause is not None:
        return state
    moving = resumed(state)
    why = (Finding(Reason.PAUSED),) if cause is None else (Finding(Reason.PAUSED), cause)
    return replace(moving, paused=True, findings=(*why, *moving.findings))


def resumed(state: State) -> State:
    """Return ``state`` that continues after a pause."""
    cause = state.pause_cause
    reasons = (Reason.PAUSED,) if cause is None else (Reason.PAUSED, cause.reason)
    return without_finding(replace(state, paused=False), *reasons)


def with_stream_sample(
    state: State, aimed: State, command: Servo, acceleration: FloatArray
) -> State:
    """Return ``aimed`` in the mode of a stream that continues with the sample ``command``.

    state: the state before. aimed: ``state`` with the sample as its goal. acceleration: (n,) the
    maximum of each joint.
    """
    t = command.t if isinstance(command, TimedServo) else state.t
    if state.servo is None:
        return with_mode(aimed, Servoing(Stream.begin(t, aimed.goal, command.qd)))
    stream = state.servo.followed_by(t, aimed.goal, command.qd, acceleration)
    return with_mode(aimed, Servoing(stream))


def end_stream(state: State, rest: FloatArray, limits: Limits) -> State:
    """Return ``state`` that comes to rest at the last sample of its stream.

    An arm that has not followed it, because of a contact or of its ``limits``, comes to rest at
    ``rest`` (n,) [rad or m], the end of a brake begun now.
    """
    near = np.abs(state.goal - rest) <= JOG_TIME * limits.speed
    goal = state.goal if near.all() and not state.blocked else rest
    return with_goal(state, goal, mode=IDLE)


def with_time(command: Command, t: float) -> Command:
    """Return ``command`` for the tick at ``t`` [s].

    A sample of a stream without a valid time of its own gets the time of the tick. So does the end
    of a stop, which is refused too early.
    """
    match command:
        case ClearStop(known=known):
            return ClearStop(known, t)
        case TimedServo(t=sampled) if 0.0 <= t - sampled < MAX_SAMPLE_AGE:
            return command
        case Servo():
            return command.timed(t)
    return command


def follow_plan(arm: ArmModel, state: State, plan: Plan, tau: float) -> State:
    """Return ``state`` that follows ``plan`` from here.

    If the arm does not stand at ``tau`` [s] of it, it does not move, and a finding reports it.
    """
    distances = np.abs(state.setpoint - (plan.q(tau) if tau else plan.start))
    if distances.max() > START_TOLERANCE or not state.motion.at_rest:
        axis = int(distances.argmax())
        finding = Finding(Reason.NOT_AT_START, float(distances[axis]), axis)
        return replace(state, findings=(*state.findings, finding))
    branch = arm.kinematics.branch_of(plan.end)
    return with_goal(replace(state, branch=branch), plan.end, (), Following.begin(plan, tau))


def with_place(state: State, along: Following | None) -> State:
    """Return ``state`` at the place ``along`` on the plan that it follows or is leaving."""
    if along is None or along is state.following:
        return state
    if isinstance(state.mode, Leaving):
        return replace(state, mode=replace(state.mode, along=along))
    return replace(state, mode=along)
