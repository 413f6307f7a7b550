"""Steps that lay the table: where things stand, and how much water is in the cup."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import takewhile
from typing import Self

import numpy as np

from katana450.arm.control import commands as cmd
from katana450.arm.control.placement import girth
from katana450.arm.control.support import check_carried
from katana450.arm.control.things import Thing
from katana450.errors import InputError
from katana450.extensions.programs import fields as read
from katana450.extensions.programs.bench import Bench
from katana450.extensions.programs.fields import Fields
from katana450.extensions.programs.order import Filling, Putting
from katana450.extensions.programs.setting import Setting
from katana450.extensions.programs.source import Value
from katana450.extensions.programs.step import Step
from katana450.maths.geometry import se3
from katana450.maths.water.units import ML


@dataclass(frozen=True)
class Fill:
    """Fill the cup with water [m^3]."""

    volume: float

    @classmethod
    def read(cls, value: Value, setting: Setting) -> Self:  # noqa: ARG003
        return cls(ML * read.number(0.0, 1000.0, "ml")(value))

    def lay(self, bench: Bench) -> None:
        command = cmd.Fill(self.volume)
        bench.rig.session.check(command)
        bench.note("fill", Filling(self.volume), bench.after(command, ticks=1))


@dataclass(frozen=True)
class Put:
    """Have a thing stand elsewhere on the table, x, y [m] in the base frame; nothing carries it.

    Several in a row are one arrangement: what only passes through the old place of something that
    is itself put elsewhere is in nobody's way.
    """

    name: str
    x: float
    y: float

    @classmethod
    def read(cls, value: Value, setting: Setting) -> Self:  # noqa: ARG003
        fields = Fields(value, "a put")
        found = cls(
            fields.need("thing", read.text, ""),
            fields.need("x", read.millimetres(), 0.0),
            fields.need("y", read.millimetres(), 0.0),
        )
        fields.done()
        return found

    def lay(self, bench: Bench) -> None:
        thing = bench.thing(self.name)
        if thing.carried:
            raise InputError(f"{self.name} is in the hand: set it down first.")
        T = se3.from_rotation_translation(thing.T[:3, :3], (self.x, self.y, 0.0))
        put = replace(thing, T=T)
        check_carried(bench.rig.session.surroundings.table, bench.state.things, put)
        # Each of them is looked at when it comes to where it stays.
        moved = {put.name for put in takewhile(_is_put, bench.ahead) if isinstance(put, Put)}
        for other in bench.state.things:
            if other.name not in {thing.name, *moved} and _overlap(put, other):
                raise InputError(f"{self.name} would stand in {other.name}.")
        bench.note(f"put {self.name}", Putting(put), bench.after(cmd.Place(put), ticks=1))


def _is_put(step: object) -> bool:
    return isinstance(step, Put)


def _overlap(one: Thing, other: Thing) -> bool:
    """Whether two things on the table are in each other, taken for round."""
    apart = float(np.linalg.norm(one.T[:2, 3] - other.T[:2, 3]))
    return apart < girth(one) + girth(other)


STEPS: dict[str, type[Step]] = {"fill": Fill, "put": Put}
"""Steps of this module, by their names in a script."""
