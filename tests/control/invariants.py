"""Random commands for every robot, and the invariants that hold after every tick."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, precondition, rule

from katana450.arm.control.arm import JointSet
from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.session.session import Session
from katana450.arm.control.session.stopping import clear_refusal
from katana450.arm.control.session.transitions import TABLE, Effect, effect_of
from katana450.arm.control.state.modes import (
    Following,
    Idle,
    Jogging,
    Leaving,
    Positioning,
    Servoing,
)
from katana450.arm.control.state.state import Reason, State
from katana450.assembly.robot_session import describe_robot
from katana450.maths.geometry.arrays import FloatArray
from katana450.resources import URDF_PATH
from katana450.settings import Settings

DT = 0.01

ROUNDING = 1e-6
"""[1] Tolerance, as a fraction of a limit."""

REST_SECONDS = 4.0
"""[s] Maximum time of the slowest brake: a pause along a plan at the lowest speed."""

MAX_MOTION_SECONDS = 60.0
"""[s] Maximum time of any motion at full speed."""

MOTIONS = tuple(kind for kind, row in TABLE.items() if row.begins is not None)
"""Commands after which the arm may move. A stop and its end also begin a mode, but no motion."""

RESTS = (cmd.Stop, cmd.ClearStop, cmd.Hold, cmd.EndDrag, cmd.Tool)
"""Commands among MOTIONS that never begin a motion."""

SESSIONS: dict[str, Session] = {}
"""Cache of the sessions by name."""

JOINTS = JointSet(
    names=("rail", "turn", "tilt"),
    slides=(True, False, False),
    lower=np.array((0.05, -3.0, -0.4)),
    upper=np.array((0.4, 3.0, 0.3)),
    speed=np.array((0.3, 2.0, 1.0)),
    why="It is a gantry.",
)


def session_of(name: str) -> Session:
    """Return the session of the app, of an arm without gripper, or of joints alone."""
    if name not in SESSIONS:
        if name == "joints":
            SESSIONS[name] = Session(JOINTS, JOINTS.ready)
        else:
            plain = replace(Settings(), bare=name == "bare")
            SESSIONS[name] = describe_robot(plain, Path(URDF_PATH), None).session
    return SESSIONS[name]


def fractions(n: int) -> st.SearchStrategy[FloatArray]:
    """Return a strategy for n numbers (n,) from -1 to 1."""
    return st.lists(st.integers(-8, 8), min_size=n, max_size=n).map(lambda k: np.array(k) / 8.0)


ticks = st.integers(1, 30)


class JointRules(RuleBasedStateMachine):
    """The commands for every robot, and the invariants."""

    names: tuple[str, ...] = ("joints",)
    tick_completed = False
    """True if the newest tick completed with all invariants."""

    @initialize(data=st.data())
    def begin(self, data: st.DataObject) -> None:
        """Begin at rest."""
        self.name = data.draw(st.sampled_from(self.names))
        self.session = session_of(self.name)
        self.state = self.first = self.session.begin(self.session.ready, 0.0, 0.0)
        self.limits = (self.session.arm or JOINTS).limits
        self.log: list[tuple[tuple[cmd.Command, ...], float]] = []
        self.may_move = False
        """True if a command newer than the last stop may move the arm."""
        self.fingers_may_move = False
        """True if a command newer than the last stop may move the fingers."""
        self.braking = 0
        """Number of ticks since the stop or pause of the arm."""
        self.stop_ends: FloatArray | None = None

    # The commands.

    @rule(ticks=ticks)
    def wait(self, ticks: int) -> None:
        self.run((), ticks)

    @rule(axis=st.integers(0, 2), part=fractions(1), ticks=ticks)
    def set_joint(self, axis: int, part: FloatArray, ticks: int) -> None:
        self.run([cmd.Joint(axis + 1, 3.5 * float(part[0]))], ticks)

    @rule(data=st.data(), ticks=ticks)
    def set_joints(self, data: st.DataObject, ticks: int) -> None:
        off = data.draw(fractions(len(self.state.q)))
        self.run([cmd.Joints(self.state.setpoint + off)], ticks)

    @rule(data=st.data(), ticks=ticks, every=st.integers(1, 3), jump=st.booleans())
    def servo(self, data: st.DataObject, ticks: int, every: int, jump: bool) -> None:
        rate = data.draw(fractions(len(self.state.q)))
        q = self.state.goal + (0.4 * rate if jump else 0.0)
        for tick in range(ticks):
            self.tick([cmd.Servo(q + rate * DT * tick)] if tick % every == 0 else ())
            if self.state.stopped is None:
                assert isinstance(self.state.intent, Servoing)

    @rule(command=st.sampled_from([cmd.Home(), cmd.GoToZero()]), ticks=ticks)
    def go_to(self, command: cmd.Command, ticks: int) -> None:
        self.run([command], ticks)

    @rule(ticks=ticks)
    def hold(self, ticks: int) -> None:
        self.run([cmd.Hold()], ticks)
        if self.state.stopped is None:
            # A jog brakes along its twist before it ends.
            jogging = self.state.jogging
            assert jogging is None or not jogging.rates.any()
            assert jogging is not None or isinstance(self.state.intent, Idle)

    @rule(ticks=ticks)
    def stop(self, ticks: int) -> None:
        self.run([cmd.Stop()], ticks)

    @precondition(lambda self: self.state.stopped is not None)
    @rule(ticks=ticks)
    def clear_stop(self, ticks: int) -> None:
        may = self.may_clear
        self.run([cmd.ClearStop()], ticks)
        assert (self.state.stopped is None) == may

    @precondition(lambda self: self.state.stopped is not None)
    @rule(ticks=ticks)
    def wait_and_clear_stop(self, ticks: int) -> None:
        self.wait_and_clear(ticks)
        assert self.state.stopped is None

    @rule(ticks=ticks)
    def pause(self, ticks: int) -> None:
        self.run([cmd.Pause()], ticks)

    @precondition(lambda self: self.state.paused)
    @rule(ticks=ticks)
    def resume(self, ticks: int) -> None:
        self.run([cmd.Resume()], ticks)

    @rule(speed=st.sampled_from([0.05, 0.3, 0.7, 1.0]))
    def set_speed(self, speed: float) -> None:
        self.run([cmd.Speed(speed)], 1)
        assert self.state.speed == speed

    @rule(speed=st.sampled_from([0.4, 1.0]), last=st.sampled_from([cmd.Home(), cmd.Hold()]))
    def batch(self, speed: float, last: cmd.Command) -> None:
        self.run([cmd.Batch((cmd.Speed(speed), last))], 1)

    # The tick, and the invariants after it.

    @property
    def may_clear(self) -> bool:
        """True if the next tick accepts ClearStop."""
        return not clear_refusal(self.state, self.state.t + DT)

    def wait_and_clear(self, ticks: int, *then: cmd.Command) -> None:
        """Clear the stop, if any, as soon as possible; execute ``then`` in the same tick."""
        for _ in range(1000):
            if self.may_clear:
                break
            self.tick(())
        else:
            raise AssertionError(clear_refusal(self.state, self.state.t + DT))
        self.run([cmd.ClearStop(), *then], ticks)

    def run(self, commands: Iterable[cmd.Command], ticks: int) -> None:
        """Execute ``commands`` in the first of ``ticks`` ticks."""
        self.tick(commands)
        for _ in range(ticks - 1):
            self.tick(())

    def tick(self, commands: Iterable[cmd.Command]) -> None:
        """Execute one tick: the session, the driver, the invariants."""
        commands, before, self.tick_completed = tuple(commands), self.state, False
        t = before.t + DT
        self.log.append((commands, t))
        self.note(commands)
        state = self.session.step(before, commands, t)
        self.check_nothing_survives(before, commands, state, t)
        self.state = self.session.observe(state, state.setpoint, state.gripper_setpoint)
        if before.stopped is None and state.stopped is not None:
            self.may_move = self.fingers_may_move = False
            self.stop_ends = state.goal
        self.check_limits(before, state)
        self.check_rest(before, state)
        self.check_consistent(state)
        self.tick_completed = True

    def note(self, commands: tuple[cmd.Command, ...]) -> None:
        """Record whether arm and fingers may move from now on."""
        for command in commands:
            if isinstance(command, cmd.Batch):
                self.note(command.commands)
            elif isinstance(command, cmd.Stop):
                self.may_move = self.fingers_may_move = False
            elif self.state.stopped is None or (
                self.may_clear and any(isinstance(c, cmd.ClearStop) for c in commands)
            ):
                self.may_move |= isinstance(command, MOTIONS) and not isinstance(command, RESTS)
                self.fingers_may_move |= isinstance(command, cmd.Gripper)

    def check_limits(self, before: State, state: State) -> None:
        """Check position, speed, acceleration and jerk, and that setpoints agree with rates."""
        limits, motion, was = self.limits, state.motion, before.motion
        assert ((motion.q >= limits.lower) & (motion.q <= limits.upper)).all()
        assert (np.abs(motion.qd) <= limits.speed * (1.0 + ROUNDING)).all()
        assert (np.abs(motion.qdd) <= limits.acceleration * (1.0 + ROUNDING)).all()
        assert ((state.goal >= limits.lower) & (state.goal <= limits.upper)).all()
        # With bounded jerk the trapezium rule has at most this error.
        step = 0.5 * DT * (motion.qd + was.qd)
        slack = limits.jerk * DT**3 + limits.acceleration * DT**2 + 1e-9
        assert (np.abs(motion.q - was.q - step) <= slack).all()
        arm = self.session.arm
        if arm is not None:
            moved = abs(state.gripper_setpoint - before.gripper_setpoint)
            assert moved <= arm.gripper.speed * DT * (1.0 + ROUNDING)
            assert arm.gripper.lower <= state.gripper_setpoint <= arm.gripper.upper

    def check_rest(self, before: State, state: State) -> None:
        """Check that nothing moves after the brake of a stop, or without a newer command."""
        resting = state.stopped is not None or state.paused
        self.braking = self.braking + 1 if resting else 0
        same = (state.setpoint == before.setpoint).all()
        if resting:
            assert state.gripper_setpoint == before.gripper_setpoint
            assert not before.motion.at_rest or (same and state.motion.at_rest)
            assert self.braking < REST_SECONDS / DT or state.motion.at_rest
        if not self.fingers_may_move:
            assert state.gripper_setpoint == before.gripper_setpoint
        if not self.may_move:
            assert not before.motion.at_rest or (same and state.motion.at_rest)
            if self.stop_ends is not None and state.motion.at_rest:
                np.testing.assert_allclose(state.setpoint, self.stop_ends, rtol=0, atol=1e-6)

    def check_consistent(self, state: State) -> None:
        """Check that flags, findings and mode agree."""
        reasons = {finding.reason for finding in state.findings}
        assert Reason.INTERNAL not in reasons
        assert (Reason.STOPPED in reasons) == (state.stopped is not None)
        assert (Reason.PAUSED in reasons) == state.paused
        if state.stopped is not None:
            assert not state.paused
            assert isinstance(state.intent, Idle)
            assert state.gripper_goal == state.gripper_setpoint
        along = state.following
        if along is not None:
            np.testing.assert_allclose(state.setpoint, along.motion().q, rtol=0, atol=1e-9)
        if isinstance(state.mode, Following):
            np.testing.assert_allclose(state.goal, state.mode.plan.end, rtol=0, atol=1e-12)
        if isinstance(state.mode, Leaving):
            assert not isinstance(state.mode.then, Following)
        if isinstance(state.intent, Jogging) and not state.paused:
            assert state.t < state.intent.until or not state.intent.rates.any()
        if state.servo is not None:
            assert state.t - state.servo.t < cmd.JOG_TIME + DT
        assert (state.held is None) == (state.grip is None)

    def check_nothing_survives(
        self, before: State, commands: tuple[cmd.Command, ...], after: State, t: float
    ) -> None:
        """Check that a command which supersedes a mode has the same effect as without that mode."""
        if len(commands) != 1 or before.following is not None:
            return
        (command,) = commands
        again = isinstance(command, cmd.Stop) and before.stopped is not None
        elsewhere = isinstance(command, cmd.Follow) and not isinstance(after.mode, Following)
        early = isinstance(command, cmd.ClearStop) and clear_refusal(before, t)
        if again or elsewhere or early or effect_of(command, before) is not Effect.SUPERSEDES:
            return
        plain = replace(before, mode=Positioning(before.target))
        other = self.session.step(plain, commands, t)
        assert _bits(other) == _bits(after)
        assert type(other.mode) is type(after.mode)

    def teardown(self) -> None:
        """Check that every motion ends, and that a replay gives the same state."""
        if not self.tick_completed:
            return
        self.wait_and_clear(30, cmd.Resume(), cmd.Speed(1.0))
        for _ in range(round(MAX_MOTION_SECONDS / DT)):
            if not self.state.moving:
                break
            self.tick(())
        assert not self.state.moving
        assert isinstance(self.state.mode, Idle | Positioning | Following)
        again = self.first
        for commands, t in self.log:
            again = self.session.step(again, commands, t)
            again = self.session.observe(again, again.setpoint, again.gripper_setpoint)
        assert _bits(again) == _bits(self.state)


def _bits(state: State) -> tuple[object, ...]:
    """Return the parts of a state that the arm or people can see."""
    motion = state.motion
    arrays = (motion.q, motion.qd, motion.qdd, state.goal)
    rest = (state.gripper_setpoint, state.gripper_goal, state.blocked, state.paused, state.speed)
    return (*(array.tobytes() for array in arrays), *rest, state.findings, state.status)
