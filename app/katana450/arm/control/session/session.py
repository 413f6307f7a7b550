"""The session: a pure function from state, commands and time to the next state."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from katana450 import tolerances
from katana450.arm.control.arm import ArmModel, JointSet
from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.objects.environment import Environment, Hand
from katana450.arm.control.objects.grip import gripped
from katana450.arm.control.objects.loose_objects import LooseObjects
from katana450.arm.control.objects.pouring import Pouring
from katana450.arm.control.objects.scene_changes import with_scene_change
from katana450.arm.control.session import tool_targets
from katana450.arm.control.session.checks import check, check_joints, outcome, take_all
from katana450.arm.control.session.goals import (
    end_drag,
    end_stream,
    follow_plan,
    paused,
    resumed,
    with_goal,
    with_mode,
    with_stream_sample,
    with_time,
    without_cause,
    without_finding,
)
from katana450.arm.control.session.motion_stepper import MotionStepper, Travel, no_travel
from katana450.arm.control.session.restoring import check_restored, restored
from katana450.arm.control.session.slow_zones import SLOW_SPEED, SlowZones, with_slow_zone
from katana450.arm.control.session.stopping import stopped_again, with_presses
from katana450.arm.control.session.supervision import (
    held_where_measured,
    stop_for,
    with_tracking_time,
)
from katana450.arm.control.session.tool_targets import (
    BranchOption,
    branch_named,
    branch_options,
    current_target,
)
from katana450.arm.control.session.transitions import Effect, effect_of
from katana450.arm.control.state.arm_report import ArmReport
from katana450.arm.control.state.findings import of_joints
from katana450.arm.control.state.modes import (
    IDLE,
    Jogging,
    JointTarget,
    PoseTarget,
    Positioning,
    Tracking,
)
from katana450.arm.control.state.scene_objects import SceneObject
from katana450.arm.control.state.state import ACCEPTED, ActiveStop, Finding, Outcome, Reason, State
from katana450.errors import InputError
from katana450.maths.collision.world import CollisionWorld
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.kinematics.branch import BRANCHES
from katana450.maths.motion.limiter import JointMotion
from katana450.maths.water.environment import WaterEnvironment

TOOL_SPEED = 0.5
"""[m/s] Default maximum speed of the tool point: a person can follow it."""

MAX_STEP_TIME = 0.05
"""[s] Maximum time that one tick moves the arm by. It prevents a leap after a stalled machine."""

NO_BRANCH = BRANCHES[0]
"""The branch in the state of a robot that has none; nothing reads it."""


_Cache = tuple[tuple[SceneObject, ...], CollisionWorld | None, MotionStepper]
"""The objects of a state, their collision world, and the stepper among them."""


class Session:
    """The rules of one robot. It holds no state of its own: ``step`` is a pure function.

    Attributes:
        arm: the arm; None for a robot of which only the joints can be driven.
        world: the collision world without the objects of a state; None to check no contacts.
        ready: (n,) the posture that Home drives to [rad or m].
    """

    def __init__(
        self,
        robot: ArmModel | JointSet,
        ready: FloatArray,
        world: CollisionWorld | None = None,
        tool_speed: float = TOOL_SPEED,
        hand: Hand | None = None,
        objects: tuple[SceneObject, ...] = (),
        water_environment: WaterEnvironment | None = None,
        travel: Travel = no_travel,
    ) -> None:
        """Create the rules of ``robot``. Raises InputError for ``ready`` beyond the limits.

        Args:
            robot: the arm, or the joints of a robot that is none.
            ready: (n,) the posture that Home drives to [rad or m].
            world: the collision world; None to check no contacts.
            tool_speed: maximum speed of the tool point [m/s].
            hand: the part of the arm that takes objects.
            objects: objects in the first state.
            water_environment: cup, basin and table of the water; None for no water.
            travel: for joints, the distance [m] that the links travel between two joint vectors.
        """
        self.arm = robot.arm
        self.world = world
        self.environment = Environment(
            world, hand, None if water_environment is None else water_environment.table
        )
        self.pouring = (
            None if water_environment is None else Pouring(water_environment, self.environment)
        )
        self.loose_objects = LooseObjects(self.environment, water_environment)
        self._slow_zones = SlowZones(self.environment)
        self._robot = robot
        self._limits = robot.limits
        self._objects = objects
        self._tool_speed = tool_speed
        self._travel = travel
        # Cache for the objects of the newest state.
        self._cache: _Cache | None = None
        self.check(cmd.Joints(ready))
        self.ready = frozen(ready)
        if of_joints(self._limits, robot.slides, self.ready):
            raise InputError("The ready posture lies outside the joint limits.")

    def begin(self, q: FloatArray, gripper: float, t: float) -> State:
        """Return the state of a robot that stands at ``q`` (n,) [rad or m] and holds.

        gripper: the finger joint [rad or m]. t: now [s].
        """
        q = frozen(q)
        arm, held = self.arm, JointMotion.rest(q)
        standing = State(t, q, gripper, held, gripper, q, gripper, tool="", branch=NO_BRANCH)
        if arm is None:
            return standing
        tool, branch = arm.default_tool, arm.kinematics.branch_of(q)
        return replace(standing, tool=tool, branch=branch, objects=self._objects)

    def require_arm(self) -> ArmModel:
        """Return the arm. Raises InputError, with the reason, if only joints can be driven."""
        if isinstance(self._robot, JointSet):
            raise InputError(self._robot.refusal)
        return self._robot

    def world_at(self, state: State) -> CollisionWorld | None:
        """Return the collision world with the objects of ``state``; None without checks."""
        return self._for(state)[1]

    def _for(self, state: State) -> _Cache:
        newest = self._cache
        if newest is None or newest[0] is not state.objects:
            world = self.environment.world(state.objects)
            if newest is not None and world is newest[1]:
                newest = (state.objects, *newest[1:])
            else:
                touch = None
                if world is not None and self.arm is not None:
                    touch = self.environment.touch(world, state.objects)
                stepper = MotionStepper(self._robot, world, self._tool_speed, touch, self._travel)
                newest = (state.objects, world, stepper)
            self._cache = newest
        return newest

    def _stepper(self, state: State) -> MotionStepper:
        return self._for(state)[2]

    def check(self, command: cmd.Command) -> None:
        """Raise InputError if this robot does not support ``command``."""
        if isinstance(command, cmd.RestoreState):
            check_restored(self._limits, command.state)
        if isinstance(self._robot, JointSet):
            check_joints(self._robot, self.environment, command)
        else:
            check(self._robot, self.pouring, self.environment, command)

    def choices(self, state: State) -> tuple[BranchOption, ...]:
        """Return the option on each branch. Raises InputError if there is no arm."""
        return branch_options(self.require_arm(), state, self.world_at(state))

    def step(self, state: State, commands: Iterable[cmd.Command], t: float) -> State:
        """Execute the commands in order, then advance the setpoints by the time that has passed.

        Args:
            state: the state after the last tick.
            commands: each command passes ``check``; an InputError leaves ``state`` as it was.
            t: now [s], on the clock of ``state.t``.
        """
        before, outcomes = state, list[Outcome]()
        newest: tuple[int, State] | None = None  # that may have changed the target, and before it
        for command in commands:
            self.check(command)
            if not all(part.traits.passive for part in command.parts):
                newest = len(outcomes), state
            state, command_outcome = take_all(self._take, state, with_time(command, t))
            outcomes.append(command_outcome)
            if isinstance(command, cmd.RestoreState) and command_outcome is ACCEPTED:
                # Nothing has moved or changed from the state before to this one.
                before = state
        if isinstance(state.intent, Tracking):
            state = tool_targets.tracked(self.require_arm(), state, state.intent)
            if newest is not None and outcomes[newest[0]] is ACCEPTED:
                outcomes[newest[0]] = outcome(newest[1], state)
        if outcomes or state.outcomes:
            state = replace(state, outcomes=tuple(outcomes))
        if state.servo is not None and t - state.servo.t >= cmd.JOG_TIME:
            state = end_stream(state, self._stepper(state).stopping_point(state)[0], self._limits)
        dt = min(t - state.t, MAX_STEP_TIME)
        start = state.setpoint
        state = self._moved(replace(state, t=max(t, state.t)), dt)
        if state.mode is IDLE and state.motion.at_rest and state.goal is not state.setpoint:
            # A brake can end one rounding beside its predicted end.
            state = replace(state, goal=state.setpoint)
        state = self.loose_objects.step(before, state, dt)
        state = gripped(self.environment, before, state, dt)
        if self.pouring is not None and state.poured is not None:
            x = state.x_setpoint
            water = self.pouring.step(state.poured, state.objects, x, dt, before.objects)
            state = replace(state, poured=water)
        if not isinstance(state.intent, Jogging):
            return state
        rest = self._stepper(state).stopping_point(state)[0]
        return tool_targets.jogged(self.require_arm(), state, state.intent, start, rest)

    def _moved(self, state: State, dt: float) -> State:
        """Return ``state`` after the motion of the arm in ``dt`` [s]."""
        stepper, speed = self._stepper(state), state.speed
        zone = self._slow_zones.finding(state, stepper)
        if zone is not None:
            stepper = stepper.slowed(SLOW_SPEED)
            state = replace(state, speed=min(speed, SLOW_SPEED / self._tool_speed))
        return with_slow_zone(replace(stepper.step(state, dt), speed=speed), zone)

    @staticmethod
    def observe(state: State, q: FloatArray, gripper: float) -> State:
        """Return ``state`` of a robot that follows exactly, at the place that its driver reports.

        q: (n,) [rad or m]. gripper: the finger joint [rad or m].
        """
        return replace(state, q=q, gripper=gripper, report=None)

    def supervised(self, state: State, report: ArmReport) -> State:
        """Return ``state``, at the measured place, stopped if ``report`` is a reason to."""
        state = with_tracking_time(state, report)
        if state.stopped is None:
            stop = stop_for(state, report, self.world_at(state) if state.moving else None)
            if stop is None:
                return state
            state = self._stop_motion(state, stop)
        return held_where_measured(state, report)

    def _take(self, state: State, command: cmd.Command) -> State:
        """Return ``state`` after ``command``, as defined by the table of transitions."""
        match effect_of(command, state):
            case Effect.ACCEPTED:
                return self._accepted(state, command)
            case Effect.CONTINUES:
                return self._continued(without_cause(state), command)
            case Effect.SUPERSEDES:
                # A stopped arm keeps the cause of its stop, however often it is stopped again.
                again = isinstance(command, cmd.Stop)
                return self._superseded(state if again else without_cause(state), command)
            case Effect.REFUSED:
                return state

    def _accepted(self, state: State, command: cmd.Command) -> State:
        """Return ``state`` after a command that leaves the mode as it is."""
        match command:
            case cmd.Pause(finding=cause):
                return paused(state, cause)
            case cmd.Resume():
                return resumed(state)
            case cmd.OperateArm():
                return state
            case cmd.Speed(value=value):
                return replace(state, speed=value)
            case cmd.Tool(name=name):
                return replace(self._aim(replace(state, tool=name), state.goal), mode=state.mode)
            case cmd.SetPriority(priority=priority):
                return replace(state, priority=priority)
            case cmd.EndDrag():
                return end_drag(state)
            case cmd.Gripper(angle=angle):
                return self._grip(without_cause(state), angle)
        return with_scene_change(self.environment, self.pouring, state, command)

    def _continued(self, state: State, command: cmd.Command) -> State:
        """Return ``state`` after a command that the present mode continues with."""
        match command:
            case cmd.EndDrag():
                return end_drag(state)
            case cmd.SetPriority(priority=priority):
                return tool_targets.with_reapplied_priority(
                    self.require_arm(), replace(state, priority=priority)
                )
        # All other commands renew their mode in the same manner as they begin it.
        return self._superseded(state, command)

    def _superseded(self, state: State, command: cmd.Command) -> State:
        """Return ``state`` in the mode that ``command`` begins."""
        match command:
            case cmd.Stop():
                return with_presses(self._stop_motion(state, command), command)
            case cmd.ClearStop():
                goal = self._stepper(state).stopping_point(state)[0]
                free = with_mode(replace(state, stopped=None, goal=goal), IDLE)
                return without_finding(free, Reason.STOPPED)
            case cmd.Hold(finding=cause):
                held = replace(state, gripper_goal=state.gripper_setpoint)
                held = self._at_rest_soon(without_finding(held, Reason.CONTACT))
                if state.jogging is not None:
                    end = replace(state.jogging.ending(), until=state.t)
                    held = with_mode(held, end)
                why = () if cause is None else (Finding(Reason.WAITING), cause)
                return replace(held, findings=(*why, *held.findings))
            case cmd.AxisCommand():
                return self._aim(state, command.targets(state.goal))
            case cmd.Joints(q=q):
                return self._aim(state, q)
            case cmd.RestoreState(state=earlier):
                return restored(earlier, state.t)
            case cmd.Servo(q=q, gripper=fingers):
                aimed = self._aim(state, q)
                aimed = aimed if fingers is None else self._grip(aimed, fingers)
                return with_stream_sample(state, aimed, command, self._limits.acceleration)
            case cmd.Home():
                return self._aim(state, self.ready)
            case cmd.GoToZero() if self.arm is None:
                return self._aim(state, self.ready)
            case cmd.GoToZero():
                return self._aim(state, frozen(np.zeros(len(self.ready))))
            case cmd.Jog(rates=rates, frame=frame):
                return tool_targets.with_jog(state, Jogging(rates, frame, state.t + cmd.JOG_TIME))
            case cmd.TurnElbow(by=by):
                return tool_targets.with_elbow_turn(state, by)
            case cmd.EndDrag():
                return end_drag(state)
            case _:
                return self._to_tool_target(self.require_arm(), state, command)

    def _to_tool_target(self, arm: ArmModel, state: State, command: cmd.Command) -> State:
        """Return ``state`` in the mode that a command about the tool begins."""
        match command:
            case cmd.Position(p=position):
                target = current_target(arm, state).moved(position)
                return tool_targets.dragged(arm, state, target)
            case cmd.Turn() | cmd.Orient():
                return tool_targets.turned(arm, state, command)
            case cmd.StepTool():
                return tool_targets.stepped(arm, state, command)
            case cmd.Pose(target=T):
                return tool_targets.with_pose_target(arm, state, PoseTarget(T))
            case cmd.Branch(name=name):
                return tool_targets.with_branch(arm, state, branch_named(arm, name))
            case cmd.Tool(name=name):
                # The goal stays, and the target becomes the goal.
                return self._aim(replace(state, tool=name), state.goal)
            case cmd.Follow(plan=plan, tau=tau):
                return follow_plan(arm, state, plan, tau)
        raise AssertionError(f"The table of transitions has no rule for {command!r}.")

    def _aim(self, state: State, q: FloatArray) -> State:
        """Return ``state`` that is positioning at ``q`` (n,), or as near as the limits allow."""
        goal = frozen(np.clip(q, self._limits.lower, self._limits.upper))
        if self.arm is not None:
            branch = self.arm.kinematics_to(state.tool).branch_of(goal)
            state = replace(state, branch=branch)
        findings = of_joints(self._limits, self._robot.slides, q)
        return with_goal(state, goal, findings, Positioning(JointTarget(q)))

    def _at_rest_soon(self, state: State) -> State:
        """Return ``state`` that brakes and holds, without a target."""
        return with_mode(self._aim(state, self._stepper(state).stopping_point(state)[0]), IDLE)

    def _stop_motion(self, state: State, stop: cmd.Stop) -> State:
        """Return ``state`` that brakes and drops every target, for the cause of ``stop``.

        The grip stays, so that a held object does not fall.
        """
        if state.stopped is not None:
            return stopped_again(state)
        free = state.following is None or self._stepper(state).may_leave(state)
        state = replace(state, mode=IDLE) if free else with_mode(state, IDLE)
        goal, travel, time = self._stepper(state).stopping_point(state)
        stopped = replace(
            state,
            stopped=ActiveStop(travel, time, stop.cause, state.t),
            paused=False,
            goal=goal,
            gripper_goal=state.gripper_setpoint,
        )
        why = () if stop.finding is None else (stop.finding,)
        return replace(stopped, findings=(Finding(Reason.STOPPED, travel, time=time), *why))

    def _grip(self, state: State, angle: float) -> State:
        limits = self.require_arm().gripper
        wanted = limits.clamp(angle)
        # The fingers cannot close on what they hold: what is wanted beyond it squeezes the object.
        goal = wanted if state.grip is None or limits.is_wider(wanted, state.grip) else state.grip
        reason = Reason.GRIPPER_SLIDE_LIMIT if limits.slides else Reason.GRIPPER_LIMIT
        others = without_finding(state, reason, Reason.SLIPPED, Reason.CRUSHED).findings
        beyond = abs(wanted - angle) > tolerances.LIMIT_SLACK
        held = (Finding(reason, wanted),) if beyond else ()
        return replace(state, gripper_goal=goal, squeeze=abs(goal - wanted), findings=others + held)
