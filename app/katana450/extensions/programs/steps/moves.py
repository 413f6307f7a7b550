"""Steps that move the joints freely, without a prescribed path of the tool."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated

import numpy as np

from katana450.arm.control.commands import commands as cmd
from katana450.extensions.programs.building.plan_state import PlanState
from katana450.extensions.programs.building.step import Step
from katana450.extensions.programs.language import kinds
from katana450.extensions.programs.language.declaration import Declared, Kind
from katana450.extensions.programs.language.kinds import Axis, Branch, Offset, Orientation
from katana450.extensions.programs.language.places import PLACE, Blend, Places
from katana450.extensions.programs.language.scope import ScriptContext
from katana450.extensions.programs.language.source import YamlValue
from katana450.extensions.programs.language.step_target import KEPT, StepTarget
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.planning.joint_path import JointPath


@dataclass(frozen=True, eq=False)
class RelativeMove(Declared):
    """Move relative to the present place.

    Attributes:
        by: (3,) motion of the tool point [m].
        angles, branch: orientation and branch at its end.
        in_base: whether ``by`` and ``angles`` are in the base frame, not in {S}.
    """

    noun = "a relative move"

    by: Offset
    angles: Orientation = KEPT
    branch: Branch = None
    in_base: bool = False

    def joints(self, plan: PlanState) -> FloatArray:
        """Return the joints (n,) [rad] at its end. Raises InputError if it cannot be reached."""
        by = plan.direction(self.by, in_base=self.in_base)
        end = plan.target_at(StepTarget(angles=self.angles, in_base=self.in_base))
        return plan.joints_of(end.moved(frozen(end.position + by)), self.branch)


def _destination(value: YamlValue, context: ScriptContext) -> StepTarget | RelativeMove:
    if value.kind == "mapping" and any(name.held == "by" for name, _ in value.fields):
        return RelativeMove.read(value, context)
    return PLACE(value, context)


@dataclass(frozen=True)
class Move(Step, word="move"):
    """Move to a place on any path, round obstacles."""

    short = "to"

    to: Annotated[
        StepTarget | RelativeMove,
        Kind(_destination, {"anyOf": [PLACE.schema, RelativeMove.schema()]}),
    ]

    def build(self, plan: PlanState) -> PlanState:
        """Plan the motion. Raises InputError if the place cannot be reached."""
        to = self.to
        q = plan.joints_at(to) if isinstance(to, StepTarget) else to.joints(plan)
        return plan.move_to(q, "move")


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
class Nudge(Step, word="nudge"):
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
class Home(Step, word="home"):
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
