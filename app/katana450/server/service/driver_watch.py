"""The watch over a silent driver: a latched stop, or a pause that becomes one."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from katana450.arm.control.lease import Person
from katana450.arm.control.session.stopping import PAUSE_TIMEOUT, SilenceProfile
from katana450.arm.control.state.state import Finding, Reason
from katana450.server.service.command_gate import CommandGate

BUSY_LATENESS = 0.1
"""[s] Lateness of the server from which silence is not blamed on the driver or the connection."""

BUSY_WINDOW = 1.0
"""[s] Time in which a lateness counts."""


class _Pause(NamedTuple):
    """A pause: the silent driver, and the time of its last message [s]."""

    driver: Person
    since: float


class DriverWatch:
    """Brakes a moving arm whose driver is silent. Times are in seconds."""

    def __init__(self, gate: CommandGate, t: float) -> None:
        """Watch the arm of ``gate`` from the time ``t``."""
        self._gate = gate
        self._pause: _Pause | None = None
        self._late, self._late_at = 0.0, t

    def note_lateness(self, late: float, t: float) -> None:
        """Note that the server's thread is ``late`` at the time ``t``."""
        if late > self._late or t - self._late_at > BUSY_WINDOW:
            self._late, self._late_at = late, t

    def brake(self, driver: Person, silence: float, t: float, *, connected: bool) -> None:
        """Brake the moving arm of ``driver``, who has been silent for ``silence`` at ``t``.

        ``connected``: whether the driver still has a connection.
        """
        gate = self._gate
        if self._pause is not None:
            return
        busy = self._late > BUSY_LATENESS
        if gate.present().profile is SilenceProfile.SIMULATION:
            self._pause = _Pause(driver, t - silence)
            silent = Finding(Reason.DRIVER_SILENT, silence)
            gate.pause(Finding(Reason.MACHINE_BUSY, self._late) if busy else silent)
        elif busy:
            gate.protect(
                f"No message of {driver.name} arrived for {silence:.2f} s while the arm moved. "
                f"This machine is too busy: its server was {self._late:.2f} s late."
            )
        else:
            why = "fell silent" if connected else "lost the connection"
            gate.protect(f"{driver.name} {why} while the arm moved.")

    def brake_left(self, driver: Person) -> None:
        """Brake the moving arm of ``driver``, whose window was closed."""
        if self._gate.present().profile is SilenceProfile.SIMULATION:
            self._gate.pause(Finding(Reason.DRIVER_LEFT))
        else:
            self._gate.protect(f"{driver.name} closed the window while the arm moved.")

    def follow(self, holder: Person | None, heard: Callable[[Person], float], t: float) -> None:
        """End the pause when the driver is back, or latch the stop after PAUSE_TIMEOUT.

        ``holder``: the present holder of the lease. ``heard``: returns the time of the newest
        message of a person.
        """
        pause = self._pause
        if pause is None:
            return
        if self._gate.stopped is not None or holder not in (None, pause.driver):
            self._pause = None
        elif heard(pause.driver) > pause.since:
            self._pause = None
            self._gate.settle()
        elif t - pause.since >= PAUSE_TIMEOUT:
            self._pause = None
            self._gate.protect(f"{pause.driver.name} was silent for {PAUSE_TIMEOUT:g} s.")
        elif holder == pause.driver:
            # Gestures in the scene are no heartbeats, so they could move the arm unwatched.
            self._gate.refuse_motion()
