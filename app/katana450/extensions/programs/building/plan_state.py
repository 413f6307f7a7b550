"""The immutable state of a plan: the arm as predicted, and the actions planned so far.

The session's own rules move the fingers, so that a run does what was planned.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TypeVar

import numpy as np

from katana450.arm.control.arm import ArmModel
from katana450.arm.control.commands.commands import Command, Gripper, Joints
from katana450.arm.control.session.plans import path_to, plan_along
from katana450.arm.control.session.session import TOOL_SPEED, Session
from katana450.arm.control.state.messages import part
from katana450.arm.control.state.modes import IDLE
from katana450.arm.control.state.scene_objects import SceneObject, named
from katana450.arm.control.state.state import Reason, State
from katana450.errors import InputError
from katana450.extensions.programs.building.actions import (
    ACTION_TIMEOUT,
    Action,
    FollowPlan,
    MoveFingers,
)
from katana450.extensions.programs.language.scope import ScriptFrame, StepTarget
from katana450.extensions.programs.planning.curves import Curve, arc_between, line_between
from katana450.extensions.programs.planning.hand_frames import UP, Approach
from katana450.extensions.programs.planning.hand_planning import HandPlanning, hand_of
from katana450.extensions.programs.planning.out_of_reach import unreached
from katana450.extensions.programs.planning.tool_planning import ToolPlanning
from katana450.maths.collision.world import CollisionWorld
from katana450.maths.geometry import se3
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.kinematics.branch import AnyBranch
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.tool import ToolTarget
from katana450.maths.motion.limiter import JointMotion
from katana450.maths.planning.checkpoint import checkpoint
from katana450.maths.planning.jet import Jet
from katana450.maths.planning.path import Path, joint_derivatives
from katana450.maths.planning.plan import JOIN_TOLERANCE, check_clear

W = TypeVar("W")
L = TypeVar("L")

EXACT = 1e-9
"""[m or rad] Maximum error of a pose that counts as reached."""

ALONG = np.linspace(0.0, 1.0, 5)
"""Places of a path (sigma) at which the joints are checked for motion."""

LED = np.linspace(0.0, 1.0, 33)
"""Places of a path (sigma) at which a hand that leads a body on a joint is checked."""

MAX_LEAD, MAX_LEAD_TURN = 5e-3, math.radians(10.0)
"""[m, rad] Maximum distance of a held part from its joint: the pads give way by as much."""

CARRY = 1.0
"""[m/s^2] Maximum acceleration of the tool while it carries an object."""

TICK = 0.01
"""[s] Period of the simulated control cycle."""


@dataclass(frozen=True, eq=False)
class PlanContext:
    """The arm and environment that a script is planned for.

    Attributes:
        session: the rules of the arm, and its environment.
        T_base_shoulder: (4, 4) pose of the shoulder frame {S} in the base frame [m].
        seed: seed of the random search for paths round obstacles.
    """

    session: Session
    T_base_shoulder: FloatArray
    seed: int = 0

    @property
    def arm(self) -> ArmModel:
        """The arm model of the session."""
        return self.session.require_arm()

    @property
    def ready(self) -> FloatArray:
        """The ready posture (n,) [rad], the target of ``home``."""
        return self.session.ready


@dataclass(frozen=True)
class GraspInfo:
    """A grasp.

    Attributes:
        at: pose of the tool.
        chosen: the approach if the compiler has chosen it, else None.
        before: the object as it stood before.
    """

    at: ToolTarget
    chosen: Approach | None
    before: SceneObject


@dataclass(frozen=True, eq=False)
class UntimedPath:
    """Paths that are checked for contacts but not yet timed, because timing takes longest.

    Attributes:
        arm: the arm model.
        world: the collision world that they were checked against; None without collision checks.
        state: the state at their start.
        paths: the paths, one after another.
        tool_speed: maximum speed of the tool point [m/s].
    """

    arm: ArmModel
    world: CollisionWorld | None
    state: State
    paths: tuple[Path, ...]
    tool_speed: float = field(default=TOOL_SPEED, kw_only=True)

    def timed(self) -> FollowPlan:
        """Return the timed plan, with limited tool acceleration if an object is held."""
        gentle = None if self.state.grip is None else CARRY
        paths = list(self.paths)
        return FollowPlan(
            plan_along(self.arm, self.world, self.state, paths, self.tool_speed, gentle)
        )


@dataclass(frozen=True, eq=False)
class PlanState:
    """The plan of a script up to one of its steps: the arm as predicted, and the actions so far.

    It never changes. A step returns a new one, so an attempt is given up by keeping the older one.

    Attributes:
        plan_context: the arm and its environment.
        state: the state of the arm, which is at rest.
        frame: the frame of the script that is planned; None without a script.
        actions: the actions so far, with their names.
        taken: the grasp of the held object; None with an empty hand.
        given_up: approaches of the grasp with which a later step failed.
        ahead: the steps after the present one.
        is_brief: whether a refusal is not shown, so that its details need not be computed.
        hands: the hands by their tools, each computed once for this plan and all that follow.
    """

    plan_context: PlanContext
    state: State
    frame: ScriptFrame | None = None
    actions: tuple[tuple[str, Action | UntimedPath], ...] = ()
    taken: GraspInfo | None = None
    given_up: tuple[Approach, ...] = ()
    ahead: Sequence[object] = ()
    is_brief: bool = False
    hands: dict[str, HandPlanning] = field(default_factory=dict, repr=False)

    @property
    def world(self) -> CollisionWorld | None:
        """The present collision world; None without collision checks."""
        return self.plan_context.session.world_at(self.state)

    @property
    def chain(self) -> Chain:
        """The kinematic chain to the present tool frame."""
        return self.plan_context.arm.chain_to(self.state.tool)

    @property
    def q(self) -> FloatArray:
        """The present joints (n,) [rad]."""
        return self.state.setpoint

    @property
    def planning(self) -> ToolPlanning:
        """The planning of the present tool."""
        return ToolPlanning(self.plan_context.arm.kinematics_to(self.state.tool), self.state)

    @property
    def hand(self) -> HandPlanning:
        """The hand with the present tool. Raises InputError, with the reason, without one."""
        tool, context = self.state.tool, self.plan_context
        if tool not in self.hands:
            self.hands[tool] = hand_of(context.session, context.T_base_shoulder, self.state)
        return self.hands[tool]

    @property
    def target(self) -> ToolTarget:
        """The present target of the tool, of any arm."""
        return self.planning.at(self.q)

    def point(self, p: FloatArray, *, in_base: bool) -> FloatArray:
        """Return the point ``p`` (3,) [m] in {S}; ``in_base``: it is given in the base frame."""
        T = se3.inverse(self.plan_context.T_base_shoulder) if in_base else np.eye(4)
        return frozen(T[:3, :3] @ p + T[:3, 3])

    def direction(self, v: FloatArray, *, in_base: bool) -> FloatArray:
        """Return the direction ``v`` (3,) in {S}; ``in_base``: it is given in the base frame."""
        return frozen(self.plan_context.T_base_shoulder[:3, :3].T @ v if in_base else v)

    def with_action(
        self, name: str, action: Action | UntimedPath, after: State | None = None
    ) -> PlanState:
        """Return the plan with ``action``, which leads to the state ``after``; None: no change."""
        after = self.state if after is None else after
        if isinstance(action, MoveFingers):
            turn = abs(after.gripper_setpoint - self.state.gripper_setpoint)
            action = replace(action, seconds=turn / self.plan_context.arm.gripper.speed)
        return replace(self, actions=(*self.actions, (name, action)), state=after)

    def move_to(self, q: FloatArray, name: str) -> PlanState:
        """Return the plan with a free motion to ``q`` (n,) [rad] round obstacles.

        Without one if the arm is there.
        """
        if float(np.abs(self.q - q).max()) <= JOIN_TOLERANCE:
            return self
        context = self.plan_context
        return self.follow([path_to(context.arm, self.world, self.state, q, context.seed)], name)

    def lead(self, curves: Sequence[Curve], name: str, tool_speed: float = TOOL_SPEED) -> PlanState:
        """Return the plan with the tool's motion along ``curves``, on the same branch.

        It begins at the present pose. ``tool_speed``: maximum speed of the tool point [m/s]. Raises
        as ``follow``.
        """
        planning = self.planning
        paths: list[Path] = []
        path_by_curve: dict[int, Path] = {}
        q = self.q
        for curve in curves:
            path = path_by_curve.get(id(curve))
            if path is None or float(np.abs(path.start - q).max()) > JOIN_TOLERANCE:
                path = planning.path(q, curve, planning.branches(q)[0])
                path_by_curve[id(curve)] = path
            paths.append(path)
            q = path.end
        return self.follow(paths, name, tool_speed)

    def follow(self, paths: Sequence[Path], name: str, tool_speed: float = TOOL_SPEED) -> PlanState:
        """Return the plan with the motion along ``paths``, from the present posture.

        ``tool_speed``: maximum speed of the tool point [m/s]. Raises BlockedError, and InputError
        for a path on which nothing moves.
        """
        world, fingers = self.world, self.state.gripper_setpoint
        for path in {id(path): path for path in paths}.values():
            if float(np.abs(joint_derivatives(path, ALONG)[1]).max()) <= EXACT:
                raise InputError(
                    f"This `{name}` moves nothing: it ends where it begins. Change its "
                    "target or remove it."
                )
            self._check_joint(path, name)
            if world is not None:
                check_clear(path, world, fingers)
        arm = self.plan_context.arm
        untimed = UntimedPath(arm, world, self.state, tuple(paths), tool_speed=tool_speed)
        return self.with_action(name, untimed, self.standing(paths[-1].end).state)

    def _check_joint(self, path: Path, name: str) -> None:
        """Raise InputError if ``path`` leads a held part of a drawer or door off its joint."""
        held, environment = self.state.held, self.plan_context.session.environment
        if held is None or held.joint is None:
            return
        for q in np.column_stack([angle.c0 for angle in path.joints(Jet.variable(LED))]):
            x = np.append(q, self.state.gripper_setpoint)
            _, distance, turn = environment.led(self.state.objects, x)
            if distance > MAX_LEAD or turn > MAX_LEAD_TURN:
                raise InputError(
                    f"{held.name} is on a joint, and this `{name}` leads the hand "
                    f"{1e3 * distance:.0f} mm and {math.degrees(turn):.0f} deg off it. Move the "
                    "tool along the joint and in its range, or release it first."
                )

    def first(self, options: Iterable[W], build: Callable[[PlanState, W], PlanState]) -> PlanState:
        """Return the plan that ``build`` makes from this one with the first possible option.

        Raises as ``choose``.
        """
        return replace(self.choose(options, build), is_brief=self.is_brief)

    def choose(self, options: Iterable[W], find: Callable[[PlanState, W], L]) -> L:
        """Return what ``find`` returns for this plan and the first possible option.

        Raises InputError with the reason of the first option, which is the one that a person
        expects.
        """
        plan, refused = self, None
        for option in options:
            checkpoint()
            try:
                return find(plan, option)
            except InputError as error:
                refused = refused or error
                plan = replace(self, is_brief=True)
        raise refused or InputError("no alternative is left.")

    def after(self, command: Command, ticks: int) -> State:
        """Return the state ``ticks`` after ``command``, or at rest, as the session computes it."""
        session, state = self.plan_context.session, self.state
        commands: tuple[Command, ...] = (command,)
        for _ in range(ticks):
            checkpoint()
            state = session.step(state, commands, state.t + TICK)
            state = session.observe(state, state.setpoint, state.gripper_setpoint)
            commands = ()
            if not (state.moving or state.objects_move):
                break
        return state

    def scene_object(self, name: str) -> SceneObject:
        """Return the object ``name``. Raises InputError with the known names."""
        scene_object = named(self.state.objects, name)
        if scene_object is None:
            known = ", ".join(repr(known.name) for known in self.state.objects) or "none"
            raise InputError(f"There is no object {name!r}. Known objects: {known}.")
        return scene_object

    def standing(self, q: FloatArray) -> PlanState:
        """Return the plan with the arm at rest at ``q`` (n,) [rad], free to move.

        A program runs only after a stop was cleared and a pause ended, but may be planned before.
        """
        q, branch = frozen(q), self.plan_context.arm.kinematics.branch_of(q)
        # What is held goes along, so its last motion is no longer true.
        standing = replace(
            self.state, q=q, goal=q, motion=JointMotion.rest(q), branch=branch, mode=IDLE,
            stopped=None, paused=False, blocked=False, bodies=None,
        )  # fmt: skip
        environment = self.plan_context.session.environment
        objects, _, _ = environment.led(standing.objects, standing.x_setpoint)
        return replace(self, state=replace(standing, objects=objects)).with_still_water()

    def with_missed_grasp(self) -> PlanState:
        """Return the plan as if the last grasp had missed.

        The fingers are closed, and the object stands.
        """
        if self.taken is None:
            return self
        before, closed = self.taken.before, self.plan_context.arm.gripper.closed
        objects = tuple(
            before if other.name == before.name else other for other in self.state.objects
        )
        missed = replace(
            self.state, objects=objects, grip=None, squeeze=0.0,
            gripper=closed, gripper_setpoint=closed, gripper_goal=closed,
        )  # fmt: skip
        return replace(self, state=missed, taken=None, given_up=()).with_still_water()

    def with_still_water(self, volumes: Mapping[str, int] | None = None) -> PlanState:
        """Return the plan with the water at rest in the vessels, where they are now.

        ``volumes``: new volumes of water in vessels [fl].
        """
        pouring, state = self.plan_context.session.pouring, self.state
        if pouring is None or state.poured is None:
            return self
        still = pouring.settled(state.poured.water, state.objects, state.x_setpoint, volumes or {})
        return replace(self, state=replace(state, poured=still))

    def joints_at(self, place: StepTarget) -> FloatArray:
        """Return the joints (n,) [rad] for ``place``. Raises InputError if it cannot be reached."""
        if place.joints is not None:
            require_turning(self.chain)
            self.plan_context.session.check(Joints(place.joints))
            q = self.plan_context.arm.chain.check_q(place.joints)
            _check_range(self.chain, q)
            return q
        return self.joints_of(self.target_at(place), place.branch)

    def target_at(self, place: StepTarget, now: ToolTarget | None = None) -> ToolTarget:
        """Return the target at ``place``, which has no joints; ``now`` gives absent values."""
        now = self.target if now is None else now
        p = now.position
        if place.position is not None:
            p = self.point(place.position, in_base=place.in_base)
        R = self.plan_context.T_base_shoulder[:3, :3] if place.in_base else np.eye(3)
        return self.planning.oriented(now.moved(p), place.angles, R)

    def joints_of(self, target: ToolTarget, branch: AnyBranch | None = None) -> FloatArray:
        """Return the joints (n,) [rad] for ``target``, on the present branch if possible.

        Raises InputError with the nearest places.
        """
        branch = None if branch is None else self.planning.branch(branch)
        q = self.planning.joints(self.q, target, branch)
        if q is None:
            raise InputError("" if self.is_brief else self.unreached(target, branch))
        return q

    def unreached(self, target: ToolTarget, branch: AnyBranch | None) -> str:
        """Return why the tool cannot be at ``target``, on ``branch`` or any, and what it can do."""
        T = self.plan_context.T_base_shoulder
        frame = ScriptFrame.of(T, in_base=False) if self.frame is None else self.frame
        return unreached(self.planning, self.q, target, branch, frame)

    def branches(self, wanted: AnyBranch | None) -> Sequence[AnyBranch]:
        """Return the branches to try, in their order; only ``wanted`` if it is given."""
        planning = self.planning
        return planning.branches(self.q) if wanted is None else (planning.branch(wanted),)


def require_turning(chain: Chain) -> None:
    """Raise InputError if an axis slides: the joints of scripts are angles."""
    if any(chain.slides):
        raise InputError(
            f"Axis {chain.slides.index(True) + 1} slides, and the joints of a script are angles. "
            "Give the place of the tool by x, y and z."
        )


def _check_range(chain: Chain, q: FloatArray) -> None:
    """Raise InputError, with the range, if an axis at ``q`` (n,) [rad] is beyond its limits."""
    if chain.within_limits(q):
        return
    number = int(np.maximum(chain.lower - q, q - chain.upper).argmax())
    value, low, high = (math.degrees(bounds[number]) for bounds in (q, chain.lower, chain.upper))
    raise InputError(
        f"Axis {number + 1} would be at {value:.1f} deg, beyond its limit: its range is "
        f"{low:.1f} to {high:.1f} deg."
    )


def with_fingers(plan: PlanState, position: float) -> State:
    """Return the state at rest after the fingers were moved to ``position`` [rad or m].

    They may end before it on an object that they close on. Raises InputError if something else
    stops them.
    """
    state = plan.after(Gripper(position), round(ACTION_TIMEOUT / TICK))
    if state.gripper_setpoint == state.gripper_goal:
        return state
    unit, scale = finger_unit(plan)
    goal, end = (f"{value / scale:.1f}" for value in (position, state.gripper_setpoint))
    raise InputError(
        f"The fingers would stop at {end} {unit} on their way to {goal} {unit}: "
        f"{_obstacle(plan, state)}"
    )


def finger_unit(plan: PlanState) -> tuple[str, float]:
    """Return the unit of finger positions for people, and its size [m or rad]."""
    return ("mm", 1e-3) if plan.plan_context.arm.gripper.slides else ("deg", math.radians(1.0))


def _obstacle(plan: PlanState, state: State) -> str:
    """Return what stops the fingers in ``state``, and a remedy."""
    contacts = [entry.parts for entry in state.findings if entry.reason is Reason.CONTACT]
    parts = contacts[0] if contacts else None
    world = plan.plan_context.session.world_at(state)
    # Objects that can be held are touched without a finding.
    nearest = None if world is None else world.nearest(state.x_setpoint)
    if parts is None and nearest is not None:
        parts = nearest.parts
    if parts is None:
        return f"they need more than {ACTION_TIMEOUT:g} s. Move them less far."
    names = {entry.name for entry in state.objects}
    finger, obstacle = sorted(parts, key=lambda name: name in names)
    remedy = "Choose another height or pitch of the hand."
    if obstacle in names:
        remedy = f"Leave more room beside {part(obstacle)}, or come from another side."
    return f"{part(finger)} would meet {part(obstacle)}. {remedy}"


APPROACHES = (0.09, 0.07, 0.055, 0.045, 0.035)
"""[m] Distances of approach and retreat of the open fingers, tried from the farthest."""


def carry(plan: PlanState, to: ToolTarget, name: str) -> PlanState:
    """Return ``plan`` with the way of the tool to ``to``: vertically, about axis 1, then radially.

    The tool keeps its present orientation up to the last part. An object that is held upright stays
    upright unless ``to`` has another orientation.
    """
    present, hand = plan.target, plan.hand
    start = math.atan2(present.position[1], present.position[0])
    end = math.atan2(to.position[1], to.position[0])
    radius = math.hypot(present.position[0], present.position[1])
    z = float(to.position[2])
    raised = present.moved(present.position * (1, 1, 0) + UP * max(z, present.position[2]))
    turn = hand.way_round(start, end)
    position = np.array((radius * math.cos(end), radius * math.sin(end), raised.position[2]))
    over = hand.turned(raised, position, turn)
    curves: list[Curve] = []
    if (raised.position != present.position).any():
        curves.append(line_between(present, raised))
    if abs(turn) > JOIN_TOLERANCE:
        curves.append(arc_between(np.zeros(3), UP, turn, 0.0, raised, over))
    if max(over.apart(to)) > JOIN_TOLERANCE:
        curves.append(line_between(over, to))
    return plan.lead(curves, name) if curves else plan
