"""The modes of an arm of bus servos: readings, setpoints and acts in, goals and the report out.

It knows no connection, clock or thread: the driver performs the exchanges and names the times.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Collection
from typing import NamedTuple

import numpy as np

from katana450.arm.control.state.arm_report import ArmAct, ArmMode, ArmReport, MeasuredStop
from katana450.arm.drivers.driver import DriverAnswer
from katana450.extensions.motor_bus.calibration import MOTORS
from katana450.extensions.real_arm.arm_modes import ArmModes
from katana450.extensions.real_arm.servo.joints import ServoJoints
from katana450.extensions.real_arm.tool_travel import Travel
from katana450.maths.geometry.arrays import FloatArray, IntArray, frozen

JAW = len(MOTORS) - 1

MAX_SPEED = 6.0
"""[rad/s] Speed of the goals; a motor without load turns at 5 rad/s."""

RETURN_SPEED = 0.1
"""[rad/s] Speed at which an arm that began beyond its limits is led back."""

MAX_STEP_TIME = 0.05
"""[s] Time between two setpoints for which the goals move at most."""

LAG = 0.06
"""[s] Time by which a motor is behind its goal. Assumed, not measured."""

SAG = np.radians(4.0)
"""[rad] Angle by which a motor without integral part may stay beside its goal under a load."""

STILL = 0.05
"""[rad/s] Speed of a joint at rest."""

REST_TIME = 0.5
"""[s] Time after the last change of the setpoint after which an arm may rest at it."""

STALL_LOAD, STALL_TIME = 0.9, 0.5
"""Fraction of the torque, and the time [s], after which a joint that does not move is blocked."""

SILENT_TIME = 0.3
"""[s] Time after which a motor that does not answer counts as lost."""

LAST_WRITES = 3
"""Times that the goals of a fault are sent: the motors do not confirm them."""

MAX_ASTRAY = np.radians(17.0)
"""[rad] Distance of a joint beyond its limits that no correct calibration gives."""


ERRORS = {
    "overload": "is overloaded and has reduced its force. Take the load off",
    "heat": "is too hot. Support the arm, release it and let it cool",
    "voltage": "has too low or too high a voltage. Check the power supply",
    "current": "takes too much current. Take the load off",
    "shock": "reports an electric shock or too little power. Check power supply and cables",
    "sensor": "reports a fault of its sensor. Support the arm and release it",
}
"""Ends of sentences about the errors of a motor."""


class Readings(NamedTuple):
    """One reading of all motors: ticks, ticks/s, fractions of the torque, V, degrees C: (6,) each.

    t: time of the reading [s].
    errors: the bits of the errors of the motors.
    """

    t: float
    ticks: IntArray
    speeds: FloatArray
    loads: FloatArray
    volts: FloatArray
    celsius: FloatArray
    errors: tuple[int, ...]


class ServoMachine(ArmModes):
    """State machine of one arm.

    Attributes:
        hurries: whether the goals are those of a stop that has not been sent.
    """

    def __init__(self, joints: ServoJoints, start: FloatArray, travel: Travel | None) -> None:
        """Create it without a connection; ``start`` (6,) [rad] is reported before it is read."""
        super().__init__()
        self.hurries = False
        self._joints, self._travel = joints, travel
        self._q, self._speeds, self._t = frozen(start), frozen(np.zeros(len(MOTORS))), 0.0
        self._place = self._q
        self._sensors: tuple[float, ...] = ()
        self._goal = self._sag = np.zeros(len(MOTORS))
        self._writes, self._apart = 0.0, frozenset[int]()
        self._setpoints: deque[tuple[float, FloatArray]] = deque(maxlen=100)
        self._stopped, self._steered, self._changed = True, 0.0, 0.0
        self._heard = dict.fromkeys(joints.ids, np.inf)
        self._stalled = np.full(len(MOTORS), np.inf)
        self._stopping: tuple[float, FloatArray] | None = None
        self._measured_stop: MeasuredStop | None = None

    @property
    def moves(self) -> bool:
        """True while the arm moves, or a stop waits."""
        return super().moves or self.hurries

    @property
    def version(self) -> tuple[object, ...]:
        """Mode, note and time of the newest reading."""
        return self.mode, self.note, self._t, self._measured_stop

    def answer(self) -> DriverAnswer:
        """Return what the driver reports; the sensors are loads, voltages and temperatures."""
        expected = self._q
        if self.mode.follows and not self._stopped and self._setpoints:
            older = [joints for t, joints in self._setpoints if t <= self._t - LAG]
            lagged = older[-1] if older else self._setpoints[0][1]
            expected = frozen(lagged + np.clip(self._q - lagged, -SAG, SAG))
        report = ArmReport(
            self.mode,
            self._t,
            expected,
            self._speeds,
            self.note,
            self.round_trip,
            self._sensors,
            self._measured_stop,
        )
        return DriverAnswer(frozen(self._q[:JAW]), float(self._q[JAW]), report)

    def connected(self, address: str) -> None:
        """Note that the arm at ``address`` is the one of the calibration."""
        again = " again" if self._was_connected else ""
        self._clear()
        self._was_connected, self.mode = True, ArmMode.CONNECTED
        self.note = f"Connected{again} to {address}. Engage lets the motors hold the arm."

    def perform(self, act: ArmAct) -> None:
        """Begin ``act`` as soon as possible; drop one that is impossible in the present mode."""
        if act is ArmAct.CALIBRATE:
            self.note = "This arm is calibrated by `lerobot-calibrate`, while it is not served."
        else:
            super().perform(act)

    def freeze(self, now: float) -> None:
        """Stop an arm that moves, as at the end of the program."""
        self._stopped = True
        if self.mode.follows:
            self._hold(now)

    def steer(self, joints: FloatArray, t: float, *, stopped: bool) -> None:
        """Take a setpoint (6,) [rad] of time ``t`` [s], or the order to stop the arm."""
        if stopped and not self._stopped and self.mode.follows:
            self._hold(t)
        elif not stopped and self.mode.follows:
            if self._stopped:
                # The arm hangs below its goals, and would sink again without this.
                self._sag = self._goal - self._q
                self._sag[JAW] = 0.0
            dt = min(max(t - self._steered, 0.0), MAX_STEP_TIME)
            reach, back = MAX_SPEED * dt, RETURN_SPEED * dt
            more = self._sag - np.clip(self._sag, -SAG, SAG)
            self._sag = self._sag - np.clip(more, -back, back)
            self._goal = self._goal + np.clip(joints + self._sag - self._goal, -reach, reach)
            if not self._setpoints or (joints != self._setpoints[-1][1]).any():
                self._changed = t
            self._setpoints.append((t, joints))
        self._stopped, self._steered = stopped, t

    def goals(self) -> dict[int, int]:
        """Return the goals to send, by the ids of the motors; empty if there are none."""
        if self._writes <= 0.0:
            return {}
        self._writes, self.hurries = self._writes - 1.0, False
        ids, ticks = self._joints.ids, self._joints.ticks(self._goal).tolist()
        return {
            motor: goal for motor, goal in zip(ids, ticks, strict=True) if motor not in self._apart
        }

    def engaged(self, now: float, ticks: IntArray) -> None:
        """Note that the motors hold the arm at ``ticks`` (6,)."""
        self.mode, self.note = ArmMode.HOLDING, ""
        self._apart, self._writes, self._stopped = frozenset(), np.inf, True
        self._place = self._joints.joints(ticks)
        self._goal, self.hurries = self._place, False
        self._heard = dict.fromkeys(self._heard, now)
        self._stalled[:] = np.inf
        self._stopping = self._measured_stop = None

    def released(self) -> None:
        """Note that the motors are off."""
        self._clear()
        self.mode, self.note = ArmMode.CONNECTED, "The motors are off."

    def fail(self, note: str, apart: Collection[int] = (), mode: ArmMode = ArmMode.FAULT) -> None:
        """Hold the arm where it is, but for the motors ``apart``, and report ``note``."""
        if self.mode.follows:
            self._hold(self._t, rests=False)
            self._writes, self._apart = LAST_WRITES, frozenset(apart)
            self.mode = mode
        self.note = note

    def measured(self, readings: Readings) -> None:
        """Take a reading of all motors."""
        joints = self._joints.joints(readings.ticks)
        # The goals are where the arm is, also beyond a limit, to which it would jump.
        self._place = joints
        self._q = frozen(np.clip(joints, self._joints.lower, self._joints.upper))
        self._speeds = frozen(readings.speeds * self._joints.scale)
        self._t = readings.t
        self._heard = dict.fromkeys(self._heard, readings.t)
        values = np.concatenate((readings.loads, readings.volts, readings.celsius))
        self._sensors = tuple(values.round(3).tolist())
        self._supervise(readings, np.abs(joints - self._q))

    def silent(self, motors: Collection[int], now: float) -> None:
        """Note that ``motors`` did not answer, and the others did."""
        for motor in self._heard.keys() - set(motors):
            self._heard[motor] = now
        lost = [motor for motor in motors if now - self._heard[motor] > SILENT_TIME]
        if lost and self.mode is not ArmMode.FAULT:
            names = " and ".join(self.name(motor) for motor in lost)
            self.fail(f"No answer of {names}. Support the arm and check its cables.", lost)

    def name(self, motor: int) -> str:
        """Return the name of the motor with the id ``motor``, with the id."""
        return f"{MOTORS[self._joints.ids.index(motor)]} (id {motor})"

    def _supervise(self, readings: Readings, beyond: FloatArray) -> None:
        """Compare a reading with the mode. ``beyond`` (6,): angles beyond the limits [rad]."""
        for number, errors in enumerate(readings.errors):
            names = self._joints.arm.make.error_names(errors)
            if names and self.mode is not ArmMode.FAULT:
                values = f"{readings.volts[number]:.1f} V, {readings.celsius[number]:.0f} °C"
                self.fail(f"{self.name(self._joints.ids[number])} {ERRORS[names[0]]} ({values}).")
        if self.mode is ArmMode.CONNECTED and beyond[:JAW].max() > MAX_ASTRAY:
            name = MOTORS[int(beyond[:JAW].argmax())]
            self.note = f"{name} is beyond its limit: calibrate the arm by `lerobot-calibrate`."
        if not self.mode.follows:
            return
        still = np.abs(self._speeds) < STILL
        self.mode = ArmMode.HOLDING if still.all() else ArmMode.MOVING
        if self._stopping is not None and still.all():
            t, start = self._stopping
            distance = None if self._travel is None else self._travel(start, self._q)
            angle = float(np.abs(self._q - start)[:JAW].max())
            self._stopping, self._measured_stop = None, MeasuredStop(self._t - t, angle, distance)
        presses = still & (np.abs(readings.loads) >= STALL_LOAD)
        self._stalled = np.where(presses, np.minimum(self._stalled, self._t), np.inf)
        blocked = np.flatnonzero(self._t - self._stalled[:JAW] > STALL_TIME)
        if len(blocked):
            name = MOTORS[int(blocked[0])]
            note = f"Something blocks {name}, which pushes with its whole force. Clear the space"
            self.fail(f"{note} around the arm, then unblock it.", mode=ArmMode.COLLIDED)

    def _hold(self, t: float, *, rests: bool = True) -> None:
        """Let the goals be where the arm is. A jaw at rest keeps its goal, and what it holds.

        rests: whether an arm at rest keeps its goals too, below which it would sink again.
        """
        keeps = np.abs(self._speeds) < STILL
        if self.mode is ArmMode.MOVING:
            self._stopping, self._measured_stop = (t, self._q), None
        keeps[:JAW] &= rests and t - self._changed > REST_TIME
        self._goal = np.where(keeps, self._goal, self._place)
        self._setpoints.clear()
        self.hurries = True

    def _clear(self) -> None:
        self.acts.clear()
        self._setpoints.clear()
        self._writes, self.hurries, self._stopped = 0.0, False, True
        self._stopping = None
