"""What the front door itself asks of the arm: stop, hold, jog. Everything else comes by viser."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from app.control import commands as cmd
from app.control.arm import Arm
from app.control.state import State
from app.errors import InputError
from app.kinematics.forward import forward
from app.kinematics.freedoms import pitched_frame
from app.kinematics.velocity import JogFrame, jog
from app.runtime.loop import ControlLoop
from app.runtime.mailbox import Mailbox

LONGEST_STEP = 0.1
"""[s] A jog reaches no further than it goes in this time: without another the arm stands."""

Rates = tuple[float, float, float, float, float]
"""Velocity of the tool point (x, y, z) [m/s], rates of pitch and roll [rad/s]."""


class Motion:
    """The arm as the gateway sees it."""

    def __init__(
        self, arm: Arm, loop: ControlLoop, mailbox: Mailbox, let_go: Callable[[], None]
    ) -> None:
        """``let_go`` takes the handles of the view out of every hand."""
        self._arm = arm
        self._loop = loop
        self._mailbox = mailbox
        self._let_go = let_go

    @property
    def state(self) -> State:
        """The newest."""
        return self._loop.snapshot.state

    def hold(self) -> None:
        """Stop here and forget every target; no hand holds a handle any more."""
        self._let_go()
        self._mailbox.put(cmd.Reset())

    def jog(self, rates: Rates, frame: JogFrame, dt: float) -> None:
        """Go with these rates for ``dt`` [s]."""
        state = self.state
        chain = self._arm.chain_to(state.tool)
        R = forward(chain, state.goal)[:3, :3]
        pitched = R.T @ pitched_frame(chain, state.goal)
        v = np.array(rates[:3])
        omega = pitched[:, 1] * rates[3] + pitched[:, 0] * rates[4]
        V = np.concatenate((omega, v if frame is JogFrame.TOOL else R.T @ v))
        dt = min(dt, LONGEST_STEP)
        qd = jog(chain, state.goal, V, JogFrame.TOOL, dt)
        try:
            self._mailbox.put(cmd.SetJoints(state.goal + qd * dt))
        except InputError:
            # The mailbox is full: the arm stands, which is what a jog without successor means.
            return
