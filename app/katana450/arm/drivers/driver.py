"""The interface of every arm, real or simulated, to the control loop."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from katana450.arm.control.silence import SilenceProfile
from katana450.maths.geometry.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class SentSetpoint:
    """The setpoint that a driver sent to the arm: ``q`` (n,) [rad] and the finger joint [rad]."""

    q: FloatArray
    gripper: float


class Driver(Protocol):
    """An arm that takes a position setpoint each tick, 20 a second at rest.

    Only the control loop calls it.

    Attributes:
        silence_profile: reaction of the moving arm to silence.
    """

    silence_profile: SilenceProfile

    def start(self, t: float) -> SentSetpoint:
        """Connect to the arm, and return where it stands. ``t``: now [s]."""
        ...

    def send(self, q: FloatArray, gripper: float, t: float) -> SentSetpoint:
        """Send a setpoint to the arm, and return what was sent.

        q: (n,) [rad]. gripper: the finger joint [rad]. t: now [s]. A driver protects its arm: it
        raises InputError for a setpoint that is not finite, and clips all others to the limits and
        speeds of the arm.
        """
        ...

    def stop(self) -> None:
        """Disconnect from the arm. May be called twice."""
        ...
