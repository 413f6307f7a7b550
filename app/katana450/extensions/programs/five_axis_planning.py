"""The planning of tools of the five-axis family."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import cast

import numpy as np

from katana450.arm.control.state import State
from katana450.arm.control.tool_kinematics import ToolKinematics
from katana450.errors import InputError
from katana450.extensions.programs.curve import Curve, Linear, ToolArc, ToolLine
from katana450.extensions.programs.out_of_reach import (
    binding,
    millimetres,
    nearest_place,
    unreached,
)
from katana450.extensions.programs.reaching import EXACT, branches_near, reaching
from katana450.extensions.programs.roomiest_pitch import roomiest
from katana450.extensions.programs.script_frame import ScriptFrame
from katana450.extensions.programs.step_target import Angles
from katana450.extensions.programs.tool_curves import ToolLines, ToolScrew
from katana450.extensions.programs.tool_path import ToolPath
from katana450.extensions.programs.tool_planning import AnyCurve
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.arm import arm_of
from katana450.maths.kinematics.branch import AnyBranch, Branch, branch_of
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.priority import Priority
from katana450.maths.kinematics.tool import DragTarget, ToolTarget
from katana450.maths.planning.checkpoint import checkpoint
from katana450.maths.planning.jet import Jet

SAMPLES = 65
"""Number of places of a path that are compared."""


@dataclass(frozen=True, eq=False)
class FiveAxisPlanning:
    """The functions of one tool as `ToolPlanning`."""

    kinematics: ToolKinematics

    @property
    def chain(self) -> Chain:
        """The chain to the tool."""
        return self.kinematics.chain

    def at(self, q: FloatArray) -> DragTarget:
        """Return the five freedoms of the tool at `q`."""
        return ToolTarget.at(self.chain, q)

    def oriented(self, now: DragTarget, angles: Angles, R: FloatArray) -> DragTarget:  # noqa: ARG002
        """Return ``now`` with the pitch and roll of ``angles``."""
        if angles.yaw is not None:
            raise InputError(
                "The yaw of a five-axis arm follows from its position. Leave `yaw` out."
            )
        five = _five(now)
        return replace(
            five,
            pitch=five.pitch if angles.pitch is None else angles.pitch,
            roll=five.roll if angles.roll is None else angles.roll,
        )

    def target(self, position: FloatArray, R: FloatArray) -> DragTarget:
        """Return the five freedoms of the tool, whose yaw is not used."""
        arm = arm_of(self.chain)
        K = arm.T_C_S[:3, :3] @ R @ arm.T_K_tool[:3, :3].T
        pitch, roll = math.atan2(-K[2, 0], K[0, 0]), math.atan2(-K[1, 2], K[1, 1])
        return ToolTarget(position, pitch, roll)

    def line(self, start: DragTarget, end: DragTarget) -> AnyCurve:
        """Return the line on which pitch and roll change evenly."""
        return ToolLine(_five(start), _five(end))

    def lines(self, vias: Sequence[DragTarget], blend: FloatArray) -> AnyCurve:
        """Return lines with rounded corners."""
        return ToolLines(tuple(map(_five, vias)), blend)

    def arc(
        self,
        centre: FloatArray,
        axis: FloatArray,
        angle: float,
        climb: float,
        start: DragTarget,
        end: DragTarget,
    ) -> AnyCurve:
        """Return the arc on which pitch and roll change evenly."""
        one, other = _five(start), _five(end)
        pitch, roll = Linear(one.pitch, other.pitch), Linear(one.roll, other.roll)
        return ToolArc(one.position, centre, axis, angle, pitch, roll, climb)

    def roomiest(self, arc: AnyCurve, branch: AnyBranch) -> AnyCurve:
        """Return `roomiest_pitch.roomiest`."""
        return roomiest(self.chain, cast(Branch, branch), cast(ToolArc, arc))

    def screw(self, q: FloatArray, twist: FloatArray) -> AnyCurve:
        """Return the screw, with the orientation nearest to it."""
        return ToolScrew(self.chain, branch_of(self.chain, q), q, twist)

    def path(
        self,
        state: State,  # noqa: ARG002
        q: FloatArray,
        curve: AnyCurve,
        branch: AnyBranch,
    ) -> ToolPath:
        """Return the closed form along the curve."""
        return ToolPath(self.chain, cast(Curve, curve), cast(Branch, branch), q)

    def branches(self, q: FloatArray) -> Sequence[AnyBranch]:
        """Return `branches_near`."""
        return branches_near(self.chain, q)

    def branch(self, branch: AnyBranch) -> AnyBranch:
        """Return one of BRANCHES."""
        return Branch.parse(str(branch))

    def joints(
        self,
        state: State,  # noqa: ARG002
        q: FloatArray,
        target: DragTarget,
        branch: AnyBranch | None,
    ) -> FloatArray | None:
        """Return `reaching`."""
        return reaching(self.chain, q, _five(target), cast(Branch | None, branch))

    def unreached(
        self,
        state: State,
        q: FloatArray,
        target: DragTarget,
        branch: AnyBranch | None,
        frame: ScriptFrame,
    ) -> str:
        """Return `out_of_reach.unreached`."""
        one = cast(Branch | None, branch)
        return unreached(self.chain, q, _five(target), one, state.tool, frame)

    def farthest(
        self,
        state: State,  # noqa: ARG002
        q: FloatArray,
        curve: AnyCurve,
        branch: AnyBranch,
        frame: ScriptFrame,
    ) -> str:
        """Return the place that is farthest out of reach with the pitch of the curve."""
        found = []
        for sigma in np.linspace(0.0, 1.0, SAMPLES).tolist():
            checkpoint()
            tool = cast(Curve, curve).at(Jet.variable(sigma))
            x, y, z, pitch, roll = (float(np.asarray(each.c0)) for each in tool)
            target = ToolTarget(np.array((x, y, z)), pitch, roll)
            one = cast(Branch, branch)
            nearest = nearest_place(self.chain, q, target, one, Priority.PITCH)
            found.append((sigma, target, nearest))
        sigma, target, nearest = max(found, key=lambda each: each[2].projection.position_error)
        missed = nearest.projection.position_error
        if missed <= EXACT:
            return ""
        return (
            f" Farthest out of reach is {frame.words(target.position)}, {100.0 * sigma:.0f} % "
            f"along it: {millimetres(missed)}, because {binding(self.chain, nearest)}."
        )


def _five(target: DragTarget) -> ToolTarget:
    return cast(ToolTarget, target)
