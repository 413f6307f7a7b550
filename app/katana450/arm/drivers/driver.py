"""What every arm, real or simulated, can do for the control loop."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from katana450.maths.geometry.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class SentSetpoint:
    """What a driver really told the arm: ``q`` (n,) [rad] and the finger joint [rad]."""

    q: FloatArray
    gripper: float


class Driver(Protocol):
    """An arm that takes a position setpoint each tick. Called from the control loop alone."""

    def start(self, t: float) -> SentSetpoint:
        """Connect, and say where the arm stands. ``t``: now [s]."""
        ...

    def send(self, q: FloatArray, gripper: float, t: float) -> SentSetpoint:
        """Pass the setpoint (n,) [rad] and the finger joint [rad] on, and say what was sent.

        A driver never sends what its arm must not be sent: it refuses what is not finite with an
        InputError and cuts the rest to the limits and speeds of its own arm.
        """
        ...

    def stop(self) -> None:
        """Let go of the arm. May be called twice."""
        ...
