"""The session decides: commands and time in, the next state out. Nothing else happens here."""

from __future__ import annotations

import functools
from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from katana450 import tolerances
from katana450.arm.control import commands as cmd
from katana450.arm.control.aims import (
    begun,
    gone,
    gone_along,
    leaving,
    paused,
    resumed,
    stamped,
    streamed,
    without,
)
from katana450.arm.control.arm import Arm
from katana450.arm.control.arrangement import dressed, removed, shifted
from katana450.arm.control.checks import check
from katana450.arm.control.choices import Choice, choice, choices, wish, wish_on
from katana450.arm.control.findings import of_jog, of_joints, of_projection, of_tracked
from katana450.arm.control.grip import gripped
from katana450.arm.control.mover import Mover, wished_twist
from katana450.arm.control.outcome import outcome, take_all
from katana450.arm.control.pouring import Pouring
from katana450.arm.control.state import (
    ACCEPTED,
    Dragging,
    Finding,
    Jogging,
    JointTarget,
    Outcome,
    PoseTarget,
    Reason,
    State,
    StoppingDistance,
    Target,
    ToolTarget,
)
from katana450.arm.control.things import Environment, Hand, Thing, furnished_with, placed
from katana450.errors import InputError
from katana450.maths.collision.world import World
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.kinematics.branch import Branch, branch_of
from katana450.maths.kinematics.projection import project
from katana450.maths.kinematics.tracker import track
from katana450.maths.motion.limiter import Motion
from katana450.maths.water.environment import WaterEnvironment

TOOL_SPEED = 0.5
"""[m/s] The most of the tool point, unless somebody says otherwise: a person can follow it."""

STILL = frozen(np.zeros(5))
"""The rates of a jog that ends."""

LONGEST_STEP = 0.05
"""[s] However late a tick comes, the arm moves no further than in this time: a stalled machine
must not turn into a leap."""


class Session:
    """The rules of one arm. Holds no state of its own: ``step`` is a pure function."""

    def __init__(
        self,
        arm: Arm,
        ready: FloatArray,
        world: World | None = None,
        tool_speed: float = TOOL_SPEED,
        hand: Hand | None = None,
        things: tuple[Thing, ...] = (),
        around: WaterEnvironment | None = None,
    ) -> None:
        """``ready``: (n,) the posture [rad] that Home drives to, inside the limits.

        ``world``: what the arm must not touch; without one nothing keeps it from touching.
        ``tool_speed``: the most of the tool point [m/s]. ``hand``: what takes things; ``things``:
        those that stand around at the beginning. ``around``: what water is in and falls on; without
        it there is none.
        """
        self.arm = arm
        self.world = world
        self.surroundings = Environment(world, hand, None if around is None else around.table)
        self._things = things
        self.pouring = None if around is None else Pouring(around, self.surroundings)
        self._tool_speed = tool_speed
        # Of the things there are at present: no state, but what follows from them.
        self._made: tuple[tuple[Thing, ...], World | None, Mover] | None = None
        self.ready = frozen(arm.chain.check_q(ready))
        if not arm.chain.within_limits(self.ready):
            raise InputError("The ready posture lies outside the joint limits.")

    def begin(self, q: FloatArray, gripper: float, t: float) -> State:
        """The state of an arm that stands at ``q`` (n,) [rad] and holds."""
        q = frozen(q)
        branch = branch_of(self.arm.chain, q)
        return State.standing(q, gripper, t, self.arm.default_tool, branch, self._things)

    def world_at(self, state: State) -> World | None:
        """What the arm must not touch, with the things of ``state``."""
        return self._for(state)[1]

    def _for(self, state: State) -> tuple[tuple[Thing, ...], World | None, Mover]:
        if self._made is None or self._made[0] is not state.things:
            world = self.surroundings.world(state.things)
            touch = None if world is None else self.surroundings.touch(world, state.things)
            mover = Mover(self.arm, world, self._tool_speed, touch)
            self._made = (state.things, world, mover)
        return self._made

    def _mover(self, state: State) -> Mover:
        return self._for(state)[2]

    def check(self, command: cmd.Command) -> None:
        """Refuse, with an InputError for the sender, what this arm cannot even be asked."""
        check(self.arm, self.pouring, self.surroundings, command)

    def choices(self, state: State) -> tuple[Choice, ...]:
        """What there is to choose from on each branch."""
        return choices(self.arm, state, self.world_at(state))

    def step(self, state: State, commands: Iterable[cmd.Command], t: float) -> State:
        """Take the commands in order, then move the setpoints on by the time that has passed.

        Args:
            state: the state after the last tick.
            commands: each one passed by ``check``; an InputError leaves ``state`` as it was.
            t: now [s], on the clock of ``state.t``.
        """
        outcomes: list[Outcome] = []
        for command in commands:
            self.check(command)
            before = state
            state, found = take_all(self._take, state, stamped(command, t))
            outcomes.append(found)
        if isinstance(state.target, ToolTarget) and isinstance(state.mode, Dragging):
            state = self._follow(state, state.target, state.mode)
            if outcomes and outcomes[-1] is ACCEPTED:
                outcomes[-1] = outcome(before, state)
        if outcomes or state.outcomes:
            state = replace(state, outcomes=tuple(outcomes))
        if state.servo is not None and t - state.servo.t >= cmd.JOG_TIME:
            state = self._aim(state, JointTarget(self._mover(state).halt(state)[0]))
        dt = min(t - state.t, LONGEST_STEP)
        state = self._mover(state).step(replace(state, t=max(t, state.t)), dt)
        state = gripped(self.surroundings, self.world_at(state), state)
        if self.pouring is not None and state.poured is not None:
            x = state.x_setpoint
            state = replace(state, poured=self.pouring.step(state.poured, state.things, x, dt))
        return state if state.jogging is None else self._jogged(state)

    @staticmethod
    def observe(state: State, q: FloatArray, gripper: float) -> State:
        """Where the driver says the arm really is."""
        return replace(state, q=q, gripper=gripper)

    @staticmethod
    def fail(state: State) -> State:
        """Hold after an error of our own: no target survives it."""
        held = replace(
            state,
            motion=Motion.rest(state.setpoint),
            goal=state.setpoint,
            gripper_goal=state.gripper_setpoint,
            target=JointTarget(state.setpoint),
            mode=None,
            following=None,
        )
        return replace(held, findings=(Finding(Reason.INTERNAL),))

    def _take(self, state: State, command: cmd.Command) -> State:
        if state.stopped is not None and not command.traits.while_stopped:
            return state
        match command:
            case cmd.Stop():
                return self._stop(state)
            case cmd.ClearStop():
                goal = self._mover(state).halt(state)[0]
                free = replace(state, stopped=None, goal=goal, target=JointTarget(goal), mode=None)
                return leaving(without(free, Reason.STOPPED))
            case cmd.Pause():
                return paused(state)
            case cmd.Resume():
                return resumed(state)
            case cmd.Follow(plan=plan):
                return begun(self.arm.chain, state, plan)
            case cmd.GoAlong(share=share):
                return gone_along(self.arm.chain, state, share)
            case cmd.SpeedScale(value=value):
                return replace(state, speed=value)
            case cmd.Jog(rates=rates, frame=frame):
                if state.paused:
                    return state
                jogging = Jogging(rates, frame, state.t + cmd.JOG_TIME)
                return leaving(replace(state, mode=jogging, target=JointTarget(state.goal)))
            case cmd.AxisCommand():
                return self._aim(state, JointTarget(command.targets(state.goal)))
            case cmd.SetJoints(q=q):
                return self._aim(state, JointTarget(q))
            case cmd.Servo(q=q):
                aimed = self._aim(state, JointTarget(q))
                return streamed(state, aimed, command, self.arm.limits.acceleration)
            case cmd.Home():
                return self._aim(state, JointTarget(self.ready))
            case cmd.GoToZero():
                return self._aim(state, JointTarget(frozen(np.zeros(self.arm.chain.n))))
            case cmd.Hold():
                held = replace(state, gripper_goal=state.gripper_setpoint)
                held = without(held, Reason.CONTACT)
                return self._aim(held, JointTarget(self._mover(state).halt(state)[0]))
            case cmd.MoveTool(position=position):
                return self._drag(state, replace(wish(self.arm, state), position=position))
            case cmd.TurnTool(pitch=pitch, roll=roll):
                return self._drag(state, replace(wish(self.arm, state), pitch=pitch, roll=roll))
            case cmd.SetPose(T=T):
                return self._aim(state, PoseTarget(T))
            case cmd.EndDrag():
                if isinstance(state.mode, Dragging):
                    return replace(state, mode=replace(state.mode, let_go=True))
                # The findings stay: they say why the handle springs back.
                goal = state.setpoint if state.blocked else state.goal
                let_go = replace(state, goal=goal, target=JointTarget(goal), blocked=False)
                return leaving(let_go) if state.blocked else let_go
            case cmd.SetTool(name=name):
                renamed = self._aim(replace(state, tool=name), JointTarget(state.goal))
                return replace(renamed, following=state.following)
            case cmd.SetReading(reading=reading):
                return self._reread(replace(state, reading=reading))
            case cmd.TakeBranch(branch=branch):
                return self.taken(state, branch)
            case cmd.Place(thing=thing):
                return replace(state, things=placed(state.things, thing))
            case cmd.Remove(name=name):
                return removed(state, name)
            case cmd.Shift():
                return shifted(state, command)
            case cmd.Dress():
                return dressed(state, command)
            case cmd.Batch(commands=commands):
                return functools.reduce(self._take, commands, state)
            case cmd.Attach(name=name, to=to):
                x = state.x_setpoint
                mounted = tuple(
                    self.surroundings.mounted(each, to, x) if each.name == name else each
                    for each in state.things
                )
                return replace(state, things=mounted)
            case cmd.Furnish(things=things, volume=volume):
                furnished = replace(state, things=furnished_with(state.things, things))
                return self._fill(furnished, volume)
            case cmd.Fill(volume=volume):
                return self._fill(state, volume)
            case cmd.SetGripper(angle=angle):
                return self._grip(state, angle)

    def _fill(self, state: State, volume: float | None) -> State:
        if volume is None:
            return replace(state, poured=None)
        assert self.pouring is not None
        x = state.x_setpoint
        return replace(state, poured=self.pouring.fill(volume, state.things, x))

    def _aim(self, state: State, target: JointTarget | PoseTarget) -> State:
        """Make ``target`` the target, and the nearest the arm can do the goal."""
        chain = self.arm.chain_to(state.tool)
        if isinstance(target, JointTarget):
            goal = frozen(chain.clamp(target.q))
            state = replace(state, branch=branch_of(chain, goal))
            return gone(state, target, goal, of_joints(chain, target.q))
        best = project(
            chain, target.T, reading=state.reading, branch=state.branch, q_hint=state.goal
        )
        findings = of_projection(chain, best, state.reading, yaw_was_wished=True)
        return gone(state, target, best.q, findings)

    def _reread(self, state: State) -> State:
        """Go for what is wished in the reading there is now."""
        match state.target:
            case PoseTarget() as target:
                return self._aim(state, target)
            case ToolTarget() as target:
                let_go = isinstance(state.mode, Dragging) and state.mode.let_go
                return self._drag(state, target, let_go=let_go)
        # Where a hand let go nothing is wished any more that could be reread.
        return state

    def _drag(self, state: State, target: ToolTarget, *, let_go: bool = False) -> State:
        """Make ``target`` what is followed from now on, along the way the hand took there."""
        since = wish(self.arm, state) if state.since is None else state.since
        return leaving(replace(state, target=target, mode=Dragging(since, let_go)))

    def _follow(self, state: State, target: ToolTarget, dragging: Dragging) -> State:
        """Take the goal on towards ``target``, as far as one tick has time for."""
        chain = self.arm.chain_to(state.tool)
        tracked = track(
            chain,
            state.goal,
            target,
            branch=state.branch,
            reading=state.reading,
            since=dragging.since,
        )
        if tracked.since is not None:
            return replace(state, goal=tracked.best.q, mode=replace(dragging, since=tracked.since))
        wished = JointTarget(tracked.best.q) if dragging.let_go else target
        return gone(state, wished, tracked.best.q, of_tracked(chain, tracked, state.reading))

    def _stop(self, state: State) -> State:
        """Brake, and forget every wish. The grip stays: what is held must not be dropped."""
        if state.stopped is not None:
            return state
        if state.following is not None:
            left = None if self._mover(state).may_leave(state) else leaving(state).following
            state = replace(state, following=left)
        goal, way, time = self._mover(state).halt(state)
        stopped = replace(
            state,
            stopped=StoppingDistance(way, time),
            paused=False,
            goal=goal,
            gripper_goal=state.gripper_setpoint,
            target=JointTarget(goal),
            mode=None,
        )
        return replace(stopped, findings=(Finding(Reason.STOPPED, way, time=time),))

    def _jogged(self, state: State) -> State:
        """The goal is where the jog would come to rest, so that it does when no more comes."""
        assert state.jogging is not None
        goal = self._mover(state).halt(state)[0]
        chain = self.arm.chain_to(state.tool)
        contact = tuple(f for f in state.findings if f.reason is Reason.CONTACT)
        jogging: Jogging | None = state.jogging
        if state.t >= state.jogging.until:
            # Braked as a jog, in step, the tool stays on its way.
            jogging = None if state.motion.at_rest else replace(state.jogging, rates=STILL)
        held = of_jog(chain, state.setpoint, wished_twist(chain, state.setpoint, state.jogging))
        return replace(
            state,
            goal=goal,
            target=JointTarget(goal),
            branch=branch_of(chain, goal),
            findings=contact + held,
            mode=jogging,
        )

    def taken(self, state: State, branch: Branch) -> State:
        """Leap to ``branch`` with the tool where it is wished."""
        best = choice(self.arm, state, branch)
        target: Target = JointTarget(best.q)
        if isinstance(state.target, PoseTarget):
            target = state.target
        elif isinstance(state.target, ToolTarget):
            target = wish_on(self.arm, state, branch)
        findings = of_projection(
            self.arm.chain_to(state.tool),
            best,
            state.reading,
            yaw_was_wished=isinstance(target, PoseTarget),
        )
        return gone(replace(state, branch=branch), target, best.q, findings)

    def _grip(self, state: State, angle: float) -> State:
        limits = self.arm.gripper
        lower = limits.lower if state.grip is None else state.grip
        goal = min(max(angle, lower), limits.upper)
        reason = Reason.GRIPPER_SLIDE_LIMIT if limits.slides else Reason.GRIPPER_LIMIT
        others = tuple(f for f in state.findings if f.reason is not reason)
        beyond = abs(goal - angle) > tolerances.LIMIT_SLACK
        held = (Finding(reason, goal),) if beyond else ()
        return replace(state, gripper_goal=goal, findings=others + held)
