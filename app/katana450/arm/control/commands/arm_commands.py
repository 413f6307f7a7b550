"""Command that operates a real arm itself: its connection, calibration and motors."""

from __future__ import annotations

from typing import ClassVar

from katana450.arm.control.commands.act import Command, Request, Traits
from katana450.arm.control.state.arm_report import ArmAct
from katana450.errors import InputError


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
