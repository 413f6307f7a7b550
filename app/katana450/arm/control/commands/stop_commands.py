"""Commands that stop the arm and end a stop."""

from __future__ import annotations

import math
from typing import ClassVar

from katana450.arm.control.commands.act import Command, Traits
from katana450.arm.control.state.state import Finding
from katana450.arm.control.state.stop_cause import WATCHDOG, StopCause


class Stop(Command, frozen=True):
    """Come to rest as fast as the arm can, and accept no motion until ClearStop.

    ``finding``: the cause that is shown, where the server stops the arm by itself.
    """

    traits: ClassVar[Traits] = Traits(
        while_stopped=True, protective=True, joints_only=True, safety=True
    )

    cause: StopCause = WATCHDOG
    finding: Finding | None = None
    others: tuple[str, ...] = ()
    """Names of later presses that this stop fulfils, because they came before the same tick."""

    @property
    def presses(self) -> tuple[str, ...]:
        """Names of all presses that this stop fulfils."""
        return tuple(filter(None, (self.cause.press, *self.others)))


class ClearStop(Command, frozen=True):
    """Accept motion again after a stop; nothing moves. See ``stopping`` for its refusal.

    Attributes:
        known: time of the newest STOP that the giver knows [s]; a newer one is not cleared.
        t: time of the tick [s], which the session sets.
    """

    traits: ClassVar[Traits] = Traits(while_stopped=True, joints_only=True)

    known: float = math.inf
    t: float = 0.0
