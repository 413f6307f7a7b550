"""The step that empties the cup into something, planned from where that stands."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from katana450.arm.control.pouring import CUP
from katana450.arm.control.things import Thing
from katana450.errors import InputError
from katana450.extensions.programs import fields as read
from katana450.extensions.programs.bench import Bench
from katana450.extensions.programs.carry import carry
from katana450.extensions.programs.fields import Fields
from katana450.extensions.programs.order import Pace, Wait
from katana450.extensions.programs.setting import Setting
from katana450.extensions.programs.source import Value
from katana450.extensions.programs.step import Step
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.tool import ToolTarget
from katana450.maths.planning.curve import ToolLine

POUR_TURN = math.radians(165.0)
"""About the tool's axis: with the tool tilted at all the cup is past its side then."""

POUR_PACE = 0.3
"""Of the speed, while it is poured: a thin stream keeps together."""

ABOVE_RIM = 0.13
"""[m] The tool over the basin's rim: the cup turns over between them."""

SHAKE = math.radians(25.0)

DRAINED = 1.5
"""[s] Until the last of it has run out."""

POURING = "pour"
"""What the task is called that turns the cup over."""


@dataclass(frozen=True)
class Pour:
    """Carry the cup over a thing, turn it over by the wrist, shake it, and turn it back.

    The cup stays upright until then: the tool keeps the pitch it was taken with.
    """

    into: str
    shake: int

    @classmethod
    def read(cls, value: Value, setting: Setting) -> Self:  # noqa: ARG003
        if value.kind == "text":
            return cls(read.text(value), 3)
        fields = Fields(value, "a pour")
        found = cls(fields.need("into", read.text, ""), fields.take("shake", read.whole(0, 20), 3))
        fields.done()
        return found

    def lay(self, bench: Bench) -> None:
        cup, basin = bench.thing(CUP), bench.thing(self.into)
        if not cup.held:
            raise InputError("The cup is not in the hand: `grasp: cup` first.")
        level = bench.at
        try:
            bench.first((POUR_TURN, -POUR_TURN), lambda turn: self._pour(bench, basin, level, turn))
        except InputError as error:
            raise InputError(f"The cup cannot be emptied into {self.into}: {error}") from error

    def _pour(self, bench: Bench, basin: Thing, level: ToolTarget, turn: float) -> None:
        chain = bench.chain
        # To the nearest that the wrist can turn.
        room = 0.995 * (chain.upper[4] if turn > 0.0 else -chain.lower[4])
        turn = math.copysign(min(abs(turn), room - abs(level.roll)), turn)
        over = bench.point(basin.T[:3, 3] + (0.0, 0.0, basin.height + ABOVE_RIM), in_base=True)
        wanted = over
        for _ in range(3):
            # So that the lip is over the middle while the cup lies on its side.
            at = replace(level, position=wanted)
            side = bench.joints_of(replace(at, roll=level.roll + 0.5 * turn))
            wanted = wanted + (over - _lip(bench, side)) * (1.0, 1.0, 0.0)
        at = replace(level, position=wanted)
        carry(bench, at, f"over {self.into}")
        bench.note("slowly", Pace(POUR_PACE), bench.state)
        down = replace(at, roll=level.roll + turn)
        bench.lead([ToolLine(at, down)], POURING)
        back = replace(at, roll=level.roll + turn - math.copysign(SHAKE, turn))
        if self.shake:
            bench.lead([ToolLine(down, back), ToolLine(back, down)] * self.shake, "shake")
        bench.note("drain", Wait(DRAINED), bench.state)
        bench.note("as fast as may be", Pace(1.0), bench.state)
        bench.lead([ToolLine(down, at)], "turn back")


def _lip(bench: Bench, q: FloatArray) -> FloatArray:
    """(3,) in {S}: the lowest point of the cup's rim with the joints at ``q`` (5,)."""
    session, cup = bench.rig.session, bench.thing(CUP)
    T = session.surroundings.pose(cup, np.append(q, bench.state.gripper_setpoint))
    up = T[:3, 2]
    downhill = -(np.array((0.0, 0.0, 1.0)) - up[2] * up)
    downhill /= np.linalg.norm(downhill)
    rim = T[:3, 3] + cup.height * up + cup.size[0] * downhill
    return bench.point(rim, in_base=True)


STEPS: dict[str, type[Step]] = {"pour": Pour}
"""Steps of this module, by their names in a script."""
