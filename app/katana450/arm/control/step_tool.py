"""The command that moves the target of the tool by one step."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from katana450.arm.control.checked import vector
from katana450.arm.control.traits import BaseCommand, CommandTraits
from katana450.errors import InputError
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.velocity import JogFrame


@dataclass(frozen=True, eq=False)
class StepTool(BaseCommand):
    """Move the target of the tool ``by`` (5,): x, y, z [m] along ``frame``, pitch, roll [rad].

    The step counts from the target, so that several in a row add up. Where the target cannot be
    reached, the nearest pose becomes the target.
    """

    traits: ClassVar[CommandTraits] = CommandTraits()

    by: FloatArray
    frame: JogFrame = JogFrame.BASE

    def __post_init__(self) -> None:
        object.__setattr__(self, "by", vector("The step", self.by, 5))
        if not isinstance(self.frame, JogFrame):
            raise InputError(
                f"The frame of a step must be JogFrame.BASE or JogFrame.TOOL, not {self.frame!r}."
            )
