"""An arm that follows its setpoints exactly, as far as its joints are able."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from katana450.arm.control.arm import GripperModel
from katana450.arm.drivers.driver import SentSetpoint
from katana450.errors import InputError
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.motion.limiter import Limits


class JointLimitsSource(Protocol):
    """What it has to know of an arm; any ``Arm`` is one."""

    @property
    def limits(self) -> Limits: ...

    @property
    def gripper(self) -> GripperModel: ...


class SimulatedDriver:
    """Keeps to limits and speeds by itself, so that a fault upstream shows instead of hiding."""

    def __init__(self, arm: JointLimitsSource, q: FloatArray, gripper: float) -> None:
        """The arm stands at ``q`` (n,) [rad] with its finger joint at ``gripper`` [rad or m].

        What is beyond its limits is set to the limit.
        """
        self._limits = arm.limits
        self._fingers = arm.gripper
        self._sent = SentSetpoint(self._clamped(q), self._fingers.clamp(gripper))
        self._t: float | None = None

    def start(self, t: float) -> SentSetpoint:
        self._t = t
        return self._sent

    def send(self, q: FloatArray, gripper: float, t: float) -> SentSetpoint:
        if self._t is None:
            raise InputError("The simulated arm takes no setpoint before it is started.")
        if not (np.isfinite(q).all() and np.isfinite(gripper)):
            raise InputError(f"The arm was sent a setpoint that is not finite: {q}, {gripper}.")
        dt = max(t - self._t, 0.0)
        self._t = max(t, self._t)
        if gripper == self._sent.gripper and (q == self._sent.q).all():
            return self._sent
        step = self._limits.speed * dt
        moved = self._sent.q + np.clip(self._clamped(q) - self._sent.q, -step, step)
        self._sent = SentSetpoint(frozen(moved), self._gripper(gripper, dt))
        return self._sent

    def stop(self) -> None:
        self._t = None

    def _clamped(self, q: FloatArray) -> FloatArray:
        return frozen(np.clip(q, self._limits.lower, self._limits.upper))

    def _gripper(self, angle: float, dt: float) -> float:
        fingers = self._fingers
        step = fingers.speed * dt
        wanted = fingers.clamp(angle)
        return self._sent.gripper + min(max(wanted - self._sent.gripper, -step), step)
