"""What the front door itself asks of the arm: stop, hold, jog. Everything else comes by viser."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from app.control import commands as cmd
from app.control.ledger import Entry
from app.control.state import State
from app.errors import InputError
from app.kinematics.velocity import JogFrame
from app.runtime.loop import ControlLoop
from app.runtime.mailbox import Mailbox

Rates = tuple[float, float, float, float, float]
"""Velocity of the tool point (x, y, z) [m/s], rates of pitch and roll [rad/s]."""


class Motion:
    """The arm as the gateway sees it."""

    def __init__(self, loop: ControlLoop, mailbox: Mailbox, let_go: Callable[[], None]) -> None:
        """``let_go`` takes the handles of the view out of every hand."""
        self._loop = loop
        self._mailbox = mailbox
        self._let_go = let_go

    @property
    def state(self) -> State:
        """The newest."""
        return self._loop.snapshot.state

    @property
    def ledger(self) -> tuple[Entry, ...]:
        """What held it back of late, oldest first."""
        return self._loop.ledger

    def stop(self) -> None:
        """Rest as fast as the arm can; it obeys nothing until it is released."""
        self._mailbox.put(cmd.Stop())
        self._let_go()

    def release(self) -> None:
        """After a stop: obey again. Nothing moves by this."""
        self._mailbox.put(cmd.Release())

    def hold(self) -> None:
        """Come to rest and forget every target; no hand holds a handle any more."""
        self._let_go()
        self._put(cmd.Reset())

    def jog(self, rates: Rates, frame: JogFrame) -> None:
        """Go with these rates for a moment."""
        self._put(cmd.Jog(np.array(rates), frame))

    def limit(self, share: float) -> None:
        """No motion is faster than this share of the most."""
        self._put(cmd.SpeedScale(share))

    def _put(self, command: cmd.Command) -> None:
        try:
            self._mailbox.put(command)
        except InputError:
            # The mailbox is full: what is asked again and again is, and a stop always has room.
            return
