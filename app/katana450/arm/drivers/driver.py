"""The interface of every arm, real or simulated, to the control loop."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from katana450.arm.control.session.silence import SilenceProfile
from katana450.arm.control.state.arm_report import ArmAct, ArmReport
from katana450.maths.geometry.arrays import FloatArray


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

    def stop(self) -> None:
        """Disconnect from the arm. May be called twice."""
        ...
