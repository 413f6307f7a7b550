"""Commands that move the tool by a step, at rates, or to an orientation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from katana450.arm.control.checked import check_finite, vector
from katana450.arm.control.traits import BaseCommand, CommandTraits
from katana450.errors import InputError
from katana450.maths.geometry import so3
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.kinematics.velocity import JogFrame


@dataclass(frozen=True, eq=False)
class StepTool(BaseCommand):
    """Move the target of the tool ``by`` (5,): x, y, z [m] along ``frame``, pitch, roll [rad].

    Arms outside the five-axis family take (6,): x, y, z [m] and a rotation vector [rad], both along
    ``frame``. The step counts from the target, so that several in a row add up. Where the target
    cannot be reached, the nearest pose becomes the target.
    """

    traits: ClassVar[CommandTraits] = CommandTraits(relative=True)

    by: FloatArray
    frame: JogFrame = JogFrame.BASE

    def __post_init__(self) -> None:
        object.__setattr__(self, "by", _tool_numbers("The step", self.by))
        _check_frame("step", self.frame)


@dataclass(frozen=True, eq=False)
class Jog(BaseCommand):
    """Move at ``rates`` (5,) for JOG_TIME: vx, vy, vz [m/s] along ``frame``, pitch, roll [rad/s].

    Arms outside the five-axis family take (6,): the velocity and the three rotations, both along
    ``frame``. A client sends it repeatedly while a key, pad or stick is held. Without another one
    the arm comes to rest.
    """

    traits: ClassVar[CommandTraits] = CommandTraits(while_paused=False)

    rates: FloatArray
    frame: JogFrame = JogFrame.BASE

    def __post_init__(self) -> None:
        object.__setattr__(self, "rates", _tool_numbers("The jog", self.rates))
        _check_frame("jog", self.frame)

    @property
    def sample(self) -> bool:
        """True if it is refused when it arrives late; the end of a jog, without rates, is not."""
        return bool(self.rates.any())


@dataclass(frozen=True)
class TurnTool(BaseCommand):
    """Give the tool of a five-axis arm a pitch and a roll [rad]; its target position stays.

    ``pitch`` is the angle of the tool below the horizontal, theta2 + theta3 + theta4, and ``roll``
    the turn about the tool's own axis, theta5: the two rotations a 5-axis arm is free to choose.
    """

    traits: ClassVar[CommandTraits] = CommandTraits(stream=True)

    pitch: float
    roll: float

    def __post_init__(self) -> None:
        check_finite("The pitch", self.pitch)
        check_finite("The roll", self.roll)


@dataclass(frozen=True, eq=False)
class OrientTool(BaseCommand):
    """Give the tool the rotation ``R`` (3, 3) in {S}; its target position stays.

    For arms outside the five-axis family, whose tool can have every orientation.
    """

    traits: ClassVar[CommandTraits] = CommandTraits(stream=True)

    R: FloatArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "R", frozen(so3.validated(self.R)))


TurnCommand = TurnTool | OrientTool
"""A command that turns the tool; which one depends on the arm."""


def _tool_numbers(what: str, value: object) -> FloatArray:
    numbers = vector(what, value, None)
    if numbers.size not in (5, 6):
        raise InputError(f"{what} must be 5 or 6 numbers, not {numbers.size}.")
    return numbers


def _check_frame(what: str, frame: object) -> None:
    if not isinstance(frame, JogFrame):
        raise InputError(
            f"The frame of a {what} must be JogFrame.BASE or JogFrame.TOOL, not {frame!r}."
        )
