"""Steps that lead the tool along a curve: lines, arcs, circles, screws."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Self

import numpy as np

from katana450.extensions.programs import fields as read
from katana450.extensions.programs import places
from katana450.extensions.programs.fields import Fields
from katana450.extensions.programs.moves import through
from katana450.extensions.programs.plan_builder import PlanBuilder, StepTarget
from katana450.extensions.programs.script_context import ScriptContext
from katana450.extensions.programs.source import YamlValue
from katana450.extensions.programs.step import Step
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.branch import Branch
from katana450.maths.kinematics.tool import ToolTarget
from katana450.maths.planning.curve import Linear, ToolArc, ToolLine, ToolLines, ToolScrew
from katana450.maths.planning.pitch import roomiest
from katana450.maths.planning.tool_path import ToolPath

LEVEL_TOLERANCE = 1e-6
"""[1] A normal nearer to the vertical has a level circle."""


@dataclass(frozen=True)
class Line:
    """The tool on a straight line, pitch and roll turning evenly."""

    to: FloatArray | None
    by: FloatArray | None
    pitch: float | None
    roll: float | None
    in_base: bool

    @classmethod
    def read(cls, value: YamlValue, setting: ScriptContext) -> Self:
        fields = Fields(value, "a line")
        to = fields.take("to", read.vector(read.millimetres()), None)
        by = fields.take("by", read.vector(read.millimetres(), partly=True), None)
        if to is not None and by is not None:
            fields.problems += value.wrong("A line goes `to` a point or `by` a way.").problems
        found = cls(to, by, *places.angles(fields), setting.in_base)
        fields.done()
        return found

    def build(self, builder: PlanBuilder) -> None:
        start = builder.at
        end = builder.target_at(
            StepTarget(None, self.to, self.pitch, self.roll, None, self.in_base)
        )
        if self.by is not None:
            way = builder.direction(self.by, in_base=self.in_base)
            end = ToolTarget(start.position + way, end.pitch, end.roll)
        builder.lead([ToolLine(start, end)], "line")


@dataclass(frozen=True)
class Lines:
    """The tool on straight lines from place to place without a rest, their corners rounded."""

    through: tuple[StepTarget, ...]
    blend: float

    @classmethod
    def read(cls, value: YamlValue, setting: ScriptContext) -> Self:
        fields = Fields(value, "lines")
        found = cls(*through(fields, setting))
        if any(each.joints is not None or each.branch is not None for each in found.through):
            said = "Lines lead through points; through postures and branches leads `via`."
            fields.problems += value.wrong(said).problems
        fields.done()
        return found

    def build(self, builder: PlanBuilder) -> None:
        vias = [builder.at]
        for each in self.through:
            vias.append(builder.target_at(each, vias[-1]))
        blend = np.full(len(vias) - 2, self.blend)
        builder.lead([ToolLines(tuple(vias), blend)], "lines")


@dataclass(frozen=True)
class ArcGeometry:
    """What arcs and circles have in common: the axis, and what the tool does meanwhile."""

    centre: FloatArray
    axis: FloatArray
    pitch: float | str | None
    roll: float | None
    in_base: bool

    @classmethod
    def read(cls, fields: Fields, axis: str, setting: ScriptContext) -> Self:
        """``axis``: what it is called."""
        return cls(
            fields.need("centre", read.vector(read.millimetres()), np.zeros(3)),
            fields.need(axis, read.direction, np.eye(3)[0]),
            fields.take("pitch", places.pitch, None),
            fields.take("roll", read.degrees(), None),
            setting.in_base,
        )

    def seen(self, builder: PlanBuilder) -> tuple[FloatArray, FloatArray]:
        """Centre and axis (3,) in {S}."""
        centre = builder.point(self.centre, in_base=self.in_base)
        return centre, builder.direction(self.axis, in_base=self.in_base)

    def angles(self, now: ToolTarget) -> tuple[float, float]:
        """Pitch and roll [rad] that it says, or those of ``now``."""
        pitch = self.pitch if isinstance(self.pitch, float) else now.pitch
        return pitch, now.roll if self.roll is None else self.roll

    def follow(
        self, builder: PlanBuilder, arc: ToolArc, name: str, branch: Branch | None = None
    ) -> None:
        """Go to where ``arc`` begins, if the arm is not there, and along it."""

        def path(tried: Branch) -> ToolPath:
            found = roomiest(builder.chain, tried, arc) if self.pitch == places.ROOMIEST else arc
            return ToolPath(builder.chain, found, tried, builder.q)

        way = builder.first(builder.branches(branch), path)
        builder.move_to(way.start, f"{name}: to its start")
        builder.follow([way], name)


@dataclass(frozen=True)
class Arc:
    """The tool round an axis from where it is, climbing along it or not."""

    turn: ArcGeometry
    angle: float
    climb: float

    @classmethod
    def read(cls, value: YamlValue, setting: ScriptContext) -> Self:
        fields = Fields(value, "an arc")
        found = cls(
            ArcGeometry.read(fields, "axis", setting),
            fields.need("angle", read.degrees(), 1.0),
            fields.take("climb", read.millimetres(), 0.0),
        )
        fields.done()
        return found

    def build(self, builder: PlanBuilder) -> None:
        start = builder.at
        pitch, roll = self.turn.angles(start)
        profiles = Linear(start.pitch, pitch), Linear(start.roll, roll)
        arc = ToolArc(start.position, *self.turn.seen(builder), self.angle, *profiles, self.climb)
        self.turn.follow(builder, arc, "arc")


@dataclass(frozen=True)
class Circle:
    """The tool round a circle, from its highest point; it is gone to first."""

    turn: ArcGeometry
    radius: float
    turns: float
    branch: Branch | None

    @classmethod
    def read(cls, value: YamlValue, setting: ScriptContext) -> Self:
        fields = Fields(value, "a circle")
        found = cls(
            ArcGeometry.read(fields, "normal", setting),
            fields.need("radius", read.millimetres(0.1, 1000.0), 0.1),
            fields.take("turns", read.number(-20.0, 20.0), 1.0),
            places.branch(fields),
        )
        if found.turns == 0.0:
            fields.problems += value.wrong("A circle of no turns is no way.").problems
        fields.done()
        return found

    def build(self, builder: PlanBuilder) -> None:
        centre, normal = self.turn.seen(builder)
        up = builder.direction(np.array((0.0, 0.0, 1.0)), in_base=True)
        out = up - (up @ normal) * normal
        if math.hypot(*out) < LEVEL_TOLERANCE:
            # A level circle has no highest point: from the one farthest in front.
            ahead = builder.direction(np.array((1.0, 0.0, 0.0)), in_base=True)
            out = ahead - (ahead @ normal) * normal
        start = centre + self.radius / math.hypot(*out) * out
        pitch, roll = self.turn.angles(builder.at)
        profiles = Linear(pitch, pitch), Linear(roll, roll)
        arc = ToolArc(start, centre, normal, math.tau * self.turns, *profiles)
        self.turn.follow(builder, arc, "circle", self.branch)


@dataclass(frozen=True)
class Screw:
    """The tool moved as one body round an axis and along it, as five axes can."""

    point: FloatArray
    axis: FloatArray
    angle: float
    climb: float
    in_base: bool

    @classmethod
    def read(cls, value: YamlValue, setting: ScriptContext) -> Self:
        fields = Fields(value, "a screw")
        found = cls(
            fields.need("point", read.vector(read.millimetres()), np.zeros(3)),
            fields.need("axis", read.direction, np.eye(3)[0]),
            fields.take("angle", read.degrees(), 0.0),
            fields.take("climb", read.millimetres(), 0.0),
            setting.in_base,
        )
        if found.angle == 0.0 and found.climb == 0.0:
            fields.problems += value.wrong("A screw has an `angle`, a `climb` or both.").problems
        fields.done()
        return found

    def build(self, builder: PlanBuilder) -> None:
        axis = builder.direction(self.axis, in_base=self.in_base)
        omega = self.angle * axis
        v = np.cross(builder.point(self.point, in_base=self.in_base), omega) + self.climb * axis
        branch = builder.branches(None)[0]
        builder.lead([ToolScrew(builder.chain, branch, builder.q, np.append(omega, v))], "screw")


STEPS: dict[str, type[Step]] = {
    "line": Line,
    "lines": Lines,
    "arc": Arc,
    "circle": Circle,
    "screw": Screw,
}
"""Steps of this module, by their names in a script."""
