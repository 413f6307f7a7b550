"""The step that takes a thing between the fingers, planned from where it stands."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from katana450.arm.control import commands as cmd
from katana450.arm.control.things import Thing
from katana450.errors import InputError
from katana450.extensions.programs import fields as read
from katana450.extensions.programs.bench import Bench, GraspInfo
from katana450.extensions.programs.carry import APPROACHES, before
from katana450.extensions.programs.fields import Fields
from katana450.extensions.programs.order import Grip, Use
from katana450.extensions.programs.setting import Setting
from katana450.extensions.programs.source import Value
from katana450.extensions.programs.step import Step
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.planning.curve import ToolLine
from katana450.maths.planning.plan import JOINED, MARGIN

PITCHES = tuple(np.radians((30.0, 35.0, 25.0, 40.0, 20.0, 45.0)).tolist())
"""[rad] Tried in this order when a thing is taken: flatter ones pour better, but the shoulder's
limit keeps a level tool above 110 mm."""

TAKEN_AT = 0.78
"""Of a thing's height: above the middle, where the palm has room over the table."""

SHORTEST, LONGEST_BACK, STEP = 0.0, 0.03, 0.002
"""[m] How far before the thing's axis the tool frame closes: as near as the palm has room."""

ROOM = MARGIN + 5e-4
"""[m] Between the palm and what the fingers close on."""


@dataclass(frozen=True)
class Grasp:
    """Take a thing between the fingers: open, come from the front, close until both touch.

    pitch: [rad], None for the first of PITCHES with which this and what follows can be done.
    height: [m] over the table, None for TAKEN_AT.
    """

    name: str
    pitch: float | None
    height: float | None

    @classmethod
    def read(cls, value: Value, setting: Setting) -> Self:  # noqa: ARG003
        if value.kind == "text":
            return cls(read.text(value), None, None)
        fields = Fields(value, "a grasp")
        found = cls(
            fields.need("thing", read.text, ""),
            fields.take("pitch", read.degrees(0.0, 90.0), None),
            fields.take("height", read.millimetres(1.0, 500.0), None),
        )
        fields.done()
        return found

    def lay(self, bench: Bench) -> None:
        thing = bench.thing(self.name)
        if bench.state.grip is not None:
            raise InputError("The hand holds something already: set it down first.")
        if not thing.can_be_held:
            raise InputError(f"{self.name} is not for the fingers to take.")
        if bench.state.tool != "grasp":
            bench.rig.arm.chain_to("grasp")
            bench.note("tool grasp", Use("grasp"), replace(bench.state, tool="grasp"))
        opened = bench.rig.arm.gripper.upper
        bench.note("open", Grip(opened), bench.after(cmd.SetGripper(opened)))
        free = [pitch for pitch in PITCHES if pitch not in bench.given_up]
        try:
            bench.first(
                free if self.pitch is None else [self.pitch],
                lambda pitch: self._take(bench, thing, pitch),
            )
        except InputError as error:
            raise InputError(f"{self.name} cannot be taken where it stands: {error}") from error

    def _take(self, bench: Bench, thing: Thing, pitch: float) -> None:
        height = TAKEN_AT * thing.height if self.height is None else self.height
        middle = bench.point(thing.T[:3, 3] + (0.0, 0.0, height), in_base=True)
        back, q = _nearest(bench, middle, pitch)
        start = bench.first(APPROACHES, lambda away: _there(bench, middle, pitch, back + away))
        bench.move_to(start, f"grasp {self.name}: before it")
        bench.lead([ToolLine(bench.at, before(middle, pitch, back))], f"grasp {self.name}")
        if float(np.abs(bench.q - q).max()) > JOINED:
            raise InputError("the straight way there ends in another posture.")
        closed = bench.rig.arm.gripper.lower
        held = bench.after(cmd.SetGripper(closed))
        if held.grip is None:
            said = ", ".join(finding.reason.value for finding in held.findings)
            raise InputError(f"the fingers do not hold it ({said or 'they pass it'}).")
        bench.note(f"grasp {self.name}: close", Grip(closed), held)
        bench.taken = GraspInfo(bench.at, pitch if self.pitch is None else None)


def _there(bench: Bench, middle: FloatArray, pitch: float, back: float) -> FloatArray:
    """(5,) the joints with the tool ``back`` [m] before ``middle`` (3,) [rad]."""
    return bench.joints_of(before(middle, pitch, back))


def _nearest(bench: Bench, middle: FloatArray, pitch: float) -> tuple[float, FloatArray]:
    """The least way before ``middle`` with ROOM for the palm, and the joints there."""

    def roomy(back: float) -> tuple[float, FloatArray]:
        q = _there(bench, middle, pitch, back)
        met = None if world is None else world.nearest(np.append(q, fingers))
        if met is not None and met.distance < ROOM:
            one, other = met.parts
            raise InputError(f"{one} and {other} would be {1e3 * met.distance:.1f} mm apart.")
        return back, q

    world, fingers = bench.world, bench.state.gripper_setpoint
    return bench.first(np.arange(SHORTEST, LONGEST_BACK + STEP, STEP).tolist(), roomy)


STEPS: dict[str, type[Step]] = {"grasp": Grasp}
"""Steps of this module, by their names in a script."""
