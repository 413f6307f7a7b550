"""The modes of every arm behind a connection, and the acts that lead from one to another."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import deque

from katana450.arm.control.state.arm_report import ArmAct, ArmMode
from katana450.arm.drivers.driver import DriverAnswer
from katana450.maths.geometry.arrays import FloatArray

FIRST_NOTE = "No connection. Connect to the arm to read it."


class ArmModes(ABC):
    """The state machine of an arm, without input or output. All times are in s.

    Attributes:
        mode: mode of the arm.
        note: sentence for people about the mode.
        wants_link: whether there is to be a connection.
        acts: acts that wait.
        round_trip: time of the newest exchange [s].
    """

    def __init__(self) -> None:
        """Create it without a connection."""
        self.mode, self.note = ArmMode.DISCONNECTED, FIRST_NOTE
        self.wants_link = self._was_connected = False
        self.acts: deque[ArmAct] = deque()
        self.round_trip = 0.0

    def lost(self, problem: str) -> None:
        """Note that the connection is lost, or that an attempt to connect failed.

        Only an arm that has answered before is connected to again without an act of a person.
        """
        if self._was_connected:
            self.mode = ArmMode.LOST
            self.note = f"{problem} The arm may still move. Trying to connect again."
        elif self.wants_link:
            self.wants_link, self.note = False, problem
        self._clear()

    def perform(self, act: ArmAct) -> None:
        """Begin ``act`` as soon as possible; drop one that is impossible in the present mode."""
        if act not in self.mode.acts:
            return
        if act is ArmAct.CONNECT:
            self.wants_link, self.note = True, "Connecting to the arm."
        elif act is ArmAct.DISCONNECT:
            self.mode, self.note = ArmMode.DISCONNECTED, FIRST_NOTE
            self.wants_link = self._was_connected = False
            self._clear()
        else:
            self.acts.append(act)

    @property
    def moves(self) -> bool:
        """True while a motion is in progress, or a stop waits or is performed."""
        return self.mode is ArmMode.MOVING

    @property
    @abstractmethod
    def version(self) -> tuple[object, ...]:
        """Value that differs if the answer may differ."""

    @abstractmethod
    def answer(self) -> DriverAnswer:
        """Return what the driver reports."""

    @abstractmethod
    def connected(self, address: str) -> None:
        """Note a new connection to the arm at ``address``."""

    @abstractmethod
    def steer(self, joints: FloatArray, t: float, *, stopped: bool) -> None:
        """Take a setpoint (6,) [rad] of time ``t``, or the order to stop the arm."""

    def end_act(self, now: float) -> None:  # noqa: ARG002
        """Drop acts that wait, and end what the arm does by itself: somebody has pressed STOP."""
        self.acts.clear()

    @abstractmethod
    def freeze(self, now: float) -> None:
        """Stop an arm that moves, as at the end of the program."""

    @abstractmethod
    def _clear(self) -> None:
        """Drop all that was to be sent: nothing of it may happen on another connection."""
