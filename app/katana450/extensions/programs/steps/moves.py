"""Steps that move the arm: the joints freely, or the tool along a line, an arc or a circle."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Annotated, Any

import numpy as np

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.session.session import TOOL_SPEED
from katana450.errors import InputError
from katana450.extensions.programs.building.plan_state import PlanState
from katana450.extensions.programs.building.step import Step
from katana450.extensions.programs.language import kinds
from katana450.extensions.programs.language.kinds import (
    ARC_PITCH,
    DIRECTION,
    LENGTH,
    PLACE,
    ROOMIEST,
    Angle,
    Axis,
    Blend,
    Branch,
    Direction,
    Offset,
    Orientation,
    Places,
    Point,
    Pose,
    millimetres,
    number,
)
from katana450.extensions.programs.language.scope import KEPT, Angles, StepTarget
from katana450.extensions.programs.planning.curves import (
    Curve,
    ToolLines,
    arc_between,
    line_between,
    roomiest,
)
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.kinematics.branch import AnyBranch
from katana450.maths.kinematics.tool import ToolTarget
from katana450.maths.planning.joint_path import JointPath
from katana450.maths.planning.path import Path


@dataclass(frozen=True)
class Move(Step, word="move"):
    """Move to a place on any path, round obstacles."""

    short = "to"

    to: Annotated[StepTarget, PLACE]

    def build(self, plan: PlanState) -> PlanState:
        """Plan the motion. Raises InputError if the place cannot be reached."""
        return plan.move_to(plan.joints_at(self.to), "move")


@dataclass(frozen=True)
class Joints(Step, word="joints"):
    """Move to these angles of the joints, deg, round obstacles."""

    short = "q"

    q: kinds.Joints
    """(n,) [rad]."""

    def build(self, plan: PlanState) -> PlanState:
        """Plan the motion. Raises InputError if the angles are outside the limits."""
        return plan.move_to(plan.joints_at(StepTarget(joints=self.q)), "joints")


@dataclass(frozen=True)
class Nudge(Step, word="nudge", example="{axis: 1, by: 10}"):
    """Turn one joint by an angle.

    Attributes:
        axis: index of the joint, from 0.
        by: the angle [rad].
    """

    axis: Axis
    by: Annotated[float, kinds.angle(-720.0, 720.0)]

    def build(self, plan: PlanState) -> PlanState:
        """Plan the motion. Raises InputError if the angle is outside the limits."""
        q = cmd.Nudge(self.axis + 1, self.by).targets(plan.q)
        return plan.move_to(plan.joints_at(StepTarget(joints=q)), "nudge")


@dataclass(frozen=True)
class TurnElbow(Step, word="turn_elbow"):
    """Turn the elbow of seven axes about the line from shoulder to wrist; the tool rests."""

    short = "by"

    by: Annotated[float, kinds.angle(-360.0, 360.0)]

    def build(self, plan: PlanState) -> PlanState:
        """Plan the motion. Raises InputError if the elbow cannot turn so far."""
        return plan.follow(plan.planning.elbow_paths(plan.q, self.by), "turn_elbow")


@dataclass(frozen=True)
class Home(Step, word="home", example=""):
    """Move to the ready posture."""

    noun = "`home`"

    def build(self, plan: PlanState) -> PlanState:
        """Plan the motion."""
        return plan.move_to(plan.plan_context.ready, "home")


@dataclass(frozen=True)
class Via(Step, word="via"):
    """Move the joints through places, with rounded corners."""

    through: Places
    blend: Blend = 0.5

    def build(self, plan: PlanState) -> PlanState:
        """Plan the motion. Raises InputError if a place cannot be reached."""
        vias, last = [plan.q], plan
        for place in self.through:
            vias.append(last.joints_at(place))
            last = last.standing(vias[-1])
        if self.blend:
            blend = np.full(len(vias) - 2, self.blend)
            return plan.follow([JointPath(plan.chain, np.array(vias), blend)], "via")
        legs = [np.array(leg) for leg in pairwise(vias)]
        return plan.follow([JointPath(plan.chain, leg, np.zeros(0)) for leg in legs], "via")


LEVEL_TOLERANCE = 1e-6
"""[1] Maximum horizontal component of the normal of a level circle."""


Feed = Annotated[
    float,
    number(
        0.1,
        1e3 * TOOL_SPEED,
        "mm/s",
        about="Speed of the tool point, mm/s; slower where limits require it",
        convert=lambda feed: feed / 1e3,
    ),
]
"""Maximum speed of the tool point [m/s]."""

Climb = Annotated[float, LENGTH.about("Motion along the axis, mm")]
"""Motion along an axis [m]."""


@dataclass(frozen=True, eq=False)
class Line(Step, word="line", example="{by: {z: 20}}"):
    """Move the tool point on a straight line, to a point or by an offset.

    Its orientation changes evenly.

    Attributes:
        to: the end; None to keep the present one.
        by: (3,) motion of the tool point [m]; None for that to the end.
        angles: orientation at the end; that of ``to`` where it has none.
        feed: maximum speed of the tool point [m/s].
        in_base: whether ``by`` and ``angles`` are in the base frame, not in {S}.
    """

    excludes = ("to", "by")

    to: Pose | None = None
    by: Offset | None = None
    angles: Orientation = KEPT
    feed: Feed = TOOL_SPEED
    in_base: bool = False

    def build(self, plan: PlanState) -> PlanState:
        """Plan the line. Raises InputError if the tool cannot follow it."""
        start = plan.target
        goal = StepTarget(in_base=self.in_base) if self.to is None else self.to
        angles = self.angles.or_else(goal.angles)
        end = plan.target_at(replace(goal, angles=angles))
        if self.by is not None:
            offset = plan.direction(self.by, in_base=self.in_base)
            end = end.moved(frozen(start.position + offset))
        try:
            return plan.lead([line_between(start, end)], "line", self.feed)
        except InputError as error:
            frame = plan.frame
            if self.to is not None and frame is not None and frame.looks_like_metres(end.position):
                raise InputError(plan.unreached(end, plan.branches(None)[0])) from error
            raise


@dataclass(frozen=True)
class Lines(Step, word="lines"):
    """Move the tool point on straight lines through places, with rounded corners."""

    noun = "lines"

    through: Places
    blend: Blend = 0.5
    feed: Feed = TOOL_SPEED

    @classmethod
    def mistakes(cls, values: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
        """Yield the mistake of places that are no points."""
        places = values.get("through") or ()
        if any(place.joints is not None or place.branch is not None for place in places):
            yield "", "`lines` takes points only. Use `via` for joint angles and branches."

    def build(self, plan: PlanState) -> PlanState:
        """Plan the lines. Raises InputError if the tool cannot follow them."""
        vias, planning = [plan.target], plan.planning
        branch = plan.branches(None)[0]
        for place_number, place in enumerate(self.through, start=1):
            vias.append(plan.target_at(place, vias[-1]))
            if planning.joints(plan.q, vias[-1], branch) is None:
                raise InputError(f"Place {place_number}: {plan.unreached(vias[-1], branch)}")
        if self.blend:
            blend = np.full(len(vias) - 2, self.blend)
            curves: list[Curve] = [ToolLines(tuple(vias), blend)]
        else:
            curves = [line_between(a, b) for a, b in pairwise(vias)]
        return plan.lead(curves, "lines", self.feed)


@dataclass(frozen=True, eq=False, kw_only=True)
class _Turn(Step):
    """The common part of arcs and circles.

    Attributes:
        centre: (3,) [m].
        axis: (3,) unit vector; the normal of a circle.
        pitch: [rad], ROOMIEST for the one farthest from the limits, or None to keep it.
        roll, yaw: [rad]; None to keep one.
        feed: maximum speed of the tool point along the curve [m/s].
        in_base: whether centre, axis and angles are in the base frame, not in {S}.
    """

    centre: Point
    axis: Direction
    pitch: Annotated[float | str | None, ARC_PITCH] = None
    roll: Angle | None = None
    yaw: Angle | None = None
    feed: Feed = TOOL_SPEED
    in_base: bool = False

    def seen(self, plan: PlanState) -> tuple[FloatArray, FloatArray]:
        """Return centre [m] and axis, each (3,), in {S}."""
        centre = plan.point(self.centre, in_base=self.in_base)
        return centre, plan.direction(self.axis, in_base=self.in_base)

    def turned(self, plan: PlanState) -> ToolTarget:
        """Return the present target with the orientation at the end of the curve."""
        pitch = self.pitch if isinstance(self.pitch, float) else None
        angles = Angles(pitch, self.roll, self.yaw)
        return plan.target_at(StepTarget(angles=angles, in_base=self.in_base))

    def follow(
        self, plan: PlanState, arc: Curve, name: str, branch: AnyBranch | None = None
    ) -> PlanState:
        """Move to the start of ``arc`` if the arm is not there, then along it.

        Raises InputError if the tool cannot follow it.
        """
        planning = plan.planning

        def path(plan: PlanState, arc_branch: AnyBranch) -> Path:
            curve = roomiest(planning.chain, arc_branch, arc) if self.pitch == ROOMIEST else arc
            return planning.path(plan.q, curve, arc_branch)

        tool_path = plan.choose(plan.branches(branch), path)
        start = plan.move_to(tool_path.start, f"{name}: to its start")
        return start.follow([tool_path], name, self.feed)


@dataclass(frozen=True, eq=False, kw_only=True)
class Arc(_Turn, word="arc"):
    """Move the tool point round an axis from its present place.

    Attributes:
        angle: about the axis [rad].
        climb: along the axis [m].
    """

    angle: Angle
    climb: Climb = 0.0

    def build(self, plan: PlanState) -> PlanState:
        """Plan the arc. Raises InputError if the tool cannot follow it."""
        start, end = plan.target, self.turned(plan)
        centre, axis = self.seen(plan)
        arc = arc_between(centre, axis, self.angle, self.climb, start, end)
        return self.follow(plan, arc, "arc")


@dataclass(frozen=True, eq=False, kw_only=True)
class Circle(_Turn, word="circle"):
    """Move to the highest point of a circle, then round it.

    Attributes:
        radius: [m].
        turns: number of turns.
    """

    axis: Annotated[FloatArray, DIRECTION.named("normal")]
    radius: Annotated[float, millimetres(0.1, 1000.0)]
    turns: Annotated[float, number(-20.0, 20.0, about="Number of turns, 1 unless given")] = 1.0
    branch: Branch = None

    @classmethod
    def mistakes(cls, values: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
        """Yield the mistake of a circle without turns."""
        if values.get("turns") == 0.0:
            yield "turns", "`turns` must not be 0."

    def build(self, plan: PlanState) -> PlanState:
        """Plan the circle. Raises InputError if the tool cannot follow it."""
        centre, normal = self.seen(plan)
        up = plan.direction(np.array((0.0, 0.0, 1.0)), in_base=True)
        out = up - (up @ normal) * normal
        if math.hypot(*out) < LEVEL_TOLERANCE:
            # A level circle has no highest point: start at the point farthest in front.
            front = plan.direction(np.array((1.0, 0.0, 0.0)), in_base=True)
            out = front - (front @ normal) * normal
        point = centre + self.radius / math.hypot(*out) * out
        start = self.turned(plan).moved(frozen(point))
        arc = arc_between(centre, normal, math.tau * self.turns, 0.0, start, start)
        return self.follow(plan, arc, "circle", self.branch)
