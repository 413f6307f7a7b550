"""Transforms of a state: to another goal, another mode, a pause, or a place on a plan."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from katana450.arm.control.commands import Command, Servo
from katana450.arm.control.modes import (
    Following,
    Intent,
    JointTarget,
    Leaving,
    Positioning,
    Servoing,
    Tracking,
)
from katana450.arm.control.state import GRIPPER_LIMITS, Finding, Reason, State
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.branch import branch_of
from katana450.maths.kinematics.chain import Chain
from katana450.maths.motion.stream import Stream
from katana450.maths.planning.plan import Plan

START_TOLERANCE = 1e-6
"""[rad] An arm that is no farther from the start of a plan stands there: no encoder tells it."""

MAX_SAMPLE_AGE = 0.1
"""[s] A sample that says it came earlier than this before its tick was stamped by another clock."""


def with_mode(state: State, mode: Intent | Following) -> State:
    """``state`` in ``mode``; an arm on a plan leaves the plan first."""
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
    """``state`` with ``goal`` (n,) for the reasons ``findings``, in ``mode``.

    Without a mode it is positioning at the goal.
    """
    kept = tuple(f for f in state.findings if f.reason in GRIPPER_LIMITS)
    pause = tuple(f for f in state.findings if f.reason is Reason.PAUSED)
    # A contact that the arm brakes for stays the reason, however often a goal is given meanwhile.
    met = tuple(f for f in state.findings if f.reason is Reason.CONTACT and state.blocked)
    aimed = replace(state, goal=goal, findings=pause + met + findings + kept)
    return with_mode(aimed, Positioning(JointTarget(goal)) if mode is None else mode)


def without_finding(state: State, reason: Reason) -> State:
    """``state`` with no finding of that ``reason``."""
    return replace(state, findings=tuple(f for f in state.findings if f.reason is not reason))


def end_drag(state: State) -> State:
    """``state`` after the end of a drag: the goal becomes the target.

    An arm that waits before a contact stays where it is. The findings stay: they say why the handle
    springs back.
    """
    match state.intent:
        case Tracking() as tracking:
            return with_mode(state, replace(tracking, let_go=True))
        case Positioning():
            state = replace(state, goal=state.setpoint if state.blocked else state.goal)
            return with_mode(replace(state, blocked=False), Positioning(JointTarget(state.goal)))
    goal = state.setpoint if state.blocked else state.goal
    return replace(state, goal=goal, blocked=False)


def paused(state: State) -> State:
    """``state`` that comes to rest on its way and keeps its goal."""
    others = without_finding(state, Reason.PAUSED).findings
    return replace(state, paused=True, findings=(Finding(Reason.PAUSED), *others))


def resumed(state: State) -> State:
    """``state`` that continues after a pause."""
    return without_finding(replace(state, paused=False), Reason.PAUSED)


def with_stream_sample(
    state: State, aimed: State, command: Servo, acceleration: FloatArray
) -> State:
    """``aimed``, which is ``state`` with the newest sample of a stream as its goal, in that stream.

    acceleration: (n,) the maximum of each joint.
    """
    t = state.t if command.t is None else command.t
    if state.servo is None:
        return with_mode(aimed, Servoing(Stream.begin(t, aimed.goal, command.qd)))
    stream = state.servo.followed_by(t, aimed.goal, command.qd, acceleration)
    return with_mode(aimed, Servoing(stream))


def with_time(command: Command, t: float) -> Command:
    """``command`` in the tick at ``t`` [s]: a sample of a stream came then, unless it says when."""
    if not isinstance(command, Servo) or (
        command.t is not None and 0.0 <= t - command.t < MAX_SAMPLE_AGE
    ):
        return command
    return replace(command, t=t)


def follow_plan(chain: Chain, state: State, plan: Plan) -> State:
    """``state`` that follows ``plan`` from here.

    Where the arm does not stand at the start nothing changes but the finding that says so.
    """
    off = np.abs(state.setpoint - plan.start)
    if off.max() > START_TOLERANCE or not state.motion.at_rest:
        axis = int(off.argmax())
        others = without_finding(state, Reason.NOT_AT_START).findings
        return replace(
            state, findings=(*others, Finding(Reason.NOT_AT_START, float(off[axis]), axis))
        )
    return _along(chain, state, Following.begin(plan))


def move_along_plan(chain: Chain, state: State, fraction: float) -> State:
    """``state`` that continues or goes back on its plan to ``fraction`` of it, from 0 to 1."""
    assert isinstance(state.mode, Following)
    towards = fraction * state.mode.plan.span
    return _along(chain, state, replace(state.mode, towards=towards))


def with_place(state: State, along: Following | None) -> State:
    """``state`` at the place ``along`` on the plan it follows or is leaving."""
    if along is None or along is state.following:
        return state
    if isinstance(state.mode, Leaving):
        return replace(state, mode=replace(state.mode, along=along))
    return replace(state, mode=along)


def _along(chain: Chain, state: State, following: Following) -> State:
    """``state`` with its goal where ``following`` ends."""
    goal = following.goal
    return with_goal(replace(state, branch=branch_of(chain, goal)), goal, (), following)
