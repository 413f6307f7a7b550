"""The planning of one tool for the steps of a script: targets, curves, paths and postures.

A step is written once, in terms of `ToolPlanning`. What differs is which numbers a target has, and
so along which curves it moves: position, pitch and roll in the five-axis family (`PitchPlanning`),
poses for every other arm (`PosePlanning`).
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import ClassVar, Final, cast

import numpy as np

from katana450.arm.control.state import State
from katana450.arm.control.tool_kinematics import ToolKinematics
from katana450.errors import InputError
from katana450.extensions.general_arms.driven_tool import DrivenTool
from katana450.extensions.programs.language.step_target import Angles
from katana450.extensions.programs.planning.curves import (
    Curve,
    Linear,
    PoseCurve,
    PoseLines,
    ToolArc,
    ToolLine,
    ToolLines,
    ToolScrew,
    TurnedCurve,
    screw_points,
)
from katana450.extensions.programs.planning.pose_path import CurveSearch, LostPathError
from katana450.extensions.programs.planning.roomiest_pitch import roomiest
from katana450.extensions.programs.planning.tool_path import ToolPath
from katana450.maths.geometry import so3
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.kinematics.arm import arm_of
from katana450.maths.kinematics.branch import AnyBranch, Branch
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.priority import Priority
from katana450.maths.kinematics.projection import Projection
from katana450.maths.kinematics.tool import ToolTarget
from katana450.maths.planning.jet import Jet
from katana450.maths.planning.path import Path

AnyCurve = Curve | PoseCurve
"""A curve of the tool, of an arm of the five-axis family or of another one."""

EXACT: Final = 1e-9
"""[m] and [rad] Maximum error of a place that counts as reached."""

UPRIGHT: Final = 1e-9
"""[1] Sine of the tilt of axis 1 up to which it counts as upright."""

VERTICAL: Final = 1e-6
"""[1] Cosine of the pitch below which roll and yaw are not distinct."""

SWINGS: Final = tuple(np.radians((15, -15, 30, -30, 60, -60, 90, -90)).tolist())
"""[rad] Turns of the swivel along a path, in the order in which they are tried."""

PROBES: Final = (1.0, 0.75, 0.5, 0.25)
"""Places of a curve at which the reach is tried before the swivel is turned."""

STILL: Final = Linear(0.0, 0.0)


@dataclass(frozen=True, eq=False)
class ToolPlanning(ABC):
    """The planning of one tool. Joint angles ``q`` are (n,) [rad], points (3,) [m] in {S}.

    Attributes:
        kinematics: those of the tool.
        state: a state of the arm, whose joint angles, branch and priority are not used.
    """

    kinematics: ToolKinematics
    state: State

    priorities: ClassVar[tuple[Priority, Priority]]
    """Those that keep the position, and the orientation that the arm can choose."""

    orientation: ClassVar[str]
    """The kept orientation in words."""

    @property
    def chain(self) -> Chain:
        """The chain to the tool."""
        return self.kinematics.chain

    def at(self, q: FloatArray) -> ToolTarget:
        """Return the target at which the tool is with the joints at `q`."""
        return self.kinematics.target_at(q)

    def branches(self, q: FloatArray) -> Sequence[AnyBranch]:
        """Return all branches: that of `q`, then those that differ in later words of the name."""
        here = str(self.kinematics.branch_of(q)).split("-")

        def differences(branch: AnyBranch) -> list[bool]:
            return [a != b for a, b in zip(str(branch).split("-"), here, strict=False)]

        return sorted(self.kinematics.branches, key=differences)

    def branch(self, name: AnyBranch) -> AnyBranch:
        """Return a branch that a script names. Raises InputError if the arm does not have it."""
        for branch in self.kinematics.branches:
            if str(branch) == str(name):
                return branch
        names = ", ".join(map(str, self.kinematics.branches))
        raise InputError(f"This arm has no branch {str(name)!r}; its branches are {names}.")

    def nearest(
        self, q: FloatArray, target: ToolTarget, branch: AnyBranch, priority: Priority
    ) -> Projection:
        """Return the posture on ``branch`` nearest to ``target``, with the arm at `q`."""
        here = replace(self.state, goal=q, branch=self.kinematics.branch_of(q), priority=priority)
        return self.kinematics.leap(here, target, branch)

    def seen_from(
        self, q: FloatArray, target: ToolTarget, branch: AnyBranch | None
    ) -> Iterator[tuple[AnyBranch, ToolTarget]]:
        """Yield each branch that may be used, with ``target`` in its numbers.

        With the other shoulder posture the same tool pose may have other pitch and roll values.

        Args:
            q: present joint angles.
            target: in the numbers of the branch of `q`.
            branch: the only branch that may be used, in whose numbers ``target`` is; None for all.
        """
        if branch is not None:
            yield branch, target
            return
        here = self.kinematics.branch_of(q)
        for there in self.branches(q):
            yield there, self.converted(target, here, there)

    def converted(self, target: ToolTarget, here: AnyBranch, there: AnyBranch) -> ToolTarget:
        """Return ``target``, given in the numbers of the branch ``here``, in those of ``there``."""
        return self.kinematics.target_on(replace(self.state, branch=here), target, there)

    def joints(
        self, q: FloatArray, target: ToolTarget, branch: AnyBranch | None
    ) -> FloatArray | None:
        """Return the joint angles (n,) [rad] for ``target`` near `q`; None if it is out of reach.

        ``branch``: the only one that may be used; None for all, that of `q` first.
        """
        for there, wanted in self.seen_from(q, target, branch):
            posture = self.on_branch(q, wanted, there)
            if posture is not None:
                return posture
        return None

    @abstractmethod
    def on_branch(self, q: FloatArray, target: ToolTarget, branch: AnyBranch) -> FloatArray | None:
        """Return the posture of ``branch`` at ``target``; None without one inside the limits."""

    @abstractmethod
    def target(self, position: FloatArray, R: FloatArray) -> ToolTarget:
        """Return the target of the tool point at ``position`` (3,) [m].

        `R` (3, 3) is the rotation of the tool; of fewer than six axes that with axis 1 at zero.
        """

    @abstractmethod
    def oriented(self, now: ToolTarget, angles: Angles, R: FloatArray) -> ToolTarget:
        """Return ``now`` with those of ``angles`` that are given; the others stay.

        ``R`` (3, 3) is the rotation of {S} in the frame of the angles. Raises InputError for angles
        that the tool cannot choose.
        """

    @abstractmethod
    def line(self, start: ToolTarget, end: ToolTarget) -> AnyCurve:
        """Return the straight line on which the tool turns evenly from ``start`` to ``end``."""

    @abstractmethod
    def lines(self, vias: Sequence[ToolTarget], blend: FloatArray) -> AnyCurve:
        """Return straight lines with rounded corners; ``blend`` is that of `Polyline`."""

    @abstractmethod
    def arc(
        self,
        centre: FloatArray,
        axis: FloatArray,
        angle: float,
        climb: float,
        start: ToolTarget,
        end: ToolTarget,
    ) -> AnyCurve:
        """Return the turn of the tool point from ``start`` about ``axis`` through ``centre``.

        ``angle`` [rad], ``climb`` along the axis [m]. The tool turns evenly to the orientation of
        ``end``.
        """

    @abstractmethod
    def roomiest(self, arc: AnyCurve, branch: AnyBranch) -> AnyCurve:
        """Return ``arc`` with the pitch that keeps the joints farthest from their limits.

        Raises InputError for an arm whose orientations are no pitches.
        """

    @abstractmethod
    def screw(self, q: FloatArray, twist: FloatArray) -> AnyCurve:
        """Return the motion of the tool from `q` along ``twist`` (6,) in {S}, as far as it can."""

    @abstractmethod
    def path(self, q: FloatArray, curve: AnyCurve, branch: AnyBranch) -> Path:
        """Return the joint path along ``curve`` on ``branch``, which begins as near `q` as it can.

        Raises PathError for a curve that the arm cannot follow.
        """

    @abstractmethod
    def target_on(self, curve: AnyCurve, sigma: float) -> ToolTarget:
        """Return the target at the place ``sigma`` of ``curve``."""


class PitchPlanning(ToolPlanning):
    """The planning of the five-axis family: pitch and roll are chosen, and the yaw follows."""

    priorities = Priority.POSITION, Priority.PITCH
    orientation = "this pitch"

    def on_branch(self, q: FloatArray, target: ToolTarget, branch: AnyBranch) -> FloatArray | None:
        """Return the posture of the closed form."""
        best = self.nearest(q, target, branch, Priority.POSE)
        return best.q if max(best.position_error, best.rotation_error) <= EXACT else None

    def target(self, position: FloatArray, R: FloatArray) -> ToolTarget:
        """Return the five freedoms of the tool."""
        arm = arm_of(self.chain)
        K = arm.T_C_S[:3, :3] @ R @ arm.T_K_tool[:3, :3].T
        pitch, roll = math.atan2(-K[2, 0], K[0, 0]), math.atan2(-K[1, 2], K[1, 1])
        return ToolTarget(position, pitch, roll)

    def oriented(self, now: ToolTarget, angles: Angles, R: FloatArray) -> ToolTarget:  # noqa: ARG002
        """Return ``now`` with the pitch and roll of ``angles``."""
        if angles.yaw is not None:
            raise InputError(
                "The yaw of a five-axis arm follows from its position. Leave `yaw` out."
            )
        return replace(
            now,
            pitch=now.pitch if angles.pitch is None else angles.pitch,
            roll=now.roll if angles.roll is None else angles.roll,
        )

    def line(self, start: ToolTarget, end: ToolTarget) -> AnyCurve:
        """Return the line on which pitch and roll change evenly."""
        return ToolLine(start, end)

    def lines(self, vias: Sequence[ToolTarget], blend: FloatArray) -> AnyCurve:
        """Return lines with rounded corners."""
        return ToolLines(tuple(vias), blend)

    def arc(
        self,
        centre: FloatArray,
        axis: FloatArray,
        angle: float,
        climb: float,
        start: ToolTarget,
        end: ToolTarget,
    ) -> AnyCurve:
        """Return the arc on which pitch and roll change evenly."""
        pitch, roll = Linear(start.pitch, end.pitch), Linear(start.roll, end.roll)
        return ToolArc(start.position, centre, axis, angle, pitch, roll, climb)

    def roomiest(self, arc: AnyCurve, branch: AnyBranch) -> AnyCurve:
        """Return `roomiest_pitch.roomiest`."""
        return roomiest(self.chain, cast(Branch, branch), cast(ToolArc, arc))

    def screw(self, q: FloatArray, twist: FloatArray) -> AnyCurve:
        """Return the screw, with the orientation nearest to it."""
        return ToolScrew(self.chain, cast(Branch, self.kinematics.branch_of(q)), q, twist)

    def path(self, q: FloatArray, curve: AnyCurve, branch: AnyBranch) -> Path:
        """Return the closed form along the curve."""
        return ToolPath(self.chain, cast(Curve, curve), cast(Branch, branch), q)

    def target_on(self, curve: AnyCurve, sigma: float) -> ToolTarget:
        """Return the five freedoms at ``sigma``."""
        tool = cast(Curve, curve).at(Jet.variable(sigma))
        x, y, z, pitch, roll = (float(np.asarray(number.c0)) for number in tool)
        return ToolTarget(np.array((x, y, z)), pitch, roll)


class PosePlanning(ToolPlanning):
    """The planning of all arms outside the five-axis family."""

    priorities = Priority.POSE, Priority.ORIENTATION
    orientation = "this orientation"

    @property
    def _driven(self) -> DrivenTool:
        return cast(DrivenTool, self.kinematics)

    def target(self, position: FloatArray, R: FloatArray) -> ToolTarget:
        """Return the pose."""
        return ToolTarget(frozen(position), rotation=frozen(R))

    def oriented(self, now: ToolTarget, angles: Angles, R: FloatArray) -> ToolTarget:
        """Return ``now`` with the roll, pitch and yaw of ``angles``.

        Fewer than six axes have no yaw of their own, and four axes only one angle.
        """
        given = (angles.roll, angles.pitch, angles.yaw)
        if given == (None, None, None):
            return now
        if self.chain.n < 6:
            return replace(now, rotation=frozen(self._tilted(now.R, angles, R)))
        present = so3.to_rpy(R @ now.R)
        if None in (angles.roll, angles.yaw) and math.cos(present[1]) < VERTICAL:
            raise InputError(
                "The x axis of the tool is vertical, so roll and yaw turn it about the same axis. "
                "Give `roll`, `pitch` and `yaw` together."
            )
        roll, pitch, yaw = (b if a is None else a for a, b in zip(given, present, strict=True))
        return replace(now, rotation=frozen(R.T @ so3.from_rpy(roll, pitch, yaw)))

    def _tilted(self, R_now: FloatArray, angles: Angles, R: FloatArray) -> FloatArray:
        """Return the rotation (3, 3) with the angles of ``angles``, whatever the turn of axis 1."""
        chain, axes = self.chain, self.chain.n
        if angles.yaw is not None:
            raise InputError(
                f"The yaw of a tool with {axes} axes follows from its position. Leave `yaw` out."
            )
        if axes < 4:
            raise InputError(
                f"The orientation of a tool with {axes} axes follows from its position. Leave "
                "`pitch` and `roll` out."
            )
        up = R[2]
        if float(np.linalg.norm(np.cross(up, chain.S[:3, 0]))) > UPRIGHT:
            raise InputError(
                "`pitch` and `roll` need an upright axis 1. Give the place by `joints`."
            )
        # The vertical in the frame of the tool has pitch and roll, but no yaw.
        now = R_now.T @ up
        roll = math.atan2(now[1], now[2])
        pitch = math.atan2(-now[0], math.hypot(now[1], now[2]))
        pitch = pitch if angles.pitch is None else angles.pitch
        rolls = (roll, roll + math.pi) if angles.roll is None else (angles.roll,)
        for each in rolls:
            wanted = so3.from_rpy(each, pitch, 0.0)[2]
            turn = self._turn(now, wanted)
            if turn is not None:
                return R_now @ so3.exp(-turn)
        raise InputError(
            f"The tool of this arm cannot have a pitch of {math.degrees(pitch):.4g} deg with a "
            f"roll of {math.degrees(rolls[0]):.4g} deg: its last axes turn it in one plane. Leave "
            "`roll` out, or move the arm there and read both from the page."
        )

    def _turn(self, now: FloatArray, wanted: FloatArray) -> FloatArray | None:
        """Return the rotation vector (3,) in the frame of the tool that takes one vertical there.

        Four axes turn the tool about their last axis alone; None if that does not do it.
        """
        chain = self.chain
        if chain.n > 4:
            axis = np.cross(now, wanted)
            sine = float(np.linalg.norm(axis))
            return axis * (math.atan2(sine, float(now @ wanted)) / sine if sine else 0.0)
        axis = chain.M[:3, :3].T @ chain.S[:3, 3]
        if abs(float(axis @ (wanted - now))) > EXACT:
            return None
        return axis * math.atan2(float(axis @ np.cross(now, wanted)), float(now @ wanted))

    def line(self, start: ToolTarget, end: ToolTarget) -> AnyCurve:
        """Return the line on which the tool turns about one axis."""
        points = ToolLine(ToolTarget(start.position), ToolTarget(end.position))
        return TurnedCurve(points, start.R, _turn_between(start, end))

    def lines(self, vias: Sequence[ToolTarget], blend: FloatArray) -> AnyCurve:
        """Return lines with rounded corners."""
        return PoseLines(tuple(vias), blend)

    def arc(
        self,
        centre: FloatArray,
        axis: FloatArray,
        angle: float,
        climb: float,
        start: ToolTarget,
        end: ToolTarget,
    ) -> AnyCurve:
        """Return the arc on which the tool turns about one axis."""
        points = ToolArc(start.position, centre, axis, angle, STILL, STILL, climb)
        return TurnedCurve(points, start.R, _turn_between(start, end))

    def roomiest(self, arc: AnyCurve, branch: AnyBranch) -> AnyCurve:  # noqa: ARG002
        """Raise InputError: the orientation of this tool is no pitch alone."""
        raise InputError(
            "`roomiest` chooses the pitch of a five-axis arm, and this one has "
            f"{self.chain.n} axes. Give the orientation, or leave it out to keep it."
        )

    def screw(self, q: FloatArray, twist: FloatArray) -> AnyCurve:
        """Return the screw, which the whole tool follows."""
        if self.chain.n < 6:
            raise InputError(
                "A screw needs an arm with at least six axes, or one of the five-axis family. This "
                f"one has {self.chain.n} axes. Use an arc."
            )
        start = self._driven.target_at(q)
        return TurnedCurve(screw_points(start.position, twist), start.R, twist[:3])

    def path(self, q: FloatArray, curve: AnyCurve, branch: AnyBranch) -> Path:
        """Return the path along the curve.

        The swivel of seven axes keeps its angle, or turns evenly where that does not do.
        """
        poses = cast(PoseCurve, curve)
        start = self.target_on(curve, 0.0)
        if self.kinematics.branch_of(q) != str(branch) or max(self._apart(q, start)) > EXACT:
            begun = self.on_branch(q, start, branch)
            if begun is None:
                raise LostPathError(
                    f"The path begins out of reach on the branch {branch}, at {{point}}. Move it "
                    "nearer to the arm, or give it another orientation.",
                    start.position.tolist(),
                    0.0,
                )
            q = begun
        equations = self._driven.equations(q)
        try:
            return CurveSearch(equations, poses, q, np.zeros(len(equations.locked))).path()
        except LostPathError as error:
            refused = error
        if not equations.locked or not self._may_swing(q, poses, branch):
            raise refused
        chain, swivel = self.chain, equations.locked[0]
        for swing in SWINGS:
            if chain.lower[swivel] <= q[swivel] + swing <= chain.upper[swivel]:
                turns = np.zeros(len(equations.locked))
                turns[0] = swing
                with suppress(LostPathError):
                    return CurveSearch(equations, poses, q, turns).path()
        raise refused

    def _may_swing(self, q: FloatArray, curve: PoseCurve, branch: AnyBranch) -> bool:
        """Return whether a turn of the swivel may help on a curve that is refused without.

        It does not where a place is out of reach with every swivel. A closed curve must close in
        the joints too.
        """
        places = [self.target_on(curve, sigma) for sigma in (0.0, *PROBES)]
        if max(places[0].apart(places[1])) <= EXACT:
            return False
        return all(self.on_branch(q, each, branch) is not None for each in places[1:])

    def on_branch(self, q: FloatArray, target: ToolTarget, branch: AnyBranch) -> FloatArray | None:
        """Return the exact posture beside the nearest one."""
        chain, axes = self.chain, self.chain.n
        near = self.nearest(q, target, branch, Priority.POSE).q
        exact = self._driven.equations(near).posture(near, target.T)
        if exact is None or not chain.within_limits(exact.q):
            return None
        posture = chain.clamp(exact.q)
        apart, turned = self._apart(posture, target)
        reached = apart <= EXACT and (turned <= EXACT or axes in (3, 5))
        return posture if reached and self.kinematics.branch_of(posture) == branch else None

    def target_on(self, curve: AnyCurve, sigma: float) -> ToolTarget:
        """Return the pose at ``sigma``."""
        return ToolTarget.of(cast(PoseCurve, curve).at(Jet.variable(sigma)).T[0])

    def _apart(self, q: FloatArray, target: ToolTarget) -> tuple[float, float]:
        """Return the distance [m] and the angle [rad] of the tool at `q` from ``target``."""
        return self.at(q).apart(target)


def _turn_between(start: ToolTarget, end: ToolTarget) -> FloatArray:
    """Return the rotation vector (3,) from one orientation to another."""
    return so3.log(end.R @ start.R.T)


def planning_of(kinematics: ToolKinematics, state: State) -> ToolPlanning:
    """Return the planning of the tool of ``kinematics``."""
    kind = PosePlanning if isinstance(kinematics, DrivenTool) else PitchPlanning
    return kind(kinematics, state)
