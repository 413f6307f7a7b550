"""The session of a mechanism that is driven joint by joint: no tool of it can be brought anywhere.

The rules are those of ``session``, as far as they are about joints: what is wished is kept apart
from the goal, setpoints have mass, a stop is a state.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import NoReturn

import numpy as np

from katana450 import tolerances
from katana450.arm.control import commands as cmd
from katana450.arm.control.aims import gone, paused, resumed, stamped, streamed, without
from katana450.arm.control.arrangement import dressed
from katana450.arm.control.choices import Choice
from katana450.arm.control.joints import Joints
from katana450.arm.control.outcome import take_all
from katana450.arm.control.pouring import Pouring
from katana450.arm.control.session import LONGEST_STEP
from katana450.arm.control.state import (
    Finding,
    JointTarget,
    Outcome,
    Reason,
    State,
    StoppingDistance,
)
from katana450.arm.control.things import Environment
from katana450.errors import InputError
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.kinematics.branch import BRANCHES
from katana450.maths.motion.limiter import Limiter, Motion
from katana450.maths.motion.pursuit import stream_step

NO_BRANCH = BRANCHES[0]
"""Said where there is none: without a tool nobody reads it."""


class JointSession:
    """The rules of one mechanism. Holds no state of its own: ``step`` is a pure function."""

    def __init__(self, joints: Joints, way: Callable[[FloatArray, FloatArray], float]) -> None:
        """``way``: how far its links go between two joint vectors (n,) [m]."""
        self.joints = joints
        self.ready = joints.ready
        self.surroundings = Environment(None, None)
        self.pouring: Pouring | None = None
        self._way = way
        self._limiter = Limiter(joints.limits)

    def begin(self, q: FloatArray, gripper: float, t: float) -> State:
        """The state of joints that stand at ``q`` (n,) and hold."""
        return State.standing(frozen(q), gripper, t, tool="", branch=NO_BRANCH)

    def check(self, command: cmd.Command) -> None:
        """Refuse, with an InputError for the sender, what cannot even be asked."""
        joints = self.joints
        match command:
            case cmd.AxisCommand():
                command.targets(np.zeros(joints.n))
            case cmd.SetJoints(q=q) | cmd.Servo(q=q):
                joints.check(q)
            case cmd.Batch(commands=commands):
                for each in commands:
                    self.check(each)
            case _ if not command.traits.joints_only:
                self.refuse()

    def refuse(self) -> NoReturn:
        """Say that there is no tool, and why."""
        raise InputError(f"Only its joints can be driven. {self.joints.why}")

    def choices(self, _state: State) -> tuple[Choice, ...]:
        """There are no branches: InputError says why."""
        self.refuse()

    def step(self, state: State, commands: Iterable[cmd.Command], t: float) -> State:
        """Take the commands in order, then move the setpoints on by the time that has passed.

        t: now [s], on the clock of ``state.t``.
        """
        outcomes: list[Outcome] = []
        for command in commands:
            self.check(command)
            state, found = take_all(self._take, state, stamped(command, t))
            outcomes.append(found)
        if outcomes or state.outcomes:
            state = replace(state, outcomes=tuple(outcomes))
        if state.servo is not None and t - state.servo.t >= cmd.JOG_TIME:
            state = self._aim(state, self._limiter.halt(state.motion))
        dt = min(t - state.t, LONGEST_STEP)
        state = replace(state, t=max(t, state.t))
        if dt <= 0.0 or not state.under_way:
            return state
        return replace(state, motion=self._ahead(state, dt))

    @staticmethod
    def observe(state: State, q: FloatArray, gripper: float) -> State:
        """Where the driver says the joints really are."""
        return replace(state, q=q, gripper=gripper)

    @staticmethod
    def fail(state: State) -> State:
        """Hold after an error of our own: no target survives it."""
        here = state.setpoint
        held = replace(state, motion=Motion.rest(here), goal=here, target=JointTarget(here))
        return replace(held, mode=None, findings=(Finding(Reason.INTERNAL),))

    def _ahead(self, state: State, dt: float) -> Motion:
        limiter, motion, servo = self._limiter, state.motion, state.servo
        if state.stopped is not None:
            return limiter.stop(motion, dt)
        if state.paused:
            return limiter.pause(motion, state.goal, dt)
        if servo is None:
            return limiter.towards(motion, state.goal, dt, state.speed)
        return stream_step(limiter, motion, servo, state.t, dt, state.speed)

    def _take(self, state: State, command: cmd.Command) -> State:
        if state.stopped is not None and not command.traits.while_stopped:
            return state
        match command:
            case cmd.Stop():
                return self._stop(state)
            case cmd.ClearStop():
                free = self._aim(replace(state, stopped=None), self._limiter.halt(state.motion))
                return without(free, Reason.STOPPED)
            case cmd.Pause():
                return paused(state)
            case cmd.Resume():
                return resumed(state)
            case cmd.Hold():
                return self._aim(state, self._limiter.halt(state.motion))
            case cmd.SpeedScale(value=value):
                return replace(state, speed=value)
            case cmd.AxisCommand():
                return self._aim(state, command.targets(state.goal))
            case cmd.SetJoints(q=q):
                return self._aim(state, q)
            case cmd.Servo(q=q):
                aimed = self._aim(state, q)
                return streamed(state, aimed, command, self._limiter.limits.acceleration)
            case cmd.Home() | cmd.GoToZero():
                return self._aim(state, self.ready)
            case cmd.Dress():
                return dressed(state, command)
            case cmd.Batch(commands=commands):
                return functools.reduce(self._take, commands, state)
        return state

    def _aim(self, state: State, q: FloatArray) -> State:
        """With ``q`` (n,) wished, and the nearest inside the limits as the goal."""
        joints, q = self.joints, frozen(q)
        goal = joints.clamp(q)
        findings = tuple(
            Finding(
                Reason.SLIDE_LIMIT if joints.slides[axis] else Reason.AXIS_LIMIT,
                float(goal[axis]),
                axis,
            )
            for axis in np.flatnonzero(np.abs(goal - q) > tolerances.LIMIT_SLACK).tolist()
        )
        return gone(state, JointTarget(q), goal, findings)

    def _stop(self, state: State) -> State:
        """Brake, and forget every wish."""
        if state.stopped is not None:
            return state
        goal = frozen(self.joints.clamp(self._limiter.halt(state.motion)))
        way, time = self._way(state.setpoint, goal), self._limiter.time_to_halt(state.motion)
        stopped = replace(
            self._aim(state, goal), stopped=StoppingDistance(way, time), paused=False, goal=goal
        )
        return replace(stopped, findings=(Finding(Reason.STOPPED, way, time=time),))
