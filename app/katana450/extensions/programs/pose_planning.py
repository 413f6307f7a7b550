"""The planning of tools of all arms outside the five-axis family."""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Final, cast

import numpy as np

from katana450.arm.control.state import State
from katana450.errors import InputError
from katana450.extensions.general_arms.driven_tool import DrivenTool
from katana450.extensions.general_arms.tool_pose import ToolPose
from katana450.extensions.programs.curve import Linear, ToolArc, ToolLine
from katana450.extensions.programs.following import CurveSearch, LostPathError
from katana450.extensions.programs.pose_curve import PoseCurve, PoseLines, TurnedCurve
from katana450.extensions.programs.pose_out_of_reach import (
    farthest,
    nearest,
    unreached,
)
from katana450.extensions.programs.pose_path import PosePath
from katana450.extensions.programs.script_frame import ScriptFrame
from katana450.extensions.programs.step_target import Angles
from katana450.extensions.programs.tool_planning import AnyCurve
from katana450.maths.geometry import so3
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.kinematics.branch import AnyBranch
from katana450.maths.kinematics.tool import DragTarget, ToolTarget
from katana450.maths.planning.jet import Jet

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
class PosePlanning:
    """The functions of one arm as `ToolPlanning`."""

    kinematics: DrivenTool

    @property
    def axes(self) -> int:
        """Number of axes."""
        return self.kinematics.chain.n

    def at(self, q: FloatArray) -> DragTarget:
        """Return the pose of the tool at `q`."""
        return self.kinematics.target_at(q)

    def oriented(self, now: DragTarget, angles: Angles, R: FloatArray) -> DragTarget:
        """Return ``now`` with the roll, pitch and yaw of ``angles``.

        Fewer than six axes have no yaw of their own, and four axes only one angle.
        """
        pose, given = _pose(now), (angles.roll, angles.pitch, angles.yaw)
        if given == (None, None, None):
            return pose
        if self.axes < 6:
            return replace(pose, R=frozen(self._tilted(pose.R, angles, R)))
        present = so3.to_rpy(R @ pose.R)
        if None in (angles.roll, angles.yaw) and math.cos(present[1]) < VERTICAL:
            raise InputError(
                "The x axis of the tool is vertical, so roll and yaw turn it about the same axis. "
                "Give `roll`, `pitch` and `yaw` together."
            )
        roll, pitch, yaw = (b if a is None else a for a, b in zip(given, present, strict=True))
        return replace(pose, R=frozen(R.T @ so3.from_rpy(roll, pitch, yaw)))

    def _tilted(self, R_now: FloatArray, angles: Angles, R: FloatArray) -> FloatArray:
        """Return the rotation (3, 3) with the angles of ``angles``, whatever the turn of axis 1."""
        chain = self.kinematics.chain
        if angles.yaw is not None:
            raise InputError(
                f"The yaw of a tool with {self.axes} axes follows from its position. Leave `yaw` "
                "out."
            )
        if self.axes < 4:
            raise InputError(
                f"The orientation of a tool with {self.axes} axes follows from its position. Leave "
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
        chain = self.kinematics.chain
        if self.axes > 4:
            axis = np.cross(now, wanted)
            sine = float(np.linalg.norm(axis))
            return axis * (math.atan2(sine, float(now @ wanted)) / sine if sine else 0.0)
        axis = chain.M[:3, :3].T @ chain.S[:3, 3]
        if abs(float(axis @ (wanted - now))) > EXACT:
            return None
        return axis * math.atan2(float(axis @ np.cross(now, wanted)), float(now @ wanted))

    def target(self, position: FloatArray, R: FloatArray) -> DragTarget:
        """Return the pose."""
        return ToolPose(frozen(position), frozen(R))

    def line(self, start: DragTarget, end: DragTarget) -> AnyCurve:
        """Return the line on which the tool turns about one axis."""
        points = ToolLine(_point(start.position), _point(end.position))
        return TurnedCurve(points, _pose(start).R, _turn_between(start, end))

    def lines(self, vias: Sequence[DragTarget], blend: FloatArray) -> AnyCurve:
        """Return lines with rounded corners."""
        return PoseLines(tuple(map(_pose, vias)), blend)

    def arc(
        self,
        centre: FloatArray,
        axis: FloatArray,
        angle: float,
        climb: float,
        start: DragTarget,
        end: DragTarget,
    ) -> AnyCurve:
        """Return the arc on which the tool turns about one axis."""
        points = ToolArc(start.position, centre, axis, angle, STILL, STILL, climb)
        return TurnedCurve(points, _pose(start).R, _turn_between(start, end))

    def roomiest(self, arc: AnyCurve, branch: AnyBranch) -> AnyCurve:  # noqa: ARG002
        """Raise InputError: the orientation of this tool is no pitch alone."""
        raise InputError(
            f"`roomiest` chooses the pitch of a five-axis arm, and this one has {self.axes} axes. "
            "Give the orientation, or leave it out to keep it."
        )

    def screw(self, q: FloatArray, twist: FloatArray) -> AnyCurve:
        """Return the screw, which the whole tool follows."""
        if self.axes < 6:
            raise InputError(
                "A screw needs an arm with at least six axes, or one of the five-axis family. This "
                f"one has {self.axes} axes. Use an arc."
            )
        start = self.kinematics.target_at(q)
        omega, v = twist[:3], twist[3:]
        turn = math.hypot(*omega)
        if turn == 0.0:
            return TurnedCurve(
                ToolLine(_point(start.position), _point(start.position + v)), start.R, omega
            )
        centre, climb = np.cross(omega, v) / turn**2, float(omega @ v) / turn
        points = ToolArc(start.position, centre, omega, turn, STILL, STILL, climb)
        return TurnedCurve(points, start.R, omega)

    def path(self, state: State, q: FloatArray, curve: AnyCurve, branch: AnyBranch) -> PosePath:
        """Return the path along the curve.

        The swivel of seven axes keeps its angle, or turns evenly where that does not do.
        """
        poses = cast(PoseCurve, curve)
        start = ToolPose.of(poses.at(Jet.variable(0.0)).T[0])
        if self.kinematics.branch_of(q) != str(branch) or max(self._apart(q, start)) > EXACT:
            begun = self._on_branch(state, q, start, branch)
            if begun is None:
                raise LostPathError(
                    f"The path begins out of reach on the branch {branch}, at {{point}}. Move it "
                    "nearer to the arm, or give it another orientation.",
                    start.position.tolist(),
                    0.0,
                )
            q = begun
        equations = self.kinematics.equations(q)
        try:
            return CurveSearch(equations, poses, q, np.zeros(len(equations.locked))).path()
        except LostPathError as error:
            refused = error
        if not equations.locked or not self._may_swing(state, q, poses, branch):
            raise refused
        chain, swivel = self.kinematics.chain, equations.locked[0]
        for swing in SWINGS:
            if chain.lower[swivel] <= q[swivel] + swing <= chain.upper[swivel]:
                turns = np.zeros(len(equations.locked))
                turns[0] = swing
                with suppress(LostPathError):
                    return CurveSearch(equations, poses, q, turns).path()
        raise refused

    def _may_swing(self, state: State, q: FloatArray, curve: PoseCurve, branch: AnyBranch) -> bool:
        """Return whether a turn of the swivel may help on a curve that is refused without.

        It does not where a place is out of reach with every swivel. A closed curve must close in
        the joints too.
        """
        places = [ToolPose.of(curve.at(Jet.variable(each)).T[0]) for each in (0.0, *PROBES)]
        if max(places[0].apart(places[1])) <= EXACT:
            return False
        return all(self._on_branch(state, q, each, branch) is not None for each in places[1:])

    def branches(self, q: FloatArray) -> Sequence[AnyBranch]:
        """Return all branches, that of `q` first."""
        here = self.kinematics.branch_of(q)
        return sorted(self.kinematics.branches, key=lambda each: each != here)

    def branch(self, branch: AnyBranch) -> AnyBranch:
        """Return its name."""
        if str(branch) not in self.kinematics.branches:
            names = ", ".join(map(str, self.kinematics.branches))
            raise InputError(f"This arm has no branch {str(branch)!r}; its branches are {names}.")
        return str(branch)

    def joints(
        self, state: State, q: FloatArray, target: DragTarget, branch: AnyBranch | None
    ) -> FloatArray | None:
        """Return the posture on one branch after the other that takes the pose."""
        tried = self.branches(q) if branch is None else (branch,)
        found = (self._on_branch(state, q, target, each) for each in tried)
        return next((each for each in found if each is not None), None)

    def _on_branch(
        self, state: State, q: FloatArray, target: DragTarget, branch: AnyBranch
    ) -> FloatArray | None:
        """Return the posture of ``branch`` inside the limits that takes the pose; None without."""
        pose = _pose(target)
        near = nearest(self.kinematics, state, q, pose, branch)
        exact = self.kinematics.equations(near.q).posture(near.q, pose.T)
        chain = self.kinematics.chain
        if exact is None or not chain.within_limits(exact.q):
            return None
        found = chain.clamp(exact.q)
        apart, turned = self._apart(found, pose)
        reached = apart <= EXACT and (turned <= EXACT or self.axes in (3, 5))
        return found if reached and self.kinematics.branch_of(found) == str(branch) else None

    def _apart(self, q: FloatArray, pose: ToolPose) -> tuple[float, float]:
        """Return the distance [m] and the angle [rad] of the tool at `q` from ``pose``."""
        return self.kinematics.target_at(q).apart(pose)

    def unreached(
        self,
        state: State,
        q: FloatArray,
        target: DragTarget,
        branch: AnyBranch | None,
        frame: ScriptFrame,
    ) -> str:
        """Return `pose_out_of_reach.unreached`."""
        branches = self.branches(q) if branch is None else (branch,)

        def reached(pose: ToolPose) -> bool:
            return self.joints(state, q, pose, branch) is not None

        return unreached(self.kinematics, state, q, _pose(target), branches, frame, reached)

    def farthest(
        self, state: State, q: FloatArray, curve: AnyCurve, branch: AnyBranch, frame: ScriptFrame
    ) -> str:
        """Return `pose_out_of_reach.farthest`."""
        return farthest(self.kinematics, state, q, cast(PoseCurve, curve), branch, frame)


def _pose(target: DragTarget) -> ToolPose:
    return cast(ToolPose, target)


def _point(p: FloatArray) -> ToolTarget:
    """Return the point as the end of a line whose pitch and roll are not used."""
    return ToolTarget(p, 0.0, 0.0)


def _turn_between(start: DragTarget, end: DragTarget) -> FloatArray:
    """Return the rotation vector (3,) from one orientation to another."""
    return so3.log(_pose(end).R @ _pose(start).R.T)
