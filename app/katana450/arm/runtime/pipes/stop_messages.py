"""Messages between the arm's process and the process of STOP.

Both ends import this module. It loads nothing heavy, so that the process of STOP starts fast and
stays small.
"""

from __future__ import annotations

from typing import NamedTuple

from katana450.arm.control.lease import Actor
from katana450.arm.control.state.stop_cause import StopCause

STATUS_INTERVAL = 0.14
"""[s] Maximum time between two messages of the arm's process, as long as its control loop ticks."""

NO_STATE = 0.3
"""[s] Silence of the arm's process after which its state counts as unknown."""


class StopPress(NamedTuple):
    """One press of STOP. ``cause``: with the name of the press. ``actor``: the presser."""

    cause: StopCause
    actor: Actor


class StopStatus(NamedTuple):
    """The stop in a state of the arm.

    Attributes:
        stopped: cause of the stop that holds the arm; None if it is not stopped.
        presses: names of the newest presses that the arm's process has executed.
    """

    stopped: StopCause | None
    presses: tuple[str, ...]
