"""The stream of one client's twists or joint rates, which ends when its commands end."""

from __future__ import annotations

import math
from collections.abc import Callable
from enum import Enum

import numpy as np

from katana450.arm.control.joint_commands import JOG_TIME
from katana450.errors import KatanaError
from katana450.extensions.rosbridge.servoing import COMMAND_TIMEOUT, STREAM_GAP
from katana450.maths.geometry.arrays import FloatArray
from katana450.server.api import answers, requests
from katana450.server.service.hub import Hub

LEAD = JOG_TIME
"""[s] Time by which the angles that are sent may lead those of the arm."""


class ServoMotion(Enum):
    """The part that the stream moves."""

    NOTHING = "nothing"
    TOOL = "tool"
    JOINTS = "joints"


class ServoStream:
    """Follows the newest command for COMMAND_TIMEOUT, then brings the arm to rest.

    A stream that continues over a stop or a change of driver stays refused until it has paused for
    STREAM_GAP: the person who steers may not have seen the stop.
    """

    def __init__(self, hub: Hub, ask: Callable[[requests.Request], answers.Answer]) -> None:
        """Create a stream that has not begun. ``ask`` executes a request of the client."""
        self._hub = hub
        self._ask = ask
        self._motion = ServoMotion.NOTHING
        self._last = -math.inf
        self._revocations = 0
        self._rates = np.zeros(0)
        self._q = np.zeros(0)
        self._t = 0.0

    @property
    def moves(self) -> bool:
        """True while a command is being followed."""
        return self._motion is not ServoMotion.NOTHING

    def tool(self, rates: FloatArray) -> None:
        """Move the tool at ``rates``, see ``requests.Jog``. Raises KatanaError if refused."""
        self._received()
        if not rates.any():
            self._end(ServoMotion.TOOL)
            return
        self._begin(ServoMotion.TOOL)
        self._rates = rates
        self._send(requests.Jog(rates=rates, revocations=self._revocations))

    def joints(self, rates: FloatArray) -> None:
        """Move the joints at ``rates`` (n,) [rad/s]. Raises KatanaError if refused."""
        self._received()
        if not rates.any():
            self._end(ServoMotion.JOINTS)
            return
        if self._motion is not ServoMotion.JOINTS:
            self._begin(ServoMotion.JOINTS)
            self._q, self._t = self._hub.present().state.setpoint.copy(), self._hub.clock()
        self._rates = rates
        self._follow()

    def tick(self) -> None:
        """Continue, or end the motion if the newest command is too old.

        Raises KatanaError if the motion is refused, which ends it.
        """
        if not self.moves:
            return
        if self._hub.clock() - self._last > COMMAND_TIMEOUT:
            self._end(self._motion)
        elif self._motion is ServoMotion.JOINTS:
            self._follow()

    def _received(self) -> None:
        """Note that a command was received now."""
        t = self._hub.clock()
        if t - self._last > STREAM_GAP:
            self._revocations = self._hub.gate.revocations
        self._last = t

    def _begin(self, motion: ServoMotion) -> None:
        if self._motion is not motion:
            self._end(self._motion)
        self._motion = motion

    def _follow(self) -> None:
        """Send the angles at which the joints should be now."""
        state, t = self._hub.present().state, self._hub.clock()
        lead = LEAD * np.abs(self._rates)
        q = self._q + self._rates * (t - self._t)
        # The lead stays bounded if the arm is slower or cannot continue.
        self._q, self._t = np.clip(q, state.setpoint - lead, state.setpoint + lead), t
        request = requests.Servo(q=self._q, qd=self._rates, revocations=self._revocations)
        self._send(request)

    def _send(self, request: requests.Request) -> None:
        try:
            self._ask(request)
        except KatanaError:
            self._motion = ServoMotion.NOTHING
            raise

    def _end(self, motion: ServoMotion) -> None:
        """Bring the arm to rest if ``motion`` is what moves it now."""
        if motion is not self._motion or motion is ServoMotion.NOTHING:
            return
        self._motion = ServoMotion.NOTHING
        if motion is ServoMotion.TOOL:
            # Keeps the tool on its line; a hold brakes each joint by itself.
            rest = requests.Jog(np.zeros(len(self._rates)), revocations=self._revocations)
            self._ask(rest)
        else:
            self._ask(requests.Hold(revocations=self._revocations))
