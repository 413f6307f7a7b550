"""The interface of every arm, real or simulated, to the control loop, and the simulated arm."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from katana450.arm.control.arm import ArmModel, JointSet
from katana450.arm.control.session.stopping import SilenceProfile
from katana450.arm.control.state.arm_report import ArmAct, ArmReport
from katana450.errors import InputError
from katana450.maths.geometry.arrays import FloatArray, frozen


@dataclass(frozen=True, eq=False)
class DriverAnswer:
    """The answer of a driver to a setpoint: where the arm is.

    Attributes:
        q: (n,) joint angles, as measured [rad].
        gripper: the finger joint, as measured [rad].
        report: what else the driver knows; None for an arm that follows its setpoints exactly.
    """

    q: FloatArray
    gripper: float
    report: ArmReport | None = None


class Driver(Protocol):
    """An arm that takes a position setpoint each tick, about 12 a second at rest.

    Only the control loop calls it. No method waits for the arm: a driver of hardware exchanges
    messages in a thread of its own, and puts an arm that does not answer into its report.

    Attributes:
        silence_profile: reaction of the moving arm to silence.
    """

    silence_profile: SilenceProfile

    def start(self, t: float) -> DriverAnswer:
        """Begin to connect to the arm, and return where it is. ``t``: now [s]."""
        ...

    def send(self, q: FloatArray, gripper: float, t: float, stopped: bool = False) -> DriverAnswer:
        """Send a setpoint to the arm, and return where the arm is.

        A driver protects its arm: it raises InputError for a setpoint that is not finite, and clips
        all others to the limits and speeds of the arm.

        Args:
            q: (n,) [rad].
            gripper: the finger joint [rad].
            t: now [s].
            stopped: whether the arm is to come to rest as fast as it can and to stay there. An arm
                that is measured then ignores setpoints; a simulated one follows them, because they
                brake as it can.
        """
        ...

    def perform(self, act: ArmAct, t: float) -> None:
        """Begin an act that a person has asked for; the report tells what becomes of it.

        t: now [s].
        """
        ...

    def freeze(self, t: float) -> None:
        """Stop what the arm does by itself, such as a calibration: somebody has pressed STOP.

        t: now [s].
        """
        ...

    def place(self, q: FloatArray, gripper: float) -> None:
        """Set a simulated arm without a report to a posture of an earlier run, at once.

        q: (n,) [rad or m]. gripper: the finger joint [rad or m].
        """
        ...

    def stop(self) -> None:
        """Disconnect from the arm. May be called twice."""
        ...


class SimulatedDriver:
    """A simulated arm that enforces limits and speeds itself, which reveals faults upstream."""

    silence_profile = SilenceProfile.SIMULATION

    def __init__(self, arm: ArmModel | JointSet, q: FloatArray, gripper: float) -> None:
        """Create an arm at ``q`` (n,) [rad] with its finger joint at ``gripper`` [rad or m].

        Values beyond the limits are clipped.
        """
        self._limits = arm.limits
        self._fingers = arm.gripper
        self._sent = DriverAnswer(self._clamped(q), self._fingers.clamp(gripper))
        self._t: float | None = None

    def start(self, t: float) -> DriverAnswer:
        """Start the clock at ``t`` [s], and return where the arm stands."""
        self._t = t
        return self._sent

    def send(
        self,
        q: FloatArray,
        gripper: float,
        t: float,
        stopped: bool = False,  # noqa: ARG002
    ) -> DriverAnswer:
        """Move towards the setpoint within limits and speeds, and return where the arm is.

        q: (n,) [rad]. gripper: [rad or m]. t: now [s]. stopped: makes no difference. Raises
        InputError before ``start`` and for a setpoint that is not finite.
        """
        if self._t is None:
            raise InputError("The simulated arm is not started: call `start` first.")
        if not (np.isfinite(q).all() and np.isfinite(gripper)):
            raise InputError(f"The setpoint must be finite, not {q}, {gripper}.")
        dt = max(t - self._t, 0.0)
        self._t = max(t, self._t)
        if gripper == self._sent.gripper and (q == self._sent.q).all():
            return self._sent
        step = self._limits.speed * dt
        moved = self._sent.q + np.clip(self._clamped(q) - self._sent.q, -step, step)
        self._sent = DriverAnswer(frozen(moved), self._gripper(gripper, dt))
        return self._sent

    def perform(self, act: ArmAct, t: float) -> None:
        """Do nothing: the session refuses every act at an arm without a report."""

    def freeze(self, t: float) -> None:
        """Do nothing: the arm does nothing by itself."""

    def place(self, q: FloatArray, gripper: float) -> None:
        """Set the arm to ``q`` (n,) and ``gripper`` [rad or m] at once, within its limits."""
        self._sent = DriverAnswer(self._clamped(q), self._fingers.clamp(gripper))

    def stop(self) -> None:
        """End the motion; ``start`` is needed before the next setpoint."""
        self._t = None

    def _clamped(self, q: FloatArray) -> FloatArray:
        return frozen(np.clip(q, self._limits.lower, self._limits.upper))

    def _gripper(self, angle: float, dt: float) -> float:
        fingers = self._fingers
        step = fingers.speed * dt
        goal = fingers.clamp(angle)
        return self._sent.gripper + min(max(goal - self._sent.gripper, -step), step)
