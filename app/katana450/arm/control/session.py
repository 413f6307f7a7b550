"""The session decides: commands and time in, the next state out. Nothing else happens here."""

from __future__ import annotations

import functools
from collections.abc import Iterable
from dataclasses import replace
from typing import Protocol

import numpy as np

from katana450 import tolerances
from katana450.arm.control import commands as cmd
from katana450.arm.control import tool_targets
from katana450.arm.control.aims import (
    follow_plan,
    go_along,
    let_go,
    paused,
    resumed,
    stamped,
    streamed,
    with_goal,
    with_joint_targets,
    with_mode,
    without_finding,
)
from katana450.arm.control.arm import Arm
from katana450.arm.control.arrangement import arranged
from katana450.arm.control.checks import check, check_joints
from katana450.arm.control.choices import Choice, choices, wish
from katana450.arm.control.findings import of_joints
from katana450.arm.control.grip import gripped
from katana450.arm.control.joint_stepper import JointStepper, Travel, no_travel
from katana450.arm.control.joints import Joints
from katana450.arm.control.modes import (
    IDLE,
    Jogging,
    JointTarget,
    PoseTarget,
    Positioning,
    Tracking,
)
from katana450.arm.control.motion_stepper import MotionStepper
from katana450.arm.control.pouring import Pouring
from katana450.arm.control.state import Finding, Halt, Reason, State
from katana450.arm.control.things import Environment, Hand, Thing
from katana450.arm.control.transitions import Effect, effect_of
from katana450.errors import InputError
from katana450.maths.collision.world import World
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.kinematics.branch import BRANCHES, branch_of
from katana450.maths.motion.limiter import Motion
from katana450.maths.water.environment import WaterEnvironment

TOOL_SPEED = 0.5
"""[m/s] Default maximum of the tool point: a person can follow it."""

LONGEST_STEP = 0.05
"""[s] However late a tick comes, the arm moves no further than in this time: a stalled machine
must not turn into a leap."""

NO_BRANCH = BRANCHES[0]
"""The branch in the state of a robot that has none; nothing reads it."""


class Stepper(Protocol):
    """Moves the setpoints of a state towards its goal, under every limit."""

    def step(self, state: State, dt: float) -> State:
        """``state`` with its setpoints moved on by ``dt`` [s]."""
        ...

    def halt(self, state: State) -> tuple[FloatArray, float, float]:
        """The end (n,) [rad or m] of a brake begun now, the travel until then [m], and its time."""
        ...

    def may_leave(self, state: State) -> bool:
        """Whether the joints may brake beside the plan they follow, as hard as they can."""
        ...


class Session:
    """The rules of one robot. Holds no state of its own: ``step`` is a pure function.

    Attributes:
        arm: the arm, or None for a robot of which only the joints can be driven.
        world: what the arm must not touch, without the objects of a state; None without checks.
        ready: (n,) the posture that Home drives to [rad or m].
    """

    def __init__(
        self,
        robot: Arm | Joints,
        ready: FloatArray,
        world: World | None = None,
        tool_speed: float = TOOL_SPEED,
        hand: Hand | None = None,
        things: tuple[Thing, ...] = (),
        around: WaterEnvironment | None = None,
        travel: Travel = no_travel,
    ) -> None:
        """Create the rules of ``robot``. Raises InputError for ``ready`` beyond the limits.

        Args:
            robot: the arm, or the joints of a robot that is none.
            ready: (n,) the posture that Home drives to [rad or m].
            world: what the arm must not touch; None to check no contacts.
            tool_speed: maximum speed of the tool point [m/s].
            hand: what takes objects.
            things: objects in the first state.
            around: what water is in and falls on; None for no water.
            travel: for joints, the distance [m] that the links travel between two joint vectors.
        """
        self.arm = robot if isinstance(robot, Arm) else None
        self.world = world
        self.surroundings = Environment(world, hand, None if around is None else around.table)
        self.pouring = None if around is None else Pouring(around, self.surroundings)
        self._robot = robot
        self._limits = robot.limits
        self._things = things
        self._tool_speed = tool_speed
        self._joint_stepper = JointStepper(robot, travel) if isinstance(robot, Joints) else None
        # For the objects of the newest state: no state, but what follows from them.
        self._made: tuple[tuple[Thing, ...], World | None, Stepper] | None = None
        self.check(cmd.SetJoints(ready))
        self.ready = frozen(ready)
        if of_joints(self._limits, robot.slides, self.ready):
            raise InputError("The ready posture lies outside the joint limits.")

    def begin(self, q: FloatArray, gripper: float, t: float) -> State:
        """The state of a robot that stands at ``q`` (n,) [rad or m] and holds."""
        q = frozen(q)
        if self.arm is None:
            return State.standing(q, gripper, t, "", NO_BRANCH)
        branch = branch_of(self.arm.chain, q)
        return State.standing(q, gripper, t, self.arm.default_tool, branch, self._things)

    def require_arm(self) -> Arm:
        """The arm. Raises InputError, with the reason, where only joints can be driven."""
        if isinstance(self._robot, Joints):
            raise InputError(self._robot.refusal)
        return self._robot

    def world_at(self, state: State) -> World | None:
        """What the arm must not touch, with the things of ``state``."""
        return self._for(state)[1]

    def _for(self, state: State) -> tuple[tuple[Thing, ...], World | None, Stepper]:
        if self._made is None or self._made[0] is not state.things:
            world = self.surroundings.world(state.things)
            stepper: Stepper | None = self._joint_stepper
            if stepper is None:
                touch = None if world is None else self.surroundings.touch(world, state.things)
                stepper = MotionStepper(self.require_arm(), world, self._tool_speed, touch)
            self._made = (state.things, world, stepper)
        return self._made

    def _stepper(self, state: State) -> Stepper:
        return self._for(state)[2]

    def check(self, command: cmd.Command) -> None:
        """Raise InputError, for the sender, if this robot cannot even be asked for ``command``."""
        if isinstance(self._robot, Joints):
            check_joints(self._robot, command)
        else:
            check(self._robot, self.pouring, self.surroundings, command)

    def choices(self, state: State) -> tuple[Choice, ...]:
        """The choice on each branch. Raises InputError where there is no arm."""
        return choices(self.require_arm(), state, self.world_at(state))

    def step(self, state: State, commands: Iterable[cmd.Command], t: float) -> State:
        """Take the commands in order, then move the setpoints on by the time that has passed.

        Args:
            state: the state after the last tick.
            commands: each one passed by ``check``; an InputError leaves ``state`` as it was.
            t: now [s], on the clock of ``state.t``.
        """
        for command in commands:
            self.check(command)
            state = self._take(state, stamped(command, t))
        if isinstance(state.intent, Tracking):
            state = tool_targets.tracked(self.require_arm(), state, state.intent)
        if state.servo is not None and t - state.servo.t >= cmd.JOG_TIME:
            state = self._at_rest_soon(state)
        dt = min(t - state.t, LONGEST_STEP)
        state = self._stepper(state).step(replace(state, t=max(t, state.t)), dt)
        state = gripped(self.surroundings, self.world_at(state), state)
        if self.pouring is not None and state.poured is not None:
            x = state.x_setpoint
            state = replace(state, poured=self.pouring.step(state.poured, state.things, x, dt))
        if not isinstance(state.intent, Jogging):
            return state
        rest = self._stepper(state).halt(state)[0]
        return tool_targets.jogged(self.require_arm(), state, state.intent, rest)

    @staticmethod
    def observe(state: State, q: FloatArray, gripper: float) -> State:
        """``state`` with the place where the driver says that the robot really is."""
        return replace(state, q=q, gripper=gripper)

    @staticmethod
    def fail(state: State) -> State:
        """Hold after an error of our own: no target survives it."""
        held = replace(
            state,
            motion=Motion.rest(state.setpoint),
            goal=state.setpoint,
            gripper_goal=state.gripper_setpoint,
            mode=IDLE,
        )
        return replace(held, findings=(Finding(Reason.INTERNAL),))

    def _take(self, state: State, command: cmd.Command) -> State:
        """``state`` after ``command``, as the table of transitions has it."""
        match effect_of(command, state):
            case Effect.ACCEPTED:
                return self._accepted(state, command)
            case Effect.CONTINUES:
                return self._continued(state, command)
            case Effect.SUPERSEDES:
                return self._superseded(state, command)
            case Effect.REFUSED:
                return state

    def _accepted(self, state: State, command: cmd.Command) -> State:
        """``state`` after a command that leaves the mode as it is."""
        match command:
            case cmd.Together(commands=commands):
                return functools.reduce(self._take, commands, state)
            case cmd.Pause():
                return paused(state)
            case cmd.Resume():
                return resumed(state)
            case cmd.SpeedScale(value=value):
                return replace(state, speed=value)
            case cmd.SetTool(name=name):
                return replace(self._retooled(state, name), mode=state.mode)
            case cmd.SetReading(reading=reading):
                return replace(state, reading=reading)
            case cmd.Settle():
                return let_go(state)
            case cmd.SetGripper(angle=angle):
                return self._grip(state, angle)
        return arranged(self.surroundings, self.pouring, state, command)

    def _continued(self, state: State, command: cmd.Command) -> State:
        """``state`` after a command that the present mode takes in."""
        match command:
            case cmd.GoAlong(share=fraction):
                return go_along(self.require_arm().chain, state, fraction)
            case cmd.Settle():
                return let_go(state)
            case cmd.SetReading(reading=reading):
                return tool_targets.reread(self.require_arm(), replace(state, reading=reading))
        # The others begin their mode just as they renew it.
        return self._superseded(state, command)

    def _superseded(self, state: State, command: cmd.Command) -> State:
        """``state`` in the mode that ``command`` begins."""
        match command:
            case cmd.Stop():
                return self._halt(state)
            case cmd.Release():
                goal = self._stepper(state).halt(state)[0]
                free = with_mode(replace(state, stopped=None, goal=goal), IDLE)
                return without_finding(free, Reason.HALTED)
            case cmd.Reset():
                held = replace(state, gripper_goal=state.gripper_setpoint)
                return self._at_rest_soon(without_finding(held, Reason.CONTACT))
            case cmd.SetJoint() | cmd.SetAxes():
                return self._aim(state, with_joint_targets(state.goal, command))
            case cmd.SetJoints(q=q):
                return self._aim(state, q)
            case cmd.Servo(q=q):
                return streamed(state, self._aim(state, q), command, self._limits.acceleration)
            case cmd.Home():
                return self._aim(state, self.ready)
            case cmd.Stretch() if self.arm is None:
                return self._aim(state, self.ready)
            case cmd.Stretch():
                return self._aim(state, frozen(np.zeros(len(self.ready))))
            case cmd.Jog(rates=rates, frame=frame):
                return with_mode(state, Jogging(rates, frame, state.t + cmd.JOG_TIME))
            case cmd.Settle():
                return let_go(state)
            case _:
                return self._to_tool_target(self.require_arm(), state, command)

    def _to_tool_target(self, arm: Arm, state: State, command: cmd.Command) -> State:
        """``state`` in the mode that a command about the tool begins."""
        match command:
            case cmd.MoveTool(position=position):
                target = replace(wish(arm, state), position=position)
                return tool_targets.dragged(arm, state, target)
            case cmd.TurnTool(pitch=pitch, roll=roll):
                target = replace(wish(arm, state), pitch=pitch, roll=roll)
                return tool_targets.dragged(arm, state, target)
            case cmd.SetPose(T=T):
                return tool_targets.with_pose_target(arm, state, PoseTarget(T))
            case cmd.TakeBranch(branch=branch):
                return tool_targets.with_branch(arm, state, branch)
            case cmd.SetTool(name=name):
                return self._retooled(state, name)
            case cmd.Follow(plan=plan):
                return follow_plan(arm.chain, state, plan)
        raise AssertionError(f"The table of transitions has no rule for {command!r}.")

    def _retooled(self, state: State, name: str) -> State:
        """``state`` with another tool frame: its goal stays, its target becomes the goal."""
        return self._aim(replace(state, tool=name), state.goal)

    def _clamped(self, q: FloatArray) -> FloatArray:
        """The nearest to ``q`` (n,) inside the limits."""
        return frozen(np.clip(q, self._limits.lower, self._limits.upper))

    def _aim(self, state: State, q: FloatArray) -> State:
        """``state`` that is positioning at ``q`` (n,), or the nearest to it inside the limits."""
        goal = self._clamped(q)
        if self.arm is not None:
            state = replace(state, branch=branch_of(self.arm.chain_to(state.tool), goal))
        findings = of_joints(self._limits, self._robot.slides, q)
        return with_goal(state, goal, findings, Positioning(JointTarget(q)))

    def _at_rest_soon(self, state: State) -> State:
        """``state`` that brakes and holds, without a target."""
        return with_mode(self._aim(state, self._stepper(state).halt(state)[0]), IDLE)

    def _halt(self, state: State) -> State:
        """Brake, and forget every target. The grip stays: what is held must not be dropped."""
        if state.stopped is not None:
            return state
        free = state.following is None or self._stepper(state).may_leave(state)
        state = replace(state, mode=IDLE) if free else with_mode(state, IDLE)
        goal, way, time = self._stepper(state).halt(state)
        halted = replace(
            state,
            stopped=Halt(way, time),
            paused=False,
            goal=goal,
            gripper_goal=state.gripper_setpoint,
        )
        return replace(halted, findings=(Finding(Reason.HALTED, way, time=time),))

    def _grip(self, state: State, angle: float) -> State:
        limits = self.require_arm().gripper
        lower = limits.lower if state.grip is None else state.grip
        goal = min(max(angle, lower), limits.upper)
        reason = Reason.GRIPPER_SLIDE_LIMIT if limits.slides else Reason.GRIPPER_LIMIT
        others = tuple(f for f in state.findings if f.reason is not reason)
        beyond = abs(goal - angle) > tolerances.LIMIT_SLACK
        held = (Finding(reason, goal),) if beyond else ()
        return replace(state, gripper_goal=goal, findings=others + held)
