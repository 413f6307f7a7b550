"""Steps that move no joint: the fingers, a wait, and how the rest is done."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Self

from katana450.arm.control.commands import LEAST_SPEED
from katana450.errors import InputError
from katana450.extensions.programs import fields as read
from katana450.extensions.programs.bench import Bench
from katana450.extensions.programs.order import Grip, Pace, Use, Wait
from katana450.extensions.programs.setting import Setting
from katana450.extensions.programs.source import Value
from katana450.extensions.programs.step import Step

LONGEST_WAIT = 3600.0
"""[s]"""


@dataclass(frozen=True)
class Gripper:
    """Open or close the fingers, or bring them to a place: [deg], or [mm] where they slide."""

    where: float | str

    @classmethod
    def read(cls, value: Value, setting: Setting) -> Self:  # noqa: ARG003
        if value.number is not None:
            return cls(read.number(-180.0, 180.0, "deg or mm")(value))
        return cls(read.choice("open", "closed")(value))

    def lay(self, bench: Bench) -> None:
        fingers = bench.rig.arm.gripper
        if not fingers.moves:
            raise InputError("This arm has no fingers.")
        ends = {"open": fingers.upper, "closed": fingers.lower}
        unit, scale = ("mm", 1e-3) if fingers.slides else ("deg", math.radians(1.0))
        angle = ends[self.where] if isinstance(self.where, str) else scale * self.where
        if not fingers.lower <= angle <= fingers.upper:
            low, high = fingers.lower / scale, fingers.upper / scale
            raise InputError(f"The fingers go from {low:.1f} to {high:.1f} {unit}.")
        held = replace(bench.state, gripper=angle, gripper_setpoint=angle, gripper_goal=angle)
        bench.note("gripper", Grip(angle), held)


@dataclass(frozen=True)
class Pause:
    """Wait for a time [s]."""

    seconds: float

    @classmethod
    def read(cls, value: Value, setting: Setting) -> Self:  # noqa: ARG003
        return cls(read.number(0.01, LONGEST_WAIT, "s")(value))

    def lay(self, bench: Bench) -> None:
        bench.note("wait", Wait(self.seconds), bench.state)


@dataclass(frozen=True)
class Tool:
    """From now on points are of this tool frame."""

    name: str

    @classmethod
    def read(cls, value: Value, setting: Setting) -> Self:  # noqa: ARG003
        return cls(read.text(value))

    def lay(self, bench: Bench) -> None:
        bench.rig.arm.chain_to(self.name)
        bench.note(f"tool {self.name}", Use(self.name), replace(bench.state, tool=self.name))


@dataclass(frozen=True)
class Speed:
    """From now on no faster than this share of the most."""

    value: float

    @classmethod
    def read(cls, value: Value, setting: Setting) -> Self:  # noqa: ARG003
        return cls(read.number(LEAST_SPEED, 1.0)(value))

    def lay(self, bench: Bench) -> None:
        bench.note(f"speed {self.value:g}", Pace(self.value), bench.state)


STEPS: dict[str, type[Step]] = {"gripper": Gripper, "wait": Pause, "tool": Tool, "speed": Speed}
"""Steps of this module, by their names in a script."""
