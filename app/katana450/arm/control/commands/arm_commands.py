"""Command that operates a real arm itself: its connection, calibration and motors."""

from __future__ import annotations

from enum import Enum
from typing import ClassVar

from katana450.arm.control.commands.act import Command, Request, Traits
from katana450.errors import InputError


class ArmAct(Enum):
    """Act of a person at a real arm."""

    CONNECT = "connect"
    """Connect to the arm, and only read it."""
    DISCONNECT = "disconnect"
    """End the connection."""
    CALIBRATE = "calibrate"
    """Let the arm find its joint angles: it moves by itself to its mechanical stops."""
    ENGAGE = "engage"
    """Let the motors hold the arm where it is. It must be calibrated since it was switched on."""
    RELEASE = "release"
    """Switch the motors off: the arm falls."""
    UNBLOCK = "unblock"
    """Let the arm hold again after a collision or an error."""

    @property
    def hazard(self) -> str:
        """The hazard that a person must confirm before this act; empty if there is none."""
        return HAZARDS.get(self, "")


HAZARDS = {
    ArmAct.CALIBRATE: "The arm moves by itself to its mechanical stops, for about 30 s, and may "
    "not obey STOP meanwhile. Clear the space around it, and keep a hand on its switch.",
    ArmAct.ENGAGE: "The joint angles are right only if the arm was calibrated since it was "
    "switched on.",
    ArmAct.RELEASE: "Motors off means the arm falls. Hold it by hand.",
}


class OperateArm(Command, Request, frozen=True):
    """Connect, calibrate or switch the motors of a real arm. It must be stopped and at rest.

    The state lists the acts that are possible; its ``arm.mode`` tells what becomes of an act.

    Attributes:
        act: connect; disconnect; calibrate: the arm moves to its mechanical stops; engage: the
            motors hold the arm, which was calibrated before; release: motors off, the arm falls;
            unblock: hold again after a collision or an error.
        confirmed: Whether a person has confirmed the hazard. Without it, an act that has one is
            refused with the text of the hazard.
    """

    traits: ClassVar[Traits] = Traits(while_stopped=True, joints_only=True)

    act: ArmAct
    confirmed: bool = False

    def __post_init__(self) -> None:
        if self.act.hazard and not self.confirmed:
            raise InputError(f"{self.act.hazard} Confirm this, and give the command again.")
