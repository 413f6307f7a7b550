"""Acts of a person at a real arm, and the report of its driver: mode, measured and due joints."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum

from katana450.maths.geometry.arrays import FloatArray


class ArmAct(Enum):
    """Act of a person at a real arm."""

    CONNECT = "connect"
    """Connect to the arm, and only read it."""
    DISCONNECT = "disconnect"
    """End the connection."""
    CALIBRATE = "calibrate"
    """Let the arm find its joint angles: it moves by itself to its mechanical stops."""
    ENGAGE = "engage"
    """Let the motors hold the arm where it is. It must be calibrated since it was switched on."""
    RELEASE = "release"
    """Switch the motors off: the arm falls."""
    UNBLOCK = "unblock"
    """Let the arm hold again after a collision or an error."""

    @property
    def hazard(self) -> str:
        """The hazard that a person must confirm before this act; empty if there is none."""
        return HAZARDS.get(self, "")


HAZARDS = {
    ArmAct.CALIBRATE: "The arm moves by itself to its mechanical stops, for about 30 s, and may "
    "not obey STOP meanwhile. Clear the space around it, and keep a hand on its switch.",
    ArmAct.ENGAGE: "The joint angles are right only if the arm was calibrated since it was "
    "switched on.",
    ArmAct.RELEASE: "Motors off means the arm falls. Hold it by hand.",
}


class ArmMode(Enum):
    """Mode of an arm that a driver connects to. Each step towards HOLDING is an act of a person."""

    DISCONNECTED = "disconnected"
    """There is no connection."""
    CONNECTED = "connected"
    """The arm answers, and is only read."""
    UNCALIBRATED = "uncalibrated"
    """The joint angles are not known until the arm is calibrated."""
    CALIBRATING = "calibrating"
    """The arm moves by itself to its mechanical stops."""
    HOLDING = "holding"
    """The motors hold the arm, which follows setpoints."""
    MOVING = "moving"
    """The arm moves to its setpoints, or brakes."""
    COLLIDED = "collided"
    """The arm has stopped an axis at a collision."""
    FAULT = "fault"
    """The arm has reported an error, or its motors are off."""
    LOST = "lost"
    """The arm no longer answers. It may still move."""

    @property
    def follows(self) -> bool:
        """True if the arm follows its setpoints."""
        return self in (ArmMode.HOLDING, ArmMode.MOVING)

    @property
    def acts(self) -> tuple[ArmAct, ...]:
        """The acts that are possible in this mode."""
        return ACTS.get(self, ())


ACTS: Mapping[ArmMode, tuple[ArmAct, ...]] = {
    ArmMode.DISCONNECTED: (ArmAct.CONNECT,),
    ArmMode.CONNECTED: (ArmAct.ENGAGE, ArmAct.CALIBRATE, ArmAct.DISCONNECT),
    ArmMode.UNCALIBRATED: (ArmAct.CALIBRATE, ArmAct.ENGAGE, ArmAct.RELEASE, ArmAct.DISCONNECT),
    ArmMode.HOLDING: (ArmAct.CALIBRATE, ArmAct.RELEASE, ArmAct.DISCONNECT),
    ArmMode.COLLIDED: (ArmAct.UNBLOCK, ArmAct.RELEASE, ArmAct.DISCONNECT),
    ArmMode.FAULT: (ArmAct.UNBLOCK, ArmAct.RELEASE, ArmAct.DISCONNECT),
    ArmMode.LOST: (ArmAct.CONNECT, ArmAct.DISCONNECT),
}
"""The acts that are possible in each mode. An arm that moves must be stopped first."""


@dataclass(frozen=True)
class MeasuredStop:
    """A stop as the arm performed it.

    Attributes:
        time: time from the request to rest [s].
        angle: maximum angle by which a joint moved meanwhile [rad].
        distance: distance by which the tool moved meanwhile [m]; None if the driver does not know.
    """

    time: float
    angle: float
    distance: float | None = None


@dataclass(frozen=True, eq=False)
class ArmReport:
    """Report of a driver on an arm that it measures.

    Attributes:
        mode: the mode of the arm.
        t: time of the measurement [s], on the clock of the control loop.
        expected: (n + 1,) joints and finger joint at which the arm should have been at that time
            [rad]. A driver sends setpoints ahead of their time, so these are older than the
            present setpoint.
        speeds: (n + 1,) measured speeds [rad/s]; None if they are not measured.
        note: sentence for people about the mode; empty if there is nothing to say.
        round_trip: time of the newest exchange with the arm [s].
        sensors: raw values of the sensors of the arm; empty without sensors.
        measured_stop: the newest stop; None if there was none.
    """

    mode: ArmMode
    t: float
    expected: FloatArray
    speeds: FloatArray | None = None
    note: str = ""
    round_trip: float = 0.0
    sensors: tuple[float, ...] = ()
    measured_stop: MeasuredStop | None = None
