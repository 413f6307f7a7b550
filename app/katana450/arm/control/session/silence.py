"""Reaction of a moving arm to silence: a latched stop, or a pause that may become one."""

from __future__ import annotations

from enum import Enum

from katana450.arm.control.commands.commands import HoldFor, PauseFor, Stop
from katana450.arm.control.state.messages import finding_text
from katana450.arm.control.state.state import Finding
from katana450.arm.control.state.stop_cause import StopCause

PAUSE_TIMEOUT = 5.0
"""[s] Silence after which a pause becomes a latched stop."""


class SilenceProfile(Enum):
    """Reaction of a moving arm to a silent driver, a silent process or a late control loop.

    The heartbeat timeout is the same in both. The driver in use chooses the profile.
    """

    REAL_ARM = "real arm"
    """The arm stops, and the stop is latched: somebody may stand beside it."""
    SIMULATION = "simulation"
    """The arm pauses: it brakes and drops its targets, and the next command moves it. A program
    keeps its path if only the page's server was silent. Silence of PAUSE_TIMEOUT latches the stop.
    """

    def braking(
        self, cause: Finding, silence: float, *, resumes: bool = False
    ) -> Stop | HoldFor | PauseFor:
        """Return the command for a moving arm after ``silence`` [s], for the reason ``cause``.

        resumes: whether a program drives that may resume by itself.
        """
        if self is SilenceProfile.REAL_ARM or silence >= PAUSE_TIMEOUT:
            return Stop(StopCause(f"{finding_text(cause)}."), cause)
        return PauseFor(cause) if resumes else HoldFor(cause)
