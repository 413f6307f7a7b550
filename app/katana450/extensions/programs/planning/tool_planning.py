"""The planning of one tool for the steps of a script: targets, paths and postures.

A target, a curve and the steps of a script are the same for every arm. Solvers differ: the
five-axis family has a closed form at every place of a curve, and other arms have the equations of
their poses.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from katana450 import tolerances
from katana450.arm.control.session.checks import NO_ARM_ANGLE
from katana450.arm.control.state.state import State
from katana450.arm.control.tool_kinematics import ToolKinematics
from katana450.errors import InputError, PathError
from katana450.extensions.general_arms.pose_equations import PoseEquations, equations_from
from katana450.extensions.programs.language.scope import Angles
from katana450.extensions.programs.planning.curve_path import CurveSearch, ToolPath
from katana450.extensions.programs.planning.curves import Curve, line_between
from katana450.maths.geometry import so3
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.kinematics.arm import arm_of
from katana450.maths.kinematics.branch import AnyBranch, Branch
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.priority import Priority
from katana450.maths.kinematics.projection import Projection
from katana450.maths.kinematics.tool import ToolTarget
from katana450.maths.motion.arm_angle import STEP, elbow_postures
from katana450.maths.planning.jet import Jet
from katana450.maths.planning.path import Path

EXACT: Final = 1e-9
"""[m] and [rad] Maximum error of a place that counts as reached."""

UPRIGHT: Final = 1e-9
"""[1] Sine of the tilt of axis 1 up to which it counts as upright."""

VERTICAL: Final = 1e-6
"""[1] Cosine of the pitch below which roll and yaw are not distinct."""

SWINGS: Final = tuple(np.radians((15, -15, 30, -30, 60, -60, 90, -90)).tolist())
"""[rad] Turns of the arm angle along a path, in the order in which they are tried."""

LEAST_STEADY: Final = 0.25
"""[1] Least part of the joint that leads a path of the elbow in the motion of all joints."""

ELBOW_SLACK: Final = 1e-6
"""[deg] Turn of the elbow that counts as none."""

PROBES: Final = (1.0, 0.75, 0.5, 0.25)
"""Places of a curve at which the reach is tried before the arm angle is turned."""


@dataclass(frozen=True, eq=False)
class ToolPlanning:
    """The planning of one tool. Joint angles ``q`` are (n,) [rad], points (3,) [m] in {S}.

    Attributes:
        kinematics: those of the tool.
        state: a state of the arm, whose joint angles, branch and priority are not used.
    """

    kinematics: ToolKinematics
    state: State

    @property
    def is_pitched(self) -> bool:
        """True for the closed form of five axes; other arms solve equations along a curve."""
        return self.kinematics.is_pitched

    def equations(self, q: FloatArray, joint: int | None = None) -> PoseEquations:
        """Return `equations_from` the joint angles `q`, with ``joint`` locked."""
        return equations_from(self.kinematics.solver, q, joint)

    @property
    def priorities(self) -> tuple[Priority, Priority]:
        """The priority that keeps the position, and the one that keeps the orientation."""
        if self.is_pitched:
            return Priority.POSITION, Priority.PITCH
        return Priority.POSE, Priority.ORIENTATION

    @property
    def orientation(self) -> str:
        """The kept orientation in words."""
        return "this pitch" if self.is_pitched else "this orientation"

    @property
    def chain(self) -> Chain:
        """The chain to the tool."""
        return self.kinematics.chain

    def at(self, q: FloatArray) -> ToolTarget:
        """Return the target at which the tool is with the joints at `q`."""
        return self.kinematics.target_at(q)

    def branches(self, q: FloatArray) -> Sequence[AnyBranch]:
        """Return all branches: that of `q`, then those that differ in later words of the name."""
        words = str(self.kinematics.branch_of(q)).split("-")

        def differences(branch: AnyBranch) -> list[bool]:
            return [a != b for a, b in zip(str(branch).split("-"), words, strict=False)]

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
        state = replace(self.state, goal=q, branch=self.kinematics.branch_of(q), priority=priority)
        return self.kinematics.leap(state, target, branch)

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
        present = self.kinematics.branch_of(q)
        for other in self.branches(q):
            yield other, self.converted(target, present, other)

    def converted(self, target: ToolTarget, source: AnyBranch, goal: AnyBranch) -> ToolTarget:
        """Return ``target``, in the numbers of the branch ``source``, in those of ``goal``."""
        return self.kinematics.target_on(replace(self.state, branch=source), target, goal)

    def joints(
        self, q: FloatArray, target: ToolTarget, branch: AnyBranch | None
    ) -> FloatArray | None:
        """Return the joint angles (n,) [rad] for ``target`` near `q`; None if it is out of reach.

        ``branch``: the only one that may be used; None for all, that of `q` first.
        """
        for other, wanted in self.seen_from(q, target, branch):
            posture = self.on_branch(q, wanted, other)
            if posture is not None:
                return posture
        return None

    def on_branch(self, q: FloatArray, target: ToolTarget, branch: AnyBranch) -> FloatArray | None:
        """Return the posture of ``branch`` at ``target``; None without one inside the limits.

        Equations lead from the nearest posture to the exact one.
        """
        nearest = self.nearest(q, target, branch, Priority.POSE)
        if self.is_pitched:
            error = max(nearest.position_error, nearest.rotation_error)
            return nearest.q if error <= EXACT else None
        exact = self.equations(nearest.q).posture(nearest.q, target.T)
        if exact is None or not self.chain.within_limits(exact.q):
            return None
        posture = self.chain.clamp(exact.q)
        distance, turn = self.at(posture).apart(target)
        reached = distance <= EXACT and (turn <= EXACT or self.chain.n in (3, 5))
        return posture if reached and self.kinematics.branch_of(posture) == branch else None

    def target(self, position: FloatArray, R: FloatArray) -> ToolTarget:
        """Return the target of the tool point at ``position`` (3,) [m].

        `R` (3, 3) is the rotation of the tool; of fewer than six axes that with axis 1 at zero.
        """
        if not self.is_pitched:
            return ToolTarget(frozen(position), rotation=frozen(R))
        arm = arm_of(self.chain)
        K = arm.T_C_S[:3, :3] @ R @ arm.T_K_tool[:3, :3].T
        pitch, roll = math.atan2(-K[2, 0], K[0, 0]), math.atan2(-K[1, 2], K[1, 1])
        return ToolTarget(position, pitch, roll)

    def oriented(self, now: ToolTarget, angles: Angles, R: FloatArray) -> ToolTarget:
        """Return ``now`` with those of ``angles`` that are given; the others stay.

        ``R`` (3, 3) is the rotation of {S} in the frame of the angles. Raises InputError for angles
        that the tool cannot choose: fewer than six axes have no yaw of their own, and four axes
        only one angle.
        """
        chosen = (angles.roll, angles.pitch, angles.yaw)
        if now.is_pitched:
            if angles.yaw is not None:
                raise InputError(
                    "The yaw of a five-axis arm follows from its position. Leave `yaw` out."
                )
            pitch = now.pitch if angles.pitch is None else angles.pitch
            return replace(now, pitch=pitch, roll=now.roll if angles.roll is None else angles.roll)
        if chosen == (None, None, None):
            return now
        if self.chain.n < 6:
            return replace(now, rotation=frozen(self._tilted(now.R, angles, R)))
        present = so3.to_rpy(R @ now.R)
        if None in (angles.roll, angles.yaw) and math.cos(present[1]) < VERTICAL:
            raise InputError(
                "The x axis of the tool is vertical, so roll and yaw turn it about the same axis. "
                "Give `roll`, `pitch` and `yaw` together."
            )
        roll, pitch, yaw = (b if a is None else a for a, b in zip(chosen, present, strict=True))
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
        for option in rolls:
            wanted = so3.from_rpy(option, pitch, 0.0)[2]
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

    def path(self, q: FloatArray, curve: Curve, branch: AnyBranch) -> Path:
        """Return the joint path along ``curve`` on ``branch``, which begins as near `q` as it can.

        The arm angle keeps its value, or turns evenly where that does not do. Raises
        PathError for a curve that the arm cannot follow.
        """
        if self.is_pitched:
            return ToolPath(self.chain, curve, Branch.parse(str(branch)), q)
        start = curve.at(Jet.variable(0.0)).target
        if self.kinematics.branch_of(q) != str(branch) or max(self.at(q).apart(start)) > EXACT:
            first = self.on_branch(q, start, branch)
            if first is None:
                raise PathError(
                    f"The path begins out of reach on the branch {branch}, at {{point}}. Move it "
                    "nearer to the arm, or give it another orientation.",
                    start.position.tolist(),
                )
            q = first
        equations = self.equations(q)
        try:
            return CurveSearch(equations, curve, q, np.zeros(len(equations.locked))).path()
        except PathError as error:
            refusal = error
        if not equations.locked or not self._may_swing(q, curve, branch):
            raise refusal
        chain, joint = self.chain, equations.locked[0]
        for swing in SWINGS:
            if chain.lower[joint] <= q[joint] + swing <= chain.upper[joint]:
                turns = np.zeros(len(equations.locked))
                turns[0] = swing
                with suppress(PathError):
                    return CurveSearch(equations, curve, q, turns).path()
        raise refusal

    def _may_swing(self, q: FloatArray, curve: Curve, branch: AnyBranch) -> bool:
        """Return whether a turn of the arm angle may help on a curve that is refused without.

        It does not where a place is out of reach with every arm angle. A closed curve must close in
        the joints too.
        """
        start, *places = (curve.at(Jet.variable(sigma)).target for sigma in (0.0, *PROBES))
        if max(start.apart(places[0])) <= EXACT:
            return False
        return all(self.on_branch(q, place, branch) is not None for place in places)

    def elbow_paths(self, q: FloatArray, by: float) -> list[Path]:
        """Return the joint paths, one after another, on which the elbow turns and the tool rests.

        On each one joint turns evenly, and the others follow from the pose.

        Args:
            q: joint angles (7,) at the start [rad].
            by: change of the arm angle [rad].

        Raises:
            InputError: the arm has no arm angle, or the elbow cannot turn so far.
        """
        if not self.kinematics.turns_elbow:
            raise InputError(NO_ARM_ANGLE)
        postures = np.array(list(elbow_postures(self.chain, q, by)))
        self._refuse_elbow(postures, by)
        curve = line_between(self.at(q), self.at(q))
        paths: list[Path] = []
        for last, joint in _steady_joints(np.diff(postures, axis=0)):
            slope = np.array((postures[last, joint] - q[joint],))
            try:
                paths.append(CurveSearch(self.equations(q, joint), curve, q, slope).path())
            except PathError as error:
                raise InputError(
                    "The elbow comes to a singularity on its path, where more joints can turn "
                    "while the tool rests. Turn it by less, or move the tool first."
                ) from error
            q = paths[-1].end
        return paths

    def _refuse_elbow(self, postures: FloatArray, by: float) -> None:
        """Raise InputError if ``postures`` (N, 7) [rad] leave the limits or end before ``by``."""
        chain, whole = self.chain, math.degrees(by)
        turned = np.arange(len(postures)) / max(1, math.ceil(abs(by) / STEP)) * whole
        beyond = np.maximum(chain.lower - postures, postures - chain.upper)
        outside = np.flatnonzero(beyond.max(axis=1) > tolerances.LIMIT_SLACK)
        if outside.size:
            place = int(outside[0])
            axis = int(beyond[place].argmax())
            limits = float(chain.lower[axis]), float(chain.upper[axis])
            limit = min(limits, key=lambda end: abs(end - float(postures[place, axis])))
            raise InputError(
                f"Axis {axis + 1} comes to its limit of {math.degrees(limit):.1f} deg after "
                f"{abs(turned[max(place - 1, 0)]):.0f} of {abs(whole):.4g} deg. Turn the elbow by "
                "less."
            )
        if abs(turned[-1]) < abs(whole) - ELBOW_SLACK:
            raise InputError(
                f"The elbow turns no farther than {abs(turned[-1]):.3g} of {abs(whole):.4g} deg "
                "while the tool rests. Turn it by less, or move the tool first."
            )


def _steady_joints(steps: FloatArray) -> Iterator[tuple[int, int]]:
    """Yield the end of each part of a path, counted in ``steps`` (N, 7), and a joint for it.

    The joint turns in one direction in the whole part, and by enough. No other does so for longer.
    """
    last = 0
    while last < len(steps):
        rest = steps[last:]
        parts = rest / np.linalg.norm(rest, axis=1, keepdims=True)
        steady = parts * np.sign(rest[0]) >= LEAST_STEADY
        lengths = np.where(steady.all(axis=0), len(rest), steady.argmin(axis=0))
        joint = int(lengths.argmax())
        last += max(1, int(lengths[joint]))
        yield last, joint
