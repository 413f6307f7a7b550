"""Steps that move the joints, whatever way the tool takes meanwhile."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from katana450.arm.control import commands as cmd
from katana450.extensions.programs import fields as read
from katana450.extensions.programs import places
from katana450.extensions.programs.bench import Bench, Place
from katana450.extensions.programs.fields import Fields
from katana450.extensions.programs.setting import Setting
from katana450.extensions.programs.source import Value
from katana450.extensions.programs.step import Step, nothing
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.planning.joint_path import JointPath

MOST_VIAS = 50


@dataclass(frozen=True)
class Move:
    """Go there freely, round what is in the way."""

    place: Place

    @classmethod
    def read(cls, value: Value, setting: Setting) -> Self:
        return cls(places.place(value, setting))

    def lay(self, bench: Bench) -> None:
        bench.move_to(bench.joints_at(self.place), "move")


@dataclass(frozen=True)
class Joints:
    """The same to joint angles."""

    q: FloatArray

    @classmethod
    def read(cls, value: Value, setting: Setting) -> Self:  # noqa: ARG003
        return cls(places.joints(value))

    def lay(self, bench: Bench) -> None:
        bench.move_to(bench.joints_at(Place(joints=self.q)), "joints")


@dataclass(frozen=True)
class Nudge:
    """Drive one joint on by a relative angle."""

    axis: int
    by: float

    @classmethod
    def read(cls, value: Value, setting: Setting) -> Self:  # noqa: ARG003
        fields = Fields(value, "a nudge")
        axis = fields.need("axis", read.whole(1, 5), 1)
        found = cls(axis - 1, fields.need("by", read.degrees(-720.0, 720.0), 0.0))
        fields.done()
        return found

    def lay(self, bench: Bench) -> None:
        q = cmd.Nudge(self.axis, self.by).targets(bench.q)
        bench.move_to(bench.joints_at(Place(joints=q)), "nudge")


@dataclass(frozen=True)
class Home:
    """The same to the ready posture."""

    @classmethod
    def read(cls, value: Value, setting: Setting) -> Self:  # noqa: ARG003
        nothing(value, "home")
        return cls()

    def lay(self, bench: Bench) -> None:
        bench.move_to(bench.rig.ready, "home")


@dataclass(frozen=True)
class Via:
    """Through places one after another without a rest, their corners rounded."""

    through: tuple[Place, ...]
    blend: float

    @classmethod
    def read(cls, value: Value, setting: Setting) -> Self:
        fields = Fields(value, "a via")
        found = cls(*through(fields, setting))
        fields.done()
        return found

    def lay(self, bench: Bench) -> None:
        vias = [bench.q]
        at = bench.state
        for each in self.through:
            vias.append(bench.joints_at(each))
            bench.state = bench.standing(vias[-1])
        bench.state = at
        blend = np.full(len(vias) - 2, self.blend)
        bench.follow([JointPath(bench.chain, np.array(vias), blend)], "via")


def through(fields: Fields, setting: Setting) -> tuple[tuple[Place, ...], float]:
    """The places on the way, and how much of half a leg a corner cuts off."""
    each = read.listed(lambda item: places.place(item, setting), 2, MOST_VIAS)
    found: tuple[Place, ...] = fields.need("through", each, ())
    return found, fields.take("blend", read.number(0.01, 1.0), 0.5)


STEPS: dict[str, type[Step]] = {
    "move": Move,
    "joints": Joints,
    "nudge": Nudge,
    "home": Home,
    "via": Via,
}
"""Steps of this module, by their names in a script."""
