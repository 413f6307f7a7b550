"""Steps that move no joint: gripper, waits, tool frame, speed, and what stands on the table."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np

from katana450 import tolerances
from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.commands.commands import MIN_SPEED
from katana450.arm.control.objects.loose_objects import check_carried
from katana450.arm.control.state.state import State
from katana450.errors import InputError
from katana450.extensions.free_place import girth
from katana450.extensions.programs.building.actions import (
    GiveCommand,
    MoveFingers,
    SetSpeed,
    Wait,
    use_tool,
)
from katana450.extensions.programs.building.plan_state import PlanState, finger_unit, with_fingers
from katana450.extensions.programs.building.step import Step
from katana450.extensions.programs.language.declaration import Kind
from katana450.extensions.programs.language.kinds import (
    FINGER_PLACE,
    Length,
    Object,
    ObjectName,
    any_of,
    choice,
    known,
    number,
    volume,
)
from katana450.extensions.programs.language.scope import ScriptContext
from katana450.extensions.programs.language.source import YamlValue
from katana450.extensions.programs.steps.place import check_fall
from katana450.maths.geometry import se3
from katana450.maths.water.units import ML

MAX_PAUSE = 3600.0
"""[s] Maximum duration of a wait."""


def _finger_place(value: YamlValue, context: ScriptContext) -> float | str:
    """Read ``open``, ``closed`` or a number. Raises ScriptError."""
    if value.number is not None:
        return FINGER_PLACE(value, context)
    return choice("open", "closed")(value)


FINGERS = Kind(
    _finger_place,
    any_of(
        "open, closed, or the angle of the fingers, deg; mm if they slide",
        *FINGER_PLACE.schema["anyOf"],
        {"enum": ["open", "closed"]},
    ),
)


@dataclass(frozen=True)
class Gripper(Step, word="gripper", example="open"):
    """Open or close the fingers, or move them to an angle, deg, or a place, mm, if they slide.

    Attributes:
        to: ``open``, ``closed`` or a position [deg or mm].
        holding: name of the object that they must hold then; "" for any or none.
    """

    by_fingers = True
    noun = "`gripper`"
    short = "to"

    to: Annotated[float | str, FINGERS]
    holding: ObjectName = ""

    def build(self, plan: PlanState) -> PlanState:
        """Append the finger motion.

        Raises InputError outside the range of the fingers, and if they would not hold what they
        must.
        """
        fingers = plan.plan_context.arm.gripper
        if not fingers.moves:
            raise InputError("This arm has no fingers.")
        ends = {"open": fingers.opened, "closed": fingers.closed}
        unit, scale = finger_unit(plan)
        angle = ends[self.to] if isinstance(self.to, str) else scale * self.to
        if abs(fingers.clamp(angle) - angle) > tolerances.LIMIT_SLACK:
            low, high = fingers.lower / scale, fingers.upper / scale
            raise InputError(f"The range of the fingers is {low:.1f} to {high:.1f} {unit}.")
        angle = fingers.clamp(angle)
        held = with_fingers(plan, angle)
        if self.holding and (held.held is None or held.held.name != self.holding):
            instead = "nothing" if held.held is None else held.held.name
            raise InputError(
                f"The fingers would hold {instead} instead of {self.holding}, which has to stand "
                "where they close."
            )
        if plan.state.held is not None and held.held is None:
            check_fall(plan, plan.state.held)
        plan = plan.with_action("gripper", MoveFingers(angle, self.holding), held)
        return plan if held.grip is not None else replace(plan, taken=None)


@dataclass(frozen=True)
class TimedPause(Step, word="wait", example="1"):
    """Wait, s."""

    short = "seconds"

    seconds: Annotated[float, number(0.0, MAX_PAUSE, "s")]

    def build(self, plan: PlanState) -> PlanState:
        """Append the wait."""
        return plan.with_action("wait", Wait(self.seconds)) if self.seconds else plan


@dataclass(frozen=True)
class Tool(Step, word="tool", example="tcp"):
    """Tool frame of all later points: tcp, grasp or flange."""

    short = "name"

    name: Annotated[str, known("tools")]

    def build(self, plan: PlanState) -> PlanState:
        """Append the change of the tool frame. Raises InputError if it does not exist."""
        plan.plan_context.arm.chain_to(self.name)
        return plan.with_action(
            f"tool {self.name}", use_tool(self.name), replace(plan.state, tool=self.name)
        )


@dataclass(frozen=True)
class Speed(Step, word="speed", example="0.5"):
    """Fraction of full speed of all later motions."""

    short = "value"

    value: Annotated[float, number(MIN_SPEED, 1.0)]

    def build(self, plan: PlanState) -> PlanState:
        """Append the change of the speed."""
        return plan.with_action(f"speed {self.value:g}", SetSpeed(self.value))


@dataclass(frozen=True)
class Fill(Step, word="fill", example="100"):
    """Fill the cup with water, ml."""

    short = "water"

    water: Annotated[float, volume(0.0, 1000.0, "ml")]
    """[m^3]."""

    def build(self, plan: PlanState) -> PlanState:
        """Append the filling. Raises InputError if the cup is absent or too small."""
        command = cmd.Fill(self.water / ML)
        plan.plan_context.session.check(command)
        filled = GiveCommand(command, _has_cup)
        return plan.with_action("fill", filled, plan.after(command, ticks=1))


def _has_cup(state: State) -> bool:
    """Return True. Raises InputError without a cup."""
    if state.poured is None:
        raise InputError("There is no cup to fill.")
    return True


@dataclass(frozen=True)
class Put(Step, word="put"):
    """Set an object to another place on the table, without the arm.

    Attributes:
        name: name of the object.
        x, y: its place [m] in the base frame.
    """

    name: Object
    x: Length
    y: Length

    def build(self, plan: PlanState) -> PlanState:
        """Append the placement. Raises InputError if the place is occupied."""
        scene_object = plan.scene_object(self.name)
        if scene_object.carried:
            raise InputError(f"{self.name} is in the hand: set it down first.")
        T = se3.from_rotation_translation(scene_object.T[:3, :3], (self.x, self.y, 0.0))
        put = replace(scene_object, T=T)
        check_carried(plan.plan_context.session.environment.table, plan.state.objects, put)
        for other in plan.state.objects:
            apart = float(np.linalg.norm(put.T[:2, 3] - other.T[:2, 3]))
            if other.name != scene_object.name and apart < girth(put) + girth(other):
                raise InputError(f"{self.name} would stand in {other.name}.")
        command = cmd.PlaceObject(put)
        placed = GiveCommand(
            command, lambda state: any(np.array_equal(other.T, T) for other in state.objects)
        )
        return plan.with_action(f"put {self.name}", placed, plan.after(command, ticks=1))
