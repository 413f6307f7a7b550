"""The state machine of the driver: events and time in, requests and the report out.

It knows no connection, clock or thread: the caller performs the exchanges and names the times.
"""

from __future__ import annotations

import math

import numpy as np

from katana450.arm.control.state.arm_report import ArmAct, ArmMode, ArmReport, MeasuredStop
from katana450.arm.drivers.driver import DriverAnswer
from katana450.extensions.real_arm.arm_modes import ArmModes
from katana450.extensions.real_arm.codec.replies import (
    IN_MOTION,
    ArmReply,
    AxisStates,
    AxisStatus,
    FirmwareError,
)
from katana450.extensions.real_arm.codec.requests import (
    ArmRequest,
    CommandMotor,
    ReadPositions,
    ReadSensors,
    ReadStates,
    SendSplines,
)
from katana450.extensions.real_arm.driver.arm_motion import FINGER, ArmMotion
from katana450.extensions.real_arm.driver.procedures import (
    ArmReadings,
    Procedure,
    ProcedureEnd,
    calibrate,
    halt,
    hold,
    identify,
    release,
)
from katana450.extensions.real_arm.encoder_map import DRIVEN, EncoderMap
from katana450.extensions.real_arm.link import ArmRefusalError
from katana450.extensions.real_arm.tool_travel import Travel
from katana450.maths.geometry.arrays import FloatArray, frozen

POLLS = ((ReadPositions(), 0.04), (ReadStates(), 0.1), (ReadSensors(), 0.25))
"""Measurements, and the time between two of each [s] if the arm answers fast enough."""

OLD = 0.2
"""[s] Age of positions from which on they are measured before polynomials are sent. The session
stops an arm whose measurement is older than 0.5 s."""

FINGER_PERIOD = 0.1
"""[s] The same for targets of the gripper."""

NOISE = np.radians(0.5)
"""[rad] Distance beyond a limit that calibration and play leave possible."""

UNPROVEN = (ArmMode.CONNECTED, ArmMode.UNCALIBRATED, ArmMode.CALIBRATING)
"""Modes of an arm whose encoders may be wrong."""

MAX_REFUSALS = 3
"""Measurements that may be refused one after another."""

CALIBRATION_ENDED = "STOP ended the calibration. Calibrate the arm again."

MOVED_BY_ITSELF = "STOP froze the arm, which moved by itself. Calibrate the arm."


class ArmMachine(ArmModes):
    """State machine of one arm.

    Attributes:
        arm: Newest measurements.
    """

    def __init__(
        self,
        bounds: FloatArray,
        joints: FloatArray,
        travel: Travel | None = None,
    ) -> None:
        """Create it without a connection.

        Args:
            bounds: (2, 6) lower and upper limits of the joints and the finger joint [rad].
            joints: (6,) values of them that are reported before the first measurement [rad].
            travel: Travel of the tool between two postures; None if a stop is measured without it.
        """
        super().__init__()
        self.arm = ArmReadings()
        self._encoders = EncoderMap()
        self._bounds, self._travel = bounds, travel
        self._joints = frozen(joints)
        self._motion = ArmMotion(self._encoders, self.arm)
        self._procedure: Procedure | None = None
        self._step: ArmRequest | None = None
        self._resume_at = -np.inf
        self._stopped = True
        self._stop_asked: float | None = None
        self._polled: dict[type[ArmRequest], float] = {}
        self._refusals = 0
        self._has_sensors = True
        self._measured_stop: MeasuredStop | None = None
        self._must_freeze = False

    @property
    def moves(self) -> bool:
        """True while a motion is in progress, or a stop waits or is performed."""
        return self.mode is ArmMode.MOVING or self._stop_asked is not None

    @property
    def version(self) -> tuple[object, ...]:
        """Mode, note and measurements."""
        arm = self.arm
        return self.mode, self.note, arm.t, arm.states_t, arm.sensors, self._measured_stop

    # Events.

    def connected(self, address: str) -> None:
        """Begin to identify the arm at ``address`` on a new connection."""
        again = " again" if self._was_connected else ""
        self._clear()
        self._has_sensors = True
        sentence = f"Connected{again} to {address}."
        self._procedure = identify(self.arm, sentence)
        self._resume_at = -np.inf

    def perform(self, act: ArmAct) -> None:
        """Begin ``act`` as soon as possible; drop one that is impossible in the present mode."""
        super().perform(act)
        self._must_freeze = self._must_freeze and self.wants_link

    def steer(self, joints: FloatArray, t: float, *, stopped: bool) -> None:
        """Take a setpoint (6,) [rad] of time ``t`` [s], or the order to stop the arm."""
        encoders = np.clip(
            self._encoders.encoders(joints), self._encoders.lower, self._encoders.upper
        )
        if stopped:
            if not self._stopped:
                self._stop_asked = t
                if self.mode.follows:
                    # The measurement of an older stop is not that of this one.
                    self._measured_stop = None
            self._motion.ignore(encoders)
        elif self.mode.follows and self._procedure is None:
            problem = self._motion.follow(encoders, t)
            if problem:
                self._halt(t, problem)
        self._stopped = stopped

    def end_act(self, now: float) -> None:
        """Drop acts that wait, and end what the arm does by itself: somebody has pressed STOP.

        An arm whose calibration ends is not calibrated. An arm that does not answer may still
        calibrate, so it is frozen as soon as it answers again.
        """
        super().end_act(now)
        if self.mode is ArmMode.CALIBRATING and self._procedure is not None:
            self._procedure.close()
            self._start(halt(self.arm, DRIVEN, self._encoders, now, CALIBRATION_ENDED), now)
        elif self.wants_link and not self.mode.follows:
            self._must_freeze = True

    def freeze(self, now: float) -> None:
        """Stop an arm that moves, as at the end of the program."""
        self._stopped, self._stop_asked = True, now

    def replied(self, request: ArmRequest, reply: ArmReply, sent: float, now: float) -> None:
        """Take the reply to ``request``, which was sent at ``sent`` [s] and came at ``now`` [s]."""
        middle = 0.5 * (sent + now)
        self.round_trip = now - sent
        self.arm.note(reply, middle)
        self._refusals = 0
        self._note_answer()
        if self._procedure is not None:
            self._advance(now)
        elif isinstance(request, SendSplines | CommandMotor):
            self._motion.sent(request, middle)
            self.mode = ArmMode.MOVING
        elif isinstance(reply, AxisStates):
            self._supervise(now)

    def refused(self, request: ArmRequest, error: FirmwareError, now: float) -> None:
        """Take the refusal of ``request``."""
        self.arm.newest_reply = now
        self._note_answer()
        if self._procedure is not None:
            self._advance(now, ArmRefusalError(error))
        elif isinstance(request, ReadSensors):
            self._has_sensors = False
        elif isinstance(request, SendSplines | CommandMotor):
            self._halt(now, error.sentence)
        else:
            self._refusals += 1
            if self._refusals > MAX_REFUSALS and self.mode.follows:
                self._halt(now, error.sentence)

    def _note_answer(self) -> None:
        if self.mode in (ArmMode.DISCONNECTED, ArmMode.LOST):
            # Only a reply proves that there is an arm: systems accept connections in its place.
            self.mode, self.note = ArmMode.CONNECTED, "Reading the arm."
            self._was_connected = True

    # Requests.

    def urgent(self, now: float) -> ArmRequest | None:
        """Return the request that cannot wait at ``now`` [s], or None."""
        if self._procedure is None:
            self._begin(now)
        if self._procedure is not None:
            if self._step is None and now >= self._resume_at:
                self._advance(now)
            step, self._step = self._step, None
            return step
        if not self._may_move:
            return None
        if now - self.arm.t > OLD and self._motion.can_wait(now):
            return ReadPositions()
        return self._motion.next_packet(now)

    @property
    def _may_move(self) -> bool:
        return self.mode.follows and not self._stopped

    def poll(self, now: float) -> ArmRequest | None:
        """Return the measurement or target of the gripper that is due most at ``now`` [s], or None.

        With slow replies each still gets its part of the time that the polynomials leave.
        """
        if self._procedure is not None:
            return None
        due = list(POLLS if self._has_sensors else POLLS[:-1])
        order = self._motion.finger_order() if self._may_move else None
        if order is not None:
            due.append((order, FINGER_PERIOD))
        overdue = [(now - self._polled.get(type(kind), -math.inf)) / time for kind, time in due]
        most = max(overdue)
        if most < 1.0:
            return None
        request = due[overdue.index(most)][0]
        self._polled[type(request)] = now
        return request

    def answer(self) -> DriverAnswer:
        """Return what the driver reports."""
        t = self.arm.t
        q = self._joints
        speeds = np.zeros(len(q))
        if np.isfinite(t):
            q = self._within(self._encoders.joints(self.arm.positions))
            speeds = self.arm.speeds * self._encoders.scale
        expected = q
        if self.mode.follows:
            expected = self._within(self._encoders.joints(self._motion.expected_at(t)))
        report = ArmReport(
            self.mode,
            t if np.isfinite(t) else 0.0,
            expected,
            frozen(speeds),
            self.note,
            self.round_trip,
            tuple(map(float, self.arm.sensors)),
            self._measured_stop,
        )
        return DriverAnswer(frozen(q[:FINGER]), float(q[FINGER]), report)

    def _within(self, q: FloatArray) -> FloatArray:
        """Return ``q`` (6,) with joints that are beyond their limits by noise at the limits."""
        limited = np.clip(q, *self._bounds)
        return frozen(np.where(np.abs(limited - q) < NOISE, limited, q))

    # Transitions.

    def _clear(self) -> None:
        if self._procedure is not None:
            self._procedure.close()
        self._procedure = self._step = self._stop_asked = None
        self._motion.clear()
        self.acts.clear()
        self._polled.clear()

    def _begin(self, now: float) -> None:
        """Begin the stop or the act that waits."""
        if self._must_freeze:
            self._must_freeze = False
            if self.arm.axes_in(*IN_MOTION, AxisStatus.CALIBRATING):
                self._start(halt(self.arm, DRIVEN, self._encoders, now, MOVED_BY_ITSELF), now)
                return
        if self._stop_asked is not None:
            press, self._stop_asked = self._stop_asked, None
            if self.mode.follows and self._motion.moves(now):
                self._halt(press)
            return
        while self.acts and self._procedure is None:
            act = self.acts.popleft()
            if act not in self.mode.acts:
                continue
            self._measured_stop = None
            match act:
                case ArmAct.CALIBRATE:
                    self.mode, self.note = ArmMode.CALIBRATING, "The arm moves to its stops."
                    self._start(calibrate(self.arm), now)
                case ArmAct.RELEASE:
                    self._start(release(self.arm), now)
                case _:
                    self._start(hold(self.arm), now)

    def _start(self, procedure: Procedure, now: float) -> None:
        self._procedure, self._step, self._resume_at = procedure, None, now

    def _halt(self, press: float, cause: str = "") -> None:
        """Begin to stop the arm, which counts as moving until it rests."""
        self.mode = ArmMode.MOVING
        if cause:
            self.note = cause
        axes = DRIVEN
        if not self._motion.finger_moves(press):
            # Fingers at rest keep their order, and so what they hold.
            axes = self._motion.axes
        self._start(halt(self.arm, axes, self._encoders, press, cause, self._travel), press)

    def _advance(self, now: float, error: ArmRefusalError | None = None) -> None:
        """Continue the procedure up to its next request or pause, or end it."""
        assert self._procedure is not None
        try:
            step = next(self._procedure) if error is None else self._procedure.throw(error)
        except StopIteration as done:
            self._finish(done.value)
        except ArmRefusalError as refusal:
            self._finish(ProcedureEnd(ArmMode.FAULT, str(refusal)))
        else:
            self._step = step if isinstance(step, ArmRequest) else None
            self._resume_at = now if isinstance(step, ArmRequest) else now + step

    def _finish(self, end: ProcedureEnd) -> None:
        self._procedure = self._step = None
        self._motion.clear()
        # Nothing leads past an act that failed: the arm may not be calibrated.
        failed = end.mode is ArmMode.FAULT and self.mode in UNPROVEN
        self.mode, self.note = ArmMode.UNCALIBRATED if failed else end.mode, end.note
        if end.measured_stop is not None:
            self._measured_stop = end.measured_stop

    def _supervise(self, now: float) -> None:
        """Compare the newest states with the mode."""
        if not self.mode.follows:
            return
        bad = self.arm.axes_in(AxisStatus.COLLIDED, AxisStatus.OFF, AxisStatus.DATA_INVALID)
        wrong = [axis for axis in self._motion.axes if axis in bad]
        problem = self.arm.words(wrong[0]) if wrong else self._motion.settle(now)
        if problem:
            self._halt(now, problem)
        else:
            self.mode = ArmMode.MOVING if self._motion.moves(now) else ArmMode.HOLDING
