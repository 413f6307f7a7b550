"""The kinematics of one tool as a session drives it: the interface, and those of five axes."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from katana450.arm.control.commands.tool_commands import StepTool, Turn, TurnCommand
from katana450.arm.control.state import findings
from katana450.arm.control.state.messages import PRIORITIES, PRIORITY_HINTS
from katana450.arm.control.state.state import Finding, State
from katana450.caching import cached_property
from katana450.maths.geometry import so3
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.kinematics import projection, tracker, velocity
from katana450.maths.kinematics.arm import arm_of
from katana450.maths.kinematics.branch import BRANCHES, AnyBranch, Branch
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.forward import forward
from katana450.maths.kinematics.kinematics import FiveAxisKinematics, Kinematics
from katana450.maths.kinematics.priority import Priority
from katana450.maths.kinematics.projection import Projection
from katana450.maths.kinematics.tool import ToolTarget, pitched_frame
from katana450.maths.kinematics.tracker import Tracked
from katana450.maths.kinematics.turns import in_limits_turns
from katana450.maths.kinematics.velocity import JogFrame
from katana450.maths.motion.arm_angle import has_arm_angle
from katana450.maths.motion.limiter import Limits


@dataclass(frozen=True, eq=False)
class ToolKinematics(ABC):
    """Kinematics of one tool: inverse kinematics, drags, typed poses, branches and jogs.

    The functions that take a state read its goal (n,) [rad], branch and priority.

    Attributes:
        chain: the chain, whose `M` is the pose of the tool.
        priorities: the priorities that can be chosen, each with its name and a sentence for people.
        freedoms: number of numbers in a jog and in a step: 5 (x, y, z, pitch, roll), or 6 (x, y, z
            and a rotation about each axis of the frame).
        turn: the command that turns the tool.
    """

    chain: Chain

    priorities: ClassVar[Mapping[Priority, tuple[str, str]]]
    freedoms: ClassVar[int]
    turn: ClassVar[type[TurnCommand]]

    @property
    @abstractmethod
    def solver(self) -> Kinematics:
        """The inverse kinematics of the chain."""

    @property
    def is_pitched(self) -> bool:
        """True if the targets of the tool have a pitch and a roll, see `ToolTarget.is_pitched`."""
        return self.solver.is_pitched

    @property
    def branches(self) -> tuple[AnyBranch, ...]:
        """Every branch, in the order in which they are shown."""
        return self.solver.branches

    def branch_of(self, q: FloatArray) -> AnyBranch:
        """Return the branch of the joint angles `q` (n,) [rad]."""
        return self.solver.branch_of(q)

    @abstractmethod
    def target_at(self, q: FloatArray) -> ToolTarget:
        """Return the target at which the tool is with the joints at `q` (n,) [rad]."""

    def pan(self, q: FloatArray) -> FloatArray:
        """Return the rotation (3, 3) that axis 1 gives to targets of fewer than six axes."""
        return so3.exp(self.chain.S[:3, 0] * float(q[0])) if self.chain.n < 6 else np.eye(3)

    @abstractmethod
    def stepped(self, state: State, target: ToolTarget, step: StepTool) -> ToolTarget:
        """Return ``target`` moved by ``step``."""

    def target_on(self, state: State, target: ToolTarget, branch: AnyBranch) -> ToolTarget:  # noqa: ARG002
        """Return ``target``, given on the branch of ``state``, in the numbers of ``branch``.

        A pose is the same on every branch.
        """
        return target

    @abstractmethod
    def track(self, state: State, target: ToolTarget, since: ToolTarget) -> Tracked:
        """Return the goal moved on towards ``target``, as far as one tick allows.

        It stays on its branch and never leaps. ``since`` is the target up to which the path of the
        drag has been followed.
        """

    @abstractmethod
    def project(self, state: State, T: FloatArray, branch: AnyBranch) -> Projection:
        """Return the posture on ``branch``, inside the limits, nearest to the pose `T` (4, 4)."""

    @abstractmethod
    def leap(self, state: State, target: ToolTarget, branch: AnyBranch) -> Projection:
        """Return the posture on ``branch`` nearest to ``target``, at any distance."""

    @abstractmethod
    def losses(self, state: State, best: Projection, *, yaw_was_given: bool) -> tuple[Finding, ...]:
        """Return the findings on what ``best`` loses of its target.

        ``yaw_was_given``: whether the target has a yaw that counts for five axes.
        """

    @abstractmethod
    def tracking_losses(self, state: State, tracked: Tracked) -> tuple[Finding, ...]:
        """Return the findings on what following a drag loses, a gap first."""

    @abstractmethod
    def jog_twist(self, q: FloatArray, rates: FloatArray, frame: JogFrame) -> FloatArray:
        """Return the twist (6,) of the tool in {S} [rad/s, m/s] for a jog at `q` (n,) [rad]."""

    @property
    def turns_elbow(self) -> bool:
        """True if the arm has an arm angle: its elbow can move while the tool rests."""
        return has_arm_angle(self.chain)

    @abstractmethod
    def tool_speed(self, q: FloatArray, qd: FloatArray) -> float:
        """Return the speed of the tool point [m/s], or an upper bound, for rates `qd` (n,)."""

    @abstractmethod
    def tool_speed_bound(self, qd: FloatArray) -> float:
        """Return the maximum of ``tool_speed`` over all postures."""

    def branch_limits(self, limits: Limits) -> Mapping[AnyBranch, Limits]:  # noqa: ARG002
        """Return ``limits`` for each branch whose elbow must keep its side.

        Empty where the limits of one joint do not decide the branch.
        """
        return {}

    def axes(self, q: FloatArray, frame: JogFrame) -> FloatArray:
        """Return the rotation (3, 3) in {S} of the axes of ``frame`` at `q` (n,) [rad]."""
        return np.eye(3) if frame is JogFrame.BASE else forward(self.chain, q)[:3, :3]

    @abstractmethod
    def ready(self, posture: Sequence[float], T_base_shoulder: FloatArray) -> FloatArray:
        """Return the joint angles (n,) [rad] in which the arm starts.

        ``posture`` (5,) [rad] is that of the canonical five-axis arm. ``T_base_shoulder`` (4, 4) is
        {S} in the base frame.
        """


ELBOW = 2
"""Index of axis 3, which bends the elbow."""

READY_ROOM = 0.05
"""Minimum distance of the ready posture from the limits of a joint, as a fraction of its range."""


@dataclass(frozen=True, eq=False)
class FiveAxisTool(ToolKinematics):
    """The tool of an arm of the five-axis family."""

    priorities: ClassVar[Mapping[Priority, tuple[str, str]]] = {
        priority: (name, PRIORITY_HINTS[priority]) for priority, name in PRIORITIES.items()
    }
    freedoms: ClassVar[int] = 5
    turn: ClassVar[type[TurnCommand]] = Turn

    @cached_property
    def solver(self) -> FiveAxisKinematics:
        """The closed form of the family."""
        return FiveAxisKinematics(self.chain)

    def target_at(self, q: FloatArray) -> ToolTarget:
        """Return the five freedoms of the tool at `q` (5,) [rad]."""
        return ToolTarget.at(self.chain, q)

    def stepped(self, state: State, target: ToolTarget, step: StepTool) -> ToolTarget:
        """Return ``target`` moved by ``step``: x, y, z [m], then pitch and roll [rad]."""
        moved = self.axes(state.goal, step.frame) @ step.by[:3]
        pitch, roll = target.pitch + float(step.by[3]), target.roll + float(step.by[4])
        return ToolTarget(frozen(target.position + moved), pitch, roll)

    def target_on(self, state: State, target: ToolTarget, branch: AnyBranch) -> ToolTarget:
        """Return ``target`` for the shoulder of ``branch``: its plane may face the other way."""
        same = _five(branch).shoulder == _five(state.branch).shoulder
        return target if same else target.turned_round()

    def track(self, state: State, target: ToolTarget, since: ToolTarget) -> Tracked:
        """Return `tracker.track`."""
        return tracker.track(
            self.chain,
            state.goal,
            target,
            branch=_five(state.branch),
            priority=state.priority,
            since=since,
        )

    def project(self, state: State, T: FloatArray, branch: AnyBranch) -> Projection:
        """Return `projection.project`."""
        where, priority = _five(branch), state.priority
        return projection.project(self.chain, T, branch=where, q_hint=state.goal, priority=priority)

    def leap(self, state: State, target: ToolTarget, branch: AnyBranch) -> Projection:
        """Return `tracker.leap`."""
        return tracker.leap(self.chain, state.goal, target, _five(branch), state.priority)

    def losses(self, state: State, best: Projection, *, yaw_was_given: bool) -> tuple[Finding, ...]:
        """Return `findings.of_projection`."""
        return findings.of_projection(self.chain, best, state.priority, yaw_was_given=yaw_was_given)

    def tracking_losses(self, state: State, tracked: Tracked) -> tuple[Finding, ...]:
        """Return `findings.of_tracked`."""
        return findings.of_tracked(self.chain, tracked, state.priority)

    def jog_twist(self, q: FloatArray, rates: FloatArray, frame: JogFrame) -> FloatArray:
        """Return the twist (6,) of rates (5,): velocity of the tool point, pitch and roll."""
        pitched = pitched_frame(self.chain, q)
        omega = rates[3] * pitched[:, 1] + rates[4] * pitched[:, 0]
        return np.concatenate((omega, self.axes(q, frame) @ rates[:3]))

    def tool_speed(self, q: FloatArray, qd: FloatArray) -> float:
        """Return `velocity.tool_speed`."""
        return velocity.tool_speed(self.chain, q, qd)

    def tool_speed_bound(self, qd: FloatArray) -> float:
        """Return `velocity.tool_speed_bound`."""
        return velocity.tool_speed_bound(self.chain, qd)

    def branch_limits(self, limits: Limits) -> Mapping[AnyBranch, Limits]:
        """Return ``limits`` with the elbow kept on one side of the stretched arm."""
        elbows = {elbow: self._bent(limits, elbow) for elbow in ("up", "down")}
        return {branch: elbows[branch.elbow] for branch in BRANCHES}

    def _bent(self, limits: Limits, elbow: str) -> Limits:
        canonical = arm_of(self.chain)
        sign, shift = canonical.signs[ELBOW], canonical.shifts[ELBOW]
        seam = -sign * shift
        lower, upper = np.array(limits.lower), np.array(limits.upper)
        if lower[ELBOW] < seam < upper[ELBOW]:
            if (elbow == "up") == (sign > 0.0):
                lower[ELBOW] = seam
            else:
                upper[ELBOW] = seam
        return replace(limits, lower=lower, upper=upper)

    def ready(self, posture: Sequence[float], T_base_shoulder: FloatArray) -> FloatArray:  # noqa: ARG002
        """Return the joint angles (5,) [rad] inside limits, nearest to a canonical posture."""
        chain = self.chain
        q = in_limits_turns(chain, arm_of(chain).joints(posture))
        room = READY_ROOM * (chain.upper - chain.lower)
        return np.clip(q, chain.lower + room, chain.upper - room)


def _five(branch: AnyBranch) -> Branch:
    return Branch.parse(str(branch))
