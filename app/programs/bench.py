"""Where a script is laid out: the arm as it will stand, and the plans made for it so far."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from app.collision.world import World
from app.control.arm import Arm
from app.control.plans import path_to, plan_along, plan_to
from app.control.session import Session
from app.control.state import State
from app.errors import InputError
from app.geometry import se3
from app.geometry.arrays import FloatArray, frozen
from app.kinematics.branch import BRANCHES, Branch, branch_of
from app.kinematics.chain import Chain
from app.kinematics.reading import Reading
from app.kinematics.tool import ToolTarget
from app.kinematics.tracker import leap
from app.motion.limiter import Motion
from app.planning.path import Path
from app.planning.plan import JOINED
from app.programs.order import Go, Order

EXACT = 1e-9
"""[m or rad] A pose that is missed by no more is reached."""


@dataclass(frozen=True, eq=False)
class Rig:
    """What a script is for.

    session: the rules of the arm, and what stands around it. T_base_shoulder: (4, 4) the frame {S}
    in the base. seed: of the ways round.
    """

    session: Session
    T_base_shoulder: FloatArray
    seed: int = 0

    @property
    def arm(self) -> Arm:
        """The arm."""
        return self.session.arm

    @property
    def ready(self) -> FloatArray:
        """(5,) [rad] where `home` leads."""
        return self.session.ready


@dataclass(frozen=True, eq=False)
class Place:
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


class Bench:
    """Takes the arm from step to step as it will go, and notes the orders."""

    def __init__(self, rig: Rig, state: State) -> None:
        """``state``: where the arm stands at first, at rest."""
        self.rig = rig
        self.state = state
        self.orders: list[tuple[str, Order]] = []
        self.taken: ToolTarget | None = None
        """Where the tool took what it holds."""

    @property
    def world(self) -> World | None:
        """What must not be touched now, if it is looked at."""
        return self.rig.session.world_at(self.state)

    @property
    def chain(self) -> Chain:
        """With the tool there is now."""
        return self.rig.arm.chain_to(self.state.tool)

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
        T = se3.inverse(self.rig.T_base_shoulder) if in_base else np.eye(4)
        return frozen(T[:3, :3] @ p + T[:3, 3])

    def direction(self, v: FloatArray, *, in_base: bool) -> FloatArray:
        """The direction ``v`` (3,) in {S}."""
        return frozen(self.rig.T_base_shoulder[:3, :3].T @ v if in_base else v)

    def note(self, name: str, order: Order, state: State) -> None:
        """Have ``order`` done, which leads to ``state``."""
        self.orders.append((name, order))
        self.state = state

    def move_to(self, q: FloatArray, name: str) -> None:
        """Go to ``q`` (5,) [rad], round what is in the way; nothing where the arm is there."""
        if float(np.abs(self.q - q).max()) <= JOINED:
            return
        rig = self.rig
        plan = plan_to(rig.arm, self.world, self.state, q, rig.seed)
        self.note(name, Go(plan), self.standing(plan.end))

    def follow(self, paths: Sequence[Path], name: str) -> None:
        """Go along ``paths``, the first of which begins here."""
        plan = plan_along(self.rig.arm, self.world, self.state, list(paths))
        self.note(name, Go(plan), self.standing(plan.end))

    def way_to(self, q: FloatArray) -> Path:
        """The way round to ``q`` (5,) [rad], not yet taken."""
        return path_to(self.rig.arm, self.world, self.state, q, self.rig.seed)

    def standing(self, q: FloatArray) -> State:
        """The arm at rest at ``q`` (5,) [rad]."""
        q, branch = frozen(q), branch_of(self.rig.arm.chain, q)
        return replace(
            self.state, q=q, goal=q, motion=Motion.rest(q), branch=branch, following=None
        )

    def joints_at(self, place: Place) -> FloatArray:
        """(5,) the joints that have the arm at ``place`` [rad]; InputError why none do."""
        if place.joints is not None:
            return self.rig.arm.chain.check_q(place.joints)
        return self.joints_of(self.target_at(place), place.branch)

    def target_at(self, place: Place) -> ToolTarget:
        """The tool at ``place``, which is not given by joints."""
        now = self.at
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
            best = leap(self.chain, self.q, wanted, tried, Reading.POSE)
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
