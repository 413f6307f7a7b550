"""Steps that arrange the table: places of objects, and water in the cup."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import takewhile
from typing import Annotated

import numpy as np

from katana450.arm.control import commands as cmd
from katana450.arm.control.scene_objects import SceneObject
from katana450.arm.control.support import check_carried
from katana450.errors import InputError
from katana450.extensions.free_place import girth
from katana450.extensions.programs.building.actions import FillCup, PutObject
from katana450.extensions.programs.building.plan_state import PlanState
from katana450.extensions.programs.building.step import Step
from katana450.extensions.programs.language.kinds import Length, Object, volume
from katana450.maths.geometry import se3
from katana450.maths.water.units import ML


@dataclass(frozen=True)
class Fill(Step, word="fill"):
    """Fill the cup with water, ml."""

    short = "water"

    water: Annotated[float, volume(0.0, 1000.0, "ml")]
    """[m^3]."""

    def build(self, plan: PlanState) -> PlanState:
        """Append the filling. Raises InputError if the cup is absent or too small."""
        command = cmd.Fill(self.water / ML)
        plan.plan_context.session.check(command)
        filled = FillCup(self.water)
        return plan.with_action("fill", filled, plan.after(command, ticks=1))


@dataclass(frozen=True)
class Put(Step, word="put"):
    """Set an object to another place on the table, without the arm.

    Consecutive steps of this kind form one arrangement: an object may overlap the old place of
    another that is placed elsewhere by a later one of them.

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
        # An object that a later `put` moves is checked at its final place.
        moved = {put.name for put in takewhile(_is_put, plan.ahead) if isinstance(put, Put)}
        for other in plan.state.objects:
            if other.name not in {scene_object.name, *moved} and _overlap(put, other):
                raise InputError(f"{self.name} would stand in {other.name}.")
        return plan.with_action(
            f"put {self.name}", PutObject(put), plan.after(cmd.PlaceObject(put), ticks=1)
        )


def _is_put(step: object) -> bool:
    return isinstance(step, Put)


def _overlap(one: SceneObject, other: SceneObject) -> bool:
    """Return whether two objects on the table overlap, each approximated by a circle."""
    apart = float(np.linalg.norm(one.T[:2, 3] - other.T[:2, 3]))
    return apart < girth(one) + girth(other)
