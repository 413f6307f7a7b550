"""Where a script is laid out: the arm as it will stand, and the plans made for it so far."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from katana450.arm.control.arm import ArmModel
from katana450.arm.control.commands import Command
from katana450.arm.control.modes import IDLE
from katana450.arm.control.plans import path_to, plan_along
from katana450.arm.control.scene_objects import SceneObject, named
from katana450.arm.control.session import Session
from katana450.arm.control.state import State
from katana450.errors import InputError
from katana450.extensions.programs.actions import Action, FollowPlan
from katana450.maths.collision.world import CollisionWorld
from katana450.maths.geometry import se3
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.kinematics.branch import BRANCHES, Branch, branch_of
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.priority import Priority
from katana450.maths.kinematics.tool import ToolTarget
from katana450.maths.kinematics.tracker import leap
from katana450.maths.motion.limiter import JointMotion
from katana450.maths.planning.checkpoint import checkpoint
from katana450.maths.planning.curve import Curve
from katana450.maths.planning.path import Path, joint_derivatives
from katana450.maths.planning.plan import JOIN_TOLERANCE, check_clear
from katana450.maths.planning.tool_path import ToolPath

W = TypeVar("W")
L = TypeVar("L")

EXACT = 1e-9
"""[m or rad] A pose that is missed by no more is reached."""

ALONG = np.linspace(0.0, 1.0, 5)
"""Places of a path at which is seen whether it moves anything."""

CARRY = 1.0
"""[m/s^2] The most of the tool while it carries something."""

MAX_CLOSING_TICKS = 500
"""Ticks that fingers may take."""

TICK = 0.01
"""[s]"""


@dataclass(frozen=True, eq=False)
class PlanContext:
    """What a script is for.

    session: the rules of the arm, and what stands around it. T_base_shoulder: (4, 4) the frame {S}
    in the base. seed: of the ways round.
    """

    session: Session
    T_base_shoulder: FloatArray
    seed: int = 0

    @property
    def arm(self) -> ArmModel:
        """The arm."""
        return self.session.require_arm()

    @property
    def ready(self) -> FloatArray:
        """(5,) [rad] where `home` leads."""
        return self.session.ready


@dataclass(frozen=True, eq=False)
class StepTarget:
    """Where the arm is to be: its joints, or the tool.

    joints: (5,) [rad]. position: (3,) [m], in {S} unless ``in_base``. pitch, roll: [rad], None to
    keep. branch: None for any, the present one first.
    """

    joints: FloatArray | None = None
    position: FloatArray | None = None
    pitch: float | None = None
    roll: float | None = None
    branch: Branch | None = None
    in_base: bool = False


@dataclass(frozen=True)
class GraspInfo:
    """Where the tool took what it holds; at what pitch [rad], where it was free to choose."""

    at: ToolTarget
    chosen: float | None


@dataclass(frozen=True, eq=False)
class UntimedPath:
    """Paths that are known to be clear and not yet timed, which takes longest.

    world: what they are clear of. state: the arm where they begin.
    """

    arm: ArmModel
    world: CollisionWorld | None
    state: State
    paths: tuple[Path, ...]

    def timed(self) -> FollowPlan:
        """The plan along them; a gentle one when something is held."""
        gentle = None if self.state.grip is None else CARRY
        paths = list(self.paths)
        return FollowPlan(
            plan_along(self.arm, self.world, self.state, paths, tool_acceleration=gentle)
        )


class PlanBuilder:
    """Takes the arm from step to step as it will go, and notes the orders."""

    def __init__(self, plan_context: PlanContext, state: State) -> None:
        """``state``: where the arm stands at first, at rest."""
        self.plan_context = plan_context
        self.state = state
        self.orders: list[tuple[str, Action | UntimedPath]] = []
        self.taken: GraspInfo | None = None
        """Where the tool took what it holds."""
        self.given_up: tuple[float, ...] = ()
        """[rad] Pitches to take an object with that led nowhere."""
        self.ahead: Sequence[object] = ()
        """The steps that come after this one."""

    @property
    def world(self) -> CollisionWorld | None:
        """What must not be touched now, if it is looked at."""
        return self.plan_context.session.world_at(self.state)

    @property
    def chain(self) -> Chain:
        """With the tool there is now."""
        return self.plan_context.arm.chain_to(self.state.tool)

    @property
    def q(self) -> FloatArray:
        """(5,) where the joints are now [rad]."""
        return self.state.setpoint

    @property
    def at(self) -> ToolTarget:
        """Where the tool is now."""
        return ToolTarget.at(self.chain, self.q)

    def point(self, p: FloatArray, *, in_base: bool) -> FloatArray:
        """The point ``p`` (3,) [m] in {S}."""
        T = se3.inverse(self.plan_context.T_base_shoulder) if in_base else np.eye(4)
        return frozen(T[:3, :3] @ p + T[:3, 3])

    def direction(self, v: FloatArray, *, in_base: bool) -> FloatArray:
        """The direction ``v`` (3,) in {S}."""
        return frozen(self.plan_context.T_base_shoulder[:3, :3].T @ v if in_base else v)

    def note(self, name: str, order: Action | UntimedPath, state: State) -> None:
        """Have ``order`` done, which leads to ``state``."""
        self.orders.append((name, order))
        self.state = state

    def move_to(self, q: FloatArray, name: str) -> None:
        """Go to ``q`` (5,) [rad], round what is in the way; nothing where the arm is there."""
        if float(np.abs(self.q - q).max()) <= JOIN_TOLERANCE:
            return
        self.follow(
            [path_to(self.plan_context.arm, self.world, self.state, q, self.plan_context.seed)],
            name,
        )

    def lead(self, curves: Sequence[Curve], name: str) -> None:
        """Lead the tool along ``curves`` one after another, from where it is, on its branch."""
        paths: list[Path] = []
        made: dict[int, Path] = {}
        q = self.q
        for curve in curves:
            path = made.get(id(curve))
            if path is None or float(np.abs(path.start - q).max()) > JOIN_TOLERANCE:
                path = ToolPath(self.chain, curve, branch_of(self.chain, q), q)
                made[id(curve)] = path
            paths.append(path)
            q = path.end
        self.follow(paths, name)

    def follow(self, paths: Sequence[Path], name: str) -> None:
        """Go along ``paths``, the first of which begins here.

        Raises BlockedError, and InputError for a path on which nothing moves.
        """
        world, fingers = self.world, self.state.gripper_setpoint
        for path in {id(path): path for path in paths}.values():
            if float(np.abs(joint_derivatives(path, ALONG)[1]).max()) <= EXACT:
                raise InputError(
                    f"This {name} moves nothing: it ends where it begins. Say where it goes, or "
                    "take it out."
                )
            if world is not None:
                check_clear(path, world, fingers)
        self.note(
            name,
            UntimedPath(self.plan_context.arm, world, self.state, tuple(paths)),
            self.standing(paths[-1].end),
        )

    def first(self, ways: Iterable[W], build: Callable[[W], L]) -> L:
        """What ``lay`` makes of the first of ``ways`` that can be, as if no other had been tried.

        Raises InputError with the reason of the first of all, which is the one a person expects.
        """
        refused = InputError("no way is left.")
        state, orders = self.state, tuple(self.orders)
        for number, way in enumerate(ways):
            checkpoint()
            try:
                return build(way)
            except InputError as error:
                self.state, self.orders = state, list(orders)
                if number == 0:
                    refused = error
        raise refused

    def after(self, command: Command, ticks: int = MAX_CLOSING_TICKS) -> State:
        """The arm at rest after ``command``, as it will be: by the rules themselves."""
        session, state = self.plan_context.session, self.state
        given: tuple[Command, ...] = (command,)
        for _ in range(ticks):
            checkpoint()
            state = session.step(state, given, state.t + TICK)
            state = session.observe(state, state.setpoint, state.gripper_setpoint)
            given = ()
            if not state.moving:
                break
        return state

    def scene_object(self, name: str) -> SceneObject:
        """The object of that name. Raises InputError with those there are."""
        found = named(self.state.objects, name)
        if found is None:
            known = ", ".join(each.name for each in self.state.objects) or "nothing"
            raise InputError(f"There is no {name!r} here; there is {known}.")
        return found

    def standing(self, q: FloatArray) -> State:
        """The arm at rest at ``q`` (5,) [rad]."""
        q, branch = frozen(q), branch_of(self.plan_context.arm.chain, q)
        return replace(
            self.state, q=q, goal=q, motion=JointMotion.rest(q), branch=branch, mode=IDLE
        )

    def joints_at(self, place: StepTarget) -> FloatArray:
        """(5,) the joints that have the arm at ``place`` [rad]; InputError why none do."""
        if place.joints is not None:
            return self.plan_context.arm.chain.check_q(place.joints)
        return self.joints_of(self.target_at(place), place.branch)

    def target_at(self, place: StepTarget, now: ToolTarget | None = None) -> ToolTarget:
        """The tool at ``place``, which is not given by joints; the rest as it is ``now``."""
        now = self.at if now is None else now
        p = now.position
        if place.position is not None:
            p = self.point(place.position, in_base=place.in_base)
        pitch = now.pitch if place.pitch is None else place.pitch
        return ToolTarget(p, pitch, now.roll if place.roll is None else place.roll)

    def joints_of(self, target: ToolTarget, branch: Branch | None = None) -> FloatArray:
        """(5,) the joints with the tool there, on the present branch if that will do [rad]."""
        here = branch_of(self.chain, self.q)
        said = ""
        for tried in self.branches(branch):
            # On the other shoulder the same tool has other numbers.
            turned = branch is None and tried.shoulder != here.shoulder
            wanted = target.turned_round() if turned else target
            best = leap(self.chain, self.q, wanted, tried, Priority.POSE)
            if max(best.position_error, best.rotation_error) <= EXACT:
                return best.q
            if not said:
                millimetres, angle = 1e3 * best.position_error, np.degrees(best.rotation_error)
                said = f"{millimetres:.3g} mm and {angle:.3g} deg off on the branch {tried}"
        x, y, z = (1e3 * target.position).tolist()
        raise InputError(
            f"The tool {self.state.tool} cannot be at ({x:.1f}, {y:.1f}, {z:.1f}) mm in the "
            f"shoulder frame with a pitch of {np.degrees(target.pitch):.1f} deg: the nearest is "
            f"{said}."
        )

    def branches(self, wanted: Branch | None) -> tuple[Branch, ...]:
        """Those to be tried, in their order."""
        if wanted is not None:
            return (wanted,)
        here = branch_of(self.chain, self.q)
        near = sorted(BRANCHES, key=lambda each: (each.shoulder != here.shoulder, each != here))
        return tuple(near)
