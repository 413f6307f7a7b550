"""Simulation of recorded ticks, and comparison with the states that were recorded.

The rules are a pure function, so the same commands at the same times give the same states, to the
bit, with the same libraries and rounding.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from katana450.arm.control.session import Session
from katana450.arm.control.state import State
from katana450.arm.drivers.driver import DriverAnswer
from katana450.arm.runtime.tick import failed, stepped
from katana450.errors import InputError, KatanaError
from katana450.extensions.recording.digest import Digester
from katana450.extensions.recording.ticks import TickInput
from katana450.maths.geometry.arrays import FloatArray


@dataclass(frozen=True)
class Difference:
    """A tick in which the simulation differs from the recording.

    Attributes:
        t: time of the tick [s].
        size: largest difference of a joint's setpoint [rad or m]; 0 if only others differ.
    """

    t: float
    size: float


@dataclass(frozen=True)
class Verification:
    """The result of a comparison.

    Attributes:
        ticks: number of ticks that were compared.
        different: number of those that differ.
        first: the first difference; None if all are equal.
        largest: the tick with the largest difference of a setpoint; None if all are equal.
        unknown: number of ticks that cannot be simulated, because something before them is missing.
    """

    ticks: int = 0
    different: int = 0
    first: Difference | None = None
    largest: Difference | None = None
    unknown: int = 0

    @property
    def identical(self) -> bool:
        """True if every tick that was compared is the same to the bit."""
        return self.first is None

    def __str__(self) -> str:
        if self.first is None:
            text = f"identical to the bit over {self.ticks} ticks"
        else:
            assert self.largest is not None
            text = (
                f"first difference at t = {self.first.t:.3f} s, {self.first.size:.2g} rad; "
                f"{self.different} of {self.ticks} ticks differ, by up to "
                f"{self.largest.size:.2g} rad"
            )
        missing = f"; {self.unknown} ticks cannot be simulated" if self.unknown else ""
        return text + missing


def after(session: Session, before: State, tick: TickInput) -> State:
    """Return the state after ``tick``, as the control loop finds it.

    Raises InputError for a tick that the rules refuse, which no control loop has recorded.
    """
    commands = [each.command for each in tick.submissions]
    if tick.t_before is not None:
        before = replace(before, t=tick.t_before)
    if tick.failed:
        return failed(before, commands)

    def send(q: FloatArray, gripper: float, _t: float, _stopped: bool) -> DriverAnswer:
        return DriverAnswer(q, gripper) if tick.sent is None else tick.sent

    try:
        return stepped(session, before, commands, tick.t, send)
    except KatanaError as error:
        raise InputError(f"The tick at t = {tick.t:.3f} s was refused: {error}") from error
    except Exception as error:
        # The rules meet only valid states of their own robot, but a file can hold any.
        raise InputError(
            f"The tick at t = {tick.t:.3f} s cannot be simulated "
            f"({type(error).__name__}: {error}). The recording is of another robot, or was changed."
        ) from error


def check_fits(session: Session, state: State) -> None:
    """Raise InputError if ``state`` is of a robot with another number of joints."""
    n = len(session.ready)
    motion = state.motion
    if not math.isfinite(state.t):
        raise InputError(f"The recording is damaged: {state.t} is not the time of a state.")
    for values in (state.q, state.goal, motion.q, motion.qd, motion.qdd):
        if values.shape != (n,) or not np.isfinite(values).all():
            raise InputError(f"The recording is not of this robot, which has {n} joints.")


class Checker:
    """Compares recorded ticks, one after another, with their simulation.

    It begins at the first checkpoint, and after a gap at the next one.
    """

    def __init__(self, session: Session) -> None:
        """Simulate by the rules of ``session``."""
        self._session = session
        self._digester = Digester()
        self._state: State | None = None
        self._setpoint: FloatArray | None = None
        self._differs: float | None = None
        self._ticks = self._different = self._unknown = self._own = 0
        self._first: Difference | None = None
        self._largest: Difference | None = None

    @property
    def state(self) -> State | None:
        """The simulated state; None if it is not known."""
        return self._state

    def checkpoint(self, state: State) -> None:
        """Begin at the recorded ``state`` if the simulation has not begun."""
        if self._state is None:
            check_fits(self._session, state)
            self._finish()
            self._state = state
            # The tick that ended in this state need not be simulated.
            self._unknown -= self._own

    def tick(self, tick: TickInput) -> None:
        """Simulate ``tick`` and compare its digest."""
        self._finish()
        if self._state is None:
            self._unknown += 1
            self._own = 1
            return
        self._state = after(self._session, self._state, tick)
        self._ticks += 1
        if self._digester.digest(self._state) != tick.digest:
            self._differs = tick.t

    def setpoint(self, setpoint: FloatArray) -> None:
        """Take the recorded setpoint (n,) [rad] of the last tick, from which it holds."""
        self._setpoint = setpoint

    def missing(self, ticks: int) -> None:
        """Take note that ``ticks`` are missing, so that the simulation cannot continue."""
        self._finish()
        self._unknown += ticks
        self._own = 0
        self._state = None

    @property
    def result(self) -> Verification:
        """The result so far."""
        self._finish()
        return Verification(self._ticks, self._different, self._first, self._largest, self._unknown)

    def _finish(self) -> None:
        """Note the difference of the last tick, whose setpoint is known by now."""
        if self._differs is None or self._state is None:
            return
        found = Difference(self._differs, self._size(self._state))
        self._differs = None
        self._different += 1
        self._first = found if self._first is None else self._first
        if self._largest is None or found.size > self._largest.size:
            self._largest = found

    def _size(self, state: State) -> float:
        known = self._setpoint
        if known is None or known.shape != state.setpoint.shape:
            return 0.0
        return float(np.abs(state.setpoint - known).max(initial=0.0))
