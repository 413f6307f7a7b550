"""Steps that move the tool along a curve: lines, arcs, circles, screws."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import ClassVar, Self

import numpy as np

from katana450.arm.control.session import TOOL_SPEED
from katana450.errors import InputError
from katana450.extensions.programs import fields as read
from katana450.extensions.programs import places
from katana450.extensions.programs.fields import Fields
from katana450.extensions.programs.moves import through
from katana450.extensions.programs.plan_builder import PlanBuilder
from katana450.extensions.programs.schema_parts import (
    ARC_PITCH,
    BLEND,
    BRANCH,
    FEED,
    LENGTH,
    OFFSET,
    ORIENTATION,
    TURN,
    Schema,
    mapping,
    number_or_text,
    reference,
)
from katana450.extensions.programs.script_context import ScriptContext
from katana450.extensions.programs.source import YamlValue
from katana450.extensions.programs.step import Step
from katana450.extensions.programs.step_target import Angles, StepTarget
from katana450.extensions.programs.tool_planning import AnyCurve
from katana450.extensions.programs.unfollowed import ANGLE, arc_remedies, line_remedies, unfollowed
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.kinematics.branch import AnyBranch
from katana450.maths.kinematics.tool import DragTarget, ToolTarget
from katana450.maths.planning.path import Path

LEVEL_TOLERANCE = 1e-6
"""[1] Maximum horizontal component of the normal of a level circle."""


def feed(fields: Fields) -> float:
    """Return the maximum speed of the tool point [m/s]; ``fields`` have it in mm/s, or not."""
    return fields.take("feed", read.number(0.1, 1e3 * TOOL_SPEED), 1e3 * TOOL_SPEED) / 1e3


@dataclass(frozen=True)
class Line:
    """Move the tool on a straight line; its orientation changes evenly."""

    schema: ClassVar[Schema] = mapping(
        "Move the tool point on a straight line, to a point or by an offset",
        "",
        {"to": reference("point"), "by": OFFSET, **ORIENTATION, "feed": FEED},
    )

    to: FloatArray | None
    by: FloatArray | None
    angles: Angles
    in_base: bool
    tool_speed: float = TOOL_SPEED

    @classmethod
    def read(cls, value: YamlValue, setting: ScriptContext) -> Self:
        """Read {to, by, pitch, roll, yaw, feed}. Raises ScriptError."""
        fields = Fields(value, "a line")
        to = fields.take("to", lambda each: places.pose(each, setting), None)
        by = fields.take("by", read.vector(read.millimetres(), partly=True), None)
        if to is not None and by is not None:
            fields.problems += value.wrong("A line takes `to` or `by`, not both.").problems
        angles = places.angles(fields)
        if to is not None:
            angles = angles.or_else(to.angles)
        end = None if to is None else to.position
        found = cls(end, by, angles, setting.in_base, feed(fields))
        fields.done()
        return found

    def build(self, builder: PlanBuilder) -> None:
        """Plan the line. Raises InputError if the tool cannot follow it."""
        start = builder.target
        end = builder.target_at(StepTarget(None, self.to, self.angles, None, self.in_base))
        if self.by is not None:
            offset = builder.direction(self.by, in_base=self.in_base)
            end = end.moved(frozen(start.position + offset))
        line = builder.planning.line(start, end)
        try:
            builder.lead([line], "line", self.tool_speed)
        except InputError as error:
            branch, frame = builder.branches(None)[0], builder.frame
            if self.to is not None and frame is not None and frame.looks_like_metres(end.position):
                raise InputError(builder.unreached(end, branch)) from error
            remedies = line_remedies(builder, start, end, error)
            raise unfollowed(builder, error, line, branch, remedies) from error


@dataclass(frozen=True)
class Lines:
    """Move the tool on straight lines through places without a rest, with rounded corners."""

    schema: ClassVar[Schema] = mapping(
        "Move the tool point on straight lines through places, with rounded corners",
        "through",
        {"through": reference("through"), "blend": BLEND, "feed": FEED},
    )

    through: tuple[StepTarget, ...]
    blend: float
    tool_speed: float

    @classmethod
    def read(cls, value: YamlValue, setting: ScriptContext) -> Self:
        """Read {through, blend, feed}. Raises ScriptError."""
        fields = Fields(value, "lines")
        found = cls(*through(fields, setting), feed(fields))
        if any(each.joints is not None or each.branch is not None for each in found.through):
            problem = "`lines` takes points only. Use `via` for joint angles and branches."
            fields.problems += value.wrong(problem).problems
        fields.done()
        return found

    def build(self, builder: PlanBuilder) -> None:
        """Plan the lines. Raises InputError if the tool cannot follow them."""
        vias, planning = [builder.target], builder.planning
        branch = builder.branches(None)[0]
        for number, each in enumerate(self.through, start=1):
            vias.append(builder.target_at(each, vias[-1]))
            if planning.joints(builder.q, vias[-1], branch) is None:
                raise InputError(f"Place {number}: {builder.unreached(vias[-1], branch)}")
        if self.blend:
            blend = np.full(len(vias) - 2, self.blend)
            curves = [planning.lines(vias, blend)]
        else:
            curves = [planning.line(a, b) for a, b in pairwise(vias)]
        builder.lead(curves, "lines", self.tool_speed)


@dataclass(frozen=True)
class ArcGeometry:
    """The common part of arcs and circles: the axis, and the orientation of the tool.

    Attributes:
        centre: (3,) [m].
        axis: (3,) unit vector.
        angles: pitch, roll and yaw [rad]; None to keep one.
        in_base: whether centre, axis and angles are in the base frame, not in {S}.
        is_roomiest: whether the pitch is the one farthest from the limits.
        tool_speed: maximum speed of the tool point along the curve [m/s].
    """

    centre: FloatArray
    axis: FloatArray
    angles: Angles
    in_base: bool
    is_roomiest: bool = False
    tool_speed: float = TOOL_SPEED

    @classmethod
    def read(cls, fields: Fields, axis: str, setting: ScriptContext) -> Self:
        """Read centre, axis, pitch, roll, yaw and feed. ``axis`` is the name of the axis field."""
        centre = fields.need("centre", lambda each: places.point(each, setting), np.zeros(3))
        direction = fields.need(axis, read.direction, np.eye(3)[0])
        pitch = fields.take("pitch", places.pitch, None)
        angles = Angles(
            pitch if isinstance(pitch, float) else None,
            fields.take("roll", read.angle(), None),
            fields.take("yaw", read.angle(), None),
        )
        is_roomiest = pitch == places.ROOMIEST
        return cls(centre, direction, angles, setting.in_base, is_roomiest, feed(fields))

    def seen(self, builder: PlanBuilder) -> tuple[FloatArray, FloatArray]:
        """Return centre [m] and axis, each (3,), in {S}."""
        centre = builder.point(self.centre, in_base=self.in_base)
        return centre, builder.direction(self.axis, in_base=self.in_base)

    def turned(self, builder: PlanBuilder) -> DragTarget:
        """Return the present target with the orientation at the end of the curve."""
        return builder.target_at(StepTarget(None, None, self.angles, None, self.in_base))

    def follow(
        self, builder: PlanBuilder, arc: AnyCurve, name: str, branch: AnyBranch | None = None
    ) -> None:
        """Move to the start of ``arc`` if the arm is not there, then along it."""
        planning = builder.planning

        def path(tried: AnyBranch) -> Path:
            found = planning.roomiest(arc, tried) if self.is_roomiest else arc
            return planning.path(builder.q, found, tried)

        tool_path = builder.first(builder.branches(branch), path)
        builder.move_to(tool_path.start, f"{name}: to its start")
        builder.follow([tool_path], name, self.tool_speed)

    def follow_or_advise(
        self,
        builder: PlanBuilder,
        arc: Callable[[DragTarget, float], AnyCurve],
        end: DragTarget,
        size: tuple[str, float],
        branch: AnyBranch | None = None,
    ) -> None:
        """Follow ``arc`` to the orientation of ``end``. Raises InputError with what works instead.

        ``arc`` gives the arc for a target and a fraction of its ``size``; see ``arc_remedies``.
        """
        name = "arc" if size[0] == ANGLE else "circle"

        try:
            self.follow(builder, arc(end, 1.0), name, branch)
        except InputError as error:
            if self.is_roomiest:
                raise
            first = builder.branches(branch)[0]
            # Eight branches would take long.
            tried = branch if isinstance(end, ToolTarget) else first

            def build(target: DragTarget, fraction: float) -> None:
                self.follow(builder, arc(target, fraction), name, tried)

            remedies = arc_remedies(builder, end, build, size, error)
            raise unfollowed(builder, error, arc(end, 1.0), first, remedies) from error


@dataclass(frozen=True)
class Arc:
    """Move the tool about an axis by ``angle`` [rad] and along it by ``climb`` [m]."""

    schema: ClassVar[Schema] = mapping(
        "Move the tool point round an axis from its present place",
        "centre axis angle",
        {
            "centre": reference("point"),
            "axis": reference("direction"),
            "angle": TURN,
            "climb": {**LENGTH, "description": "Motion along the axis, mm"},
            "pitch": ARC_PITCH,
            "roll": TURN,
            "yaw": TURN,
            "feed": FEED,
        },
    )

    turn: ArcGeometry
    angle: float
    climb: float

    @classmethod
    def read(cls, value: YamlValue, setting: ScriptContext) -> Self:
        """Read {centre, axis, angle, climb, pitch, roll, yaw, feed}. Raises ScriptError."""
        fields = Fields(value, "an arc")
        found = cls(
            ArcGeometry.read(fields, "axis", setting),
            fields.need("angle", read.angle(), 1.0),
            fields.take("climb", read.millimetres(), 0.0),
        )
        fields.done()
        return found

    def build(self, builder: PlanBuilder) -> None:
        """Plan the arc. Raises InputError if the tool cannot follow it."""
        start, end = builder.target, self.turn.turned(builder)
        centre, axis = self.turn.seen(builder)
        arc_of = builder.planning.arc

        def arc(end: DragTarget, fraction: float) -> AnyCurve:
            angle, climb = fraction * self.angle, fraction * self.climb
            return arc_of(centre, axis, angle, climb, start, end)

        self.turn.follow_or_advise(builder, arc, end, (ANGLE, math.degrees(self.angle)))


@dataclass(frozen=True)
class Circle:
    """Move the tool to the highest point of a circle of ``radius`` [m], and from there round it."""

    schema: ClassVar[Schema] = mapping(
        "Move to the highest point of a circle, then round it",
        "centre normal radius",
        {
            "centre": reference("point"),
            "normal": reference("direction"),
            "radius": number_or_text(0.1, 1000.0, "mm"),
            "turns": number_or_text(-20.0, 20.0, "Number of turns, 1 unless given"),
            "pitch": ARC_PITCH,
            "roll": TURN,
            "yaw": TURN,
            "branch": BRANCH,
            "feed": FEED,
        },
    )

    turn: ArcGeometry
    radius: float
    turns: float
    branch: AnyBranch | None

    @classmethod
    def read(cls, value: YamlValue, setting: ScriptContext) -> Self:
        """Read the fields of the schema. Raises ScriptError."""
        fields = Fields(value, "a circle")
        found = cls(
            ArcGeometry.read(fields, "normal", setting),
            fields.need("radius", read.millimetres(0.1, 1000.0), 0.1),
            fields.take("turns", read.number(-20.0, 20.0), 1.0),
            places.branch(fields),
        )
        if found.turns == 0.0:
            fields.problems += value.wrong("`turns` must not be 0.").problems
        fields.done()
        return found

    def build(self, builder: PlanBuilder) -> None:
        """Plan the circle. Raises InputError if the tool cannot follow it."""
        centre, normal = self.turn.seen(builder)
        up = builder.direction(np.array((0.0, 0.0, 1.0)), in_base=True)
        out = up - (up @ normal) * normal
        if math.hypot(*out) < LEVEL_TOLERANCE:
            # A level circle has no highest point: start at the point farthest in front.
            ahead = builder.direction(np.array((1.0, 0.0, 0.0)), in_base=True)
            out = ahead - (ahead @ normal) * normal
        turn, arc_of = math.tau * self.turns, builder.planning.arc

        def arc(end: DragTarget, fraction: float) -> AnyCurve:
            start = centre + fraction * self.radius / math.hypot(*out) * out
            there = end.moved(frozen(start))
            return arc_of(centre, normal, turn, 0.0, there, there)

        size = "radius", 1e3 * self.radius
        self.turn.follow_or_advise(builder, arc, self.turn.turned(builder), size, self.branch)


@dataclass(frozen=True)
class Screw:
    """Move the tool as one rigid body about an axis and along it, as far as its axes can."""

    schema: ClassVar[Schema] = mapping(
        "Move the tool about an axis and along it, as one rigid body",
        "point axis",
        {
            "point": reference("point"),
            "axis": reference("direction"),
            "angle": TURN,
            "climb": {**LENGTH, "description": "Motion along the axis, mm"},
        },
    )

    point: FloatArray
    axis: FloatArray
    angle: float
    climb: float
    in_base: bool

    @classmethod
    def read(cls, value: YamlValue, setting: ScriptContext) -> Self:
        """Read {point, axis, angle, climb}. Raises ScriptError."""
        fields = Fields(value, "a screw")
        found = cls(
            fields.need("point", lambda each: places.point(each, setting), np.zeros(3)),
            fields.need("axis", read.direction, np.eye(3)[0]),
            fields.take("angle", read.angle(), 0.0),
            fields.take("climb", read.millimetres(), 0.0),
            setting.in_base,
        )
        if found.angle == 0.0 and found.climb == 0.0:
            fields.problems += value.wrong("A screw needs an `angle`, a `climb` or both.").problems
        fields.done()
        return found

    def build(self, builder: PlanBuilder) -> None:
        """Plan the screw. Raises InputError if the tool cannot follow it."""
        axis = builder.direction(self.axis, in_base=self.in_base)
        omega = self.angle * axis
        v = np.cross(builder.point(self.point, in_base=self.in_base), omega) + self.climb * axis
        branch = builder.branches(None)[0]
        screw = builder.planning.screw(builder.q, np.append(omega, v))
        try:
            builder.lead([screw], "screw")
        except InputError as error:
            raise unfollowed(builder, error, screw, branch, iter(())) from error


STEPS: dict[str, type[Step]] = {
    "line": Line,
    "lines": Lines,
    "arc": Arc,
    "circle": Circle,
    "screw": Screw,
}
"""Steps of this module, by their names in a script."""
