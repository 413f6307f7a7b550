"""How a state comes to another goal, and what it leaves behind by that."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from katana450.arm.control.commands import Command, Servo
from katana450.arm.control.following import Following
from katana450.arm.control.state import GRIPPER_LIMITS, Finding, JointTarget, Reason, State, Target
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.branch import branch_of
from katana450.maths.kinematics.chain import Chain
from katana450.maths.motion.stream import Stream
from katana450.maths.planning.plan import Plan

AT_START = 1e-6
"""[rad] An arm that is no farther from the start of a plan stands there: no encoder tells it."""

OLDEST = 0.1
"""[s] A sample that says it came earlier than this before its tick was stamped by another clock."""


def gone(state: State, target: Target, goal: FloatArray, findings: tuple[Finding, ...]) -> State:
    """With ``goal`` as near to ``target`` as the arm will go, for the reasons ``findings``."""
    kept = tuple(f for f in state.findings if f.reason in GRIPPER_LIMITS)
    pause = tuple(f for f in state.findings if f.reason is Reason.PAUSED)
    # What the arm brakes for stays the reason, however often it is told anew meanwhile.
    met = tuple(f for f in state.findings if f.reason is Reason.CONTACT and state.blocked)
    aimed = replace(
        state,
        target=target,
        goal=goal,
        findings=pause + met + findings + kept,
        mode=None,
    )
    return leaving(aimed)


def without(state: State, reason: Reason) -> State:
    """``state`` with no finding of that ``reason``."""
    return replace(state, findings=tuple(f for f in state.findings if f.reason is not reason))


def leaving(state: State) -> State:
    """``state`` that follows a plan no longer than it takes to leave it."""
    if state.following is None:
        return state
    return replace(state, following=replace(state.following, leaving=True))


def paused(state: State) -> State:
    """``state`` that comes to rest on its way and keeps its goal."""
    told = without(state, Reason.PAUSED).findings
    return replace(state, paused=True, findings=(Finding(Reason.PAUSED), *told))


def resumed(state: State) -> State:
    """``state`` that goes on after a pause."""
    return without(replace(state, paused=False), Reason.PAUSED)


def streamed(state: State, aimed: State, command: Servo, acceleration: FloatArray) -> State:
    """``aimed``, which is ``state`` with the newest of a stream as its goal, in that stream.

    acceleration: (n,) the most of each joint.
    """
    t = state.t if command.t is None else command.t
    if state.servo is None:
        return replace(aimed, mode=Stream.begun(t, aimed.goal, command.qd))
    stream = state.servo.followed_by(t, aimed.goal, command.qd, acceleration)
    return replace(aimed, mode=stream)


def stamped(command: Command, t: float) -> Command:
    """``command`` in the tick at ``t`` [s]: one of a stream came then, unless it says when."""
    if not isinstance(command, Servo) or (command.t is not None and 0.0 <= t - command.t < OLDEST):
        return command
    return replace(command, t=t)


def begun(chain: Chain, state: State, plan: Plan) -> State:
    """``state`` that follows ``plan`` from here, if the arm stands at its start."""
    off = np.abs(state.setpoint - plan.start)
    if off.max() > AT_START or not state.motion.at_rest:
        axis = int(off.argmax())
        told = without(state, Reason.NOT_AT_START).findings
        return replace(
            state, findings=(*told, Finding(Reason.NOT_AT_START, float(off[axis]), axis))
        )
    return _along(chain, state, Following.begun(plan))


def gone_along(chain: Chain, state: State, share: float) -> State:
    """``state`` that goes on or back on its plan; without one there is nowhere to go."""
    following = state.following
    if following is None or following.leaving:
        return state
    return _along(chain, state, replace(following, towards=share * following.plan.span))


def _along(chain: Chain, state: State, following: Following) -> State:
    """With the goal where ``following`` ends."""
    goal = following.goal
    state = replace(state, branch=branch_of(chain, goal))
    return replace(gone(state, JointTarget(goal), goal, ()), following=following)
