"""Steps that arrange the table: places of objects, and water in the cup."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import takewhile
from typing import ClassVar, Self

import numpy as np

from katana450.arm.control import commands as cmd
from katana450.arm.control.scene_objects import SceneObject
from katana450.arm.control.support import check_carried
from katana450.errors import InputError
from katana450.extensions.free_place import girth
from katana450.extensions.programs import fields as read
from katana450.extensions.programs.actions import FillCup, PutObject
from katana450.extensions.programs.fields import Fields
from katana450.extensions.programs.plan_builder import PlanBuilder
from katana450.extensions.programs.schema_parts import (
    LENGTH,
    OBJECT,
    Schema,
    mapping,
    number_or_text,
)
from katana450.extensions.programs.script_context import ScriptContext
from katana450.extensions.programs.source import YamlValue
from katana450.extensions.programs.step import Step
from katana450.maths.geometry import se3
from katana450.maths.water.units import ML


@dataclass(frozen=True)
class Fill:
    """Fill the cup with ``volume`` [m^3] of water."""

    schema: ClassVar[Schema] = number_or_text(0.0, 1000.0, "Fill the cup with water, ml")

    volume: float

    @classmethod
    def read(cls, value: YamlValue, setting: ScriptContext) -> Self:  # noqa: ARG003
        """Read a volume [ml]. Raises ScriptError."""
        return cls(ML * read.number(0.0, 1000.0, "ml")(value))

    def build(self, builder: PlanBuilder) -> None:
        """Append the filling. Raises InputError if the cup is absent or too small."""
        command = cmd.Fill(self.volume / ML)
        builder.plan_context.session.check(command)
        filled = FillCup(self.volume)
        builder.note("fill", filled, builder.after(command, ticks=1))


@dataclass(frozen=True)
class Put:
    """Place an object at x, y [m] in the base frame on the table; the arm does not carry it.

    Consecutive steps of this kind form one arrangement: an object may overlap the old place of
    another that is placed elsewhere by a later one of them.
    """

    schema: ClassVar[Schema] = mapping(
        "Set an object to another place on the table, without the arm",
        "object x y",
        {"object": OBJECT, "x": LENGTH, "y": LENGTH},
    )

    name: str
    x: float
    y: float

    @classmethod
    def read(cls, value: YamlValue, setting: ScriptContext) -> Self:  # noqa: ARG003
        """Read {object, x, y} [mm]. Raises ScriptError."""
        fields = Fields(value, "a put")
        found = cls(
            fields.need("object", read.text, ""),
            fields.need("x", read.millimetres(), 0.0),
            fields.need("y", read.millimetres(), 0.0),
        )
        fields.done()
        return found

    def build(self, builder: PlanBuilder) -> None:
        """Append the placement. Raises InputError if the place is occupied."""
        scene_object = builder.scene_object(self.name)
        if scene_object.carried:
            raise InputError(f"{self.name} is in the hand: set it down first.")
        T = se3.from_rotation_translation(scene_object.T[:3, :3], (self.x, self.y, 0.0))
        put = replace(scene_object, T=T)
        check_carried(builder.plan_context.session.environment.table, builder.state.objects, put)
        # An object that a later `put` moves is checked at its final place.
        moved = {put.name for put in takewhile(_is_put, builder.ahead) if isinstance(put, Put)}
        for other in builder.state.objects:
            if other.name not in {scene_object.name, *moved} and _overlap(put, other):
                raise InputError(f"{self.name} would stand in {other.name}.")
        builder.note(
            f"put {self.name}", PutObject(put), builder.after(cmd.PlaceObject(put), ticks=1)
        )


def _is_put(step: object) -> bool:
    return isinstance(step, Put)


def _overlap(one: SceneObject, other: SceneObject) -> bool:
    """Return whether two objects on the table overlap, each approximated by a circle."""
    apart = float(np.linalg.norm(one.T[:2, 3] - other.T[:2, 3]))
    return apart < girth(one) + girth(other)


STEPS: dict[str, type[Step]] = {"fill": Fill, "put": Put}
"""Steps of this module, by their names in a script."""
