"""An arm on paper: it answers requests at given times and follows its orders exactly."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from katana450.arm.control.state.arm_report import ArmAct, ArmMode, ArmReport
from katana450.extensions.real_arm.codec import replies
from katana450.extensions.real_arm.codec.replies import ArmReply, AxisStatus, FirmwareError
from katana450.extensions.real_arm.codec.requests import (
    ALL_AXES,
    ArmRequest,
    CommandMotor,
    More,
    MotorFlag,
    ReadAxis,
    ReadMasterVersion,
    ReadPositions,
    ReadSensors,
    ReadStates,
    SendSplines,
)
from katana450.extensions.real_arm.driver.machine import ArmMachine
from katana450.extensions.real_arm.encoder_map import EncoderMap
from katana450.maths.geometry.arrays import FloatArray

MAP = EncoderMap()
HOME = np.array([0, -15000, -14000, 14000, 7000, 20000])
JOINTS = MAP.joints(HOME)
ENDS = np.sort([MAP.joints(MAP.lower), MAP.joints(MAP.upper)], axis=0)

FIXED: dict[type[ArmRequest], ArmReply] = {
    ReadMasterVersion: replies.MasterVersion(2, 1),
    ReadSensors: replies.SensorBytes(15, tuple(range(16))),
}


class PaperArm:
    """An arm that stands at HOME with its motors on.

    Attributes:
        requests: All requests with their times.
        refusals: Errors for the next requests of a class, each used once.
        starved: Whether its buffer ran empty before the end of a motion.
        buffers: Segments that waited at the arrival of each packet.
        largest_jump: Largest distance from the arm to the start of a polynomial [encoders].
    """

    def __init__(self) -> None:
        self.place = HOME.astype(float)
        self.states = [int(AxisStatus.FIXED)] * 6
        self.requests: list[tuple[float, ArmRequest]] = []
        self.refusals: dict[type[ArmRequest], FirmwareError] = {}
        self.starved = False
        self.largest_jump = 0.0
        self.buffers: list[float] = []
        self.calibrated_at = np.inf
        self._packets: list[SendSplines] = []
        self._began: float | None = None
        self._targets: dict[int, tuple[float, float, float]] = {}

    def answer(self, request: ArmRequest, t: float) -> ArmReply | FirmwareError:
        """Return the reply at ``t`` [s], or the error of a refusal."""
        self.requests.append((t, request))
        if (error := self.refusals.pop(type(request), None)) is not None:
            return error
        self._move(t)
        match request:
            case SendSplines():
                self._take(request, t)
            case CommandMotor():
                self._command(request, t)
                return replies.MotorCommanded(request.axis, request.flag)
            case ReadPositions():
                return replies.AxisPositions(tuple(map(int, np.rint(self.place))))
            case ReadStates():
                return replies.AxisStates(tuple(self.states))
            case ReadAxis(axis=axis):
                place = int(self.place[axis - 1])
                return replies.AxisReading(axis, self.states[axis - 1], place, 0, 0)
        if type(request) in FIXED:
            return FIXED[type(request)]
        length = request.REPLY.length() - 1
        return request.REPLY.read(request.REPLY.HEAD + bytes([1]) * length)

    def _take(self, packet: SendSplines, t: float) -> None:
        before = self._packets[-1].segments if self._packets else None
        starts = self.place if before is None else [segment.target for segment in before]
        jumps = [abs(s.p0 - place) for s, place in zip(packet.segments[:5], starts, strict=False)]
        self.largest_jump = max(self.largest_jump, *jumps)
        self._packets.append(packet)
        if self._began is None and packet.more != More.STORE:
            self._began = t
        if self._began is not None:
            played = (t - self._began) / 0.08
            self.buffers.append(len(self._packets) - played)

    def _command(self, request: CommandMotor, t: float) -> None:
        axes = range(6) if request.axis == ALL_AXES else [request.axis - 1]
        match request.flag:
            case MotorFlag.FLUSH:
                if self._packets:
                    self._packets, self._began = [], None
                    self.states[:5] = [int(AxisStatus.SPLINES_DONE)] * 5
            case MotorFlag.FREEZE:
                self.place[axes[0]] = request.value
                self._targets.pop(axes[0], None)
                self.states[axes[0]] = AxisStatus.FIXED
            case MotorFlag.OFF:
                self.states[axes[0]] = AxisStatus.OFF
            case MotorFlag.MOVE:
                self._targets[axes[0]] = (t, self.place[axes[0]], request.value)
                self.states[axes[0]] = AxisStatus.MOVING_TO_TARGET
            case MotorFlag.CALIBRATE:
                self.states = [int(AxisStatus.CALIBRATING)] * 6
                self.calibrated_at = t + 2.0

    def _move(self, t: float) -> None:
        if t >= self.calibrated_at:
            self.calibrated_at = np.inf
            self.states = [int(AxisStatus.FIXED)] * 6
            self.place = np.array([30500.0, -30500, -30500, 30500, 30500, 30500])
        for axis, (start_time, start, end) in list(self._targets.items()):
            reach = 18_000 * (t - start_time)
            self.place[axis] = start + np.clip(end - start, -reach, reach)
            if self.place[axis] == end:
                del self._targets[axis]
                self.states[axis] = AxisStatus.FIXED
        if self._began is None:
            return
        tick = (t - self._began) / 0.01
        index = int(tick // 8)
        if index < len(self._packets):
            segments = self._packets[index].segments
            self.place[:5] = [segment.at(tick - 8 * index) for segment in segments[:5]]
            self.states[:5] = [int(AxisStatus.MOVING)] * 5
            return
        last = self._packets[-1]
        self.starved = self.starved or last.more != More.LAST
        self.place[:5] = [segment.target for segment in last.segments[:5]]
        self.states[:5] = [int(AxisStatus.SPLINES_DONE)] * 5
        self._packets, self._began = [], None


class Conversation:
    """A machine and an arm on paper, on a clock of their own.

    Attributes:
        setpoint: Joints (6,) [rad] that the control loop gives at a time.
        stopped: Whether the control loop is stopped.
        delay: Function of the time that gives the time of an exchange.
        reports: Report at each tick of the loop, with its time and the measured joints (6,).
    """

    def __init__(self) -> None:
        self.machine = ArmMachine(ENDS, JOINTS, self._travel)
        self.arm = PaperArm()
        self.now = 100.0
        self.setpoint: Callable[[float], FloatArray] = lambda _: JOINTS
        self.stopped = True
        self.delay: Callable[[], float] = lambda: 0.002
        self.reports: list[tuple[float, ArmReport, FloatArray]] = []
        self._tick = self.now

    @staticmethod
    def _travel(start: FloatArray, end: FloatArray) -> float:
        """Return the travel of a tool that is 2 m from axis 1 alone [m]."""
        return 2.0 * abs(float(end[0] - start[0]))

    def run(self, seconds: float) -> None:
        """Let ``seconds`` pass."""
        end = self.now + seconds
        while self.now < end:
            self._loop()
            if not self.machine.wants_link:
                self.now += 0.005
                continue
            request = self.machine.urgent(self.now) or self.machine.poll(self.now)
            if request is None:
                self.now += 0.005
                continue
            sent, delay = self.now, self.delay()
            reply = self.arm.answer(request, sent + 0.5 * delay)
            self.now += delay
            if isinstance(reply, FirmwareError):
                self.machine.refused(request, reply, self.now)
            else:
                self.machine.replied(request, reply, sent, self.now)

    def _loop(self) -> None:
        while self._tick <= self.now:
            self.machine.steer(self.setpoint(self._tick), self._tick, stopped=self.stopped)
            answer = self.machine.answer()
            assert answer.report is not None
            self.reports.append((self._tick, answer.report, np.array([*answer.q, answer.gripper])))
            self._tick += 0.01

    def mode(self) -> ArmMode:
        """Return the mode of the machine."""
        return self.machine.mode

    def connect(self) -> None:
        """Connect, and let the arm be identified."""
        self.machine.perform(ArmAct.CONNECT)
        self.machine.connected("tcp://paper:5566")
        self.run(1.0)

    def engage(self) -> None:
        """Connect and engage, and clear the stop."""
        self.connect()
        self.machine.perform(ArmAct.ENGAGE)
        self.run(1.5)
        assert self.mode() is ArmMode.HOLDING
        self.stopped = False

    def sent(self, kind: type[ArmRequest]) -> list[ArmRequest]:
        """Return the requests of a class that arrived."""
        return [request for _, request in self.arm.requests if isinstance(request, kind)]

    @property
    def motors(self) -> list[tuple[int, int]]:
        """Axis and flag of all orders to motors that arrived."""
        return [(r.axis, r.flag) for _, r in self.arm.requests if isinstance(r, CommandMotor)]


def sway(t0: float, amplitude: float = 0.5) -> Callable[[float], FloatArray]:
    """Return a setpoint that swings with 1 rad/s at most and rests after 4 s."""

    def at(t: float) -> FloatArray:
        s = min(max(t - t0, 0.0), 4.0)
        reach = amplitude * float(np.sin(0.5 * np.pi * s)) ** 2
        return JOINTS + reach * np.array([1.0, -1.0, 0.5, 1.0, 1.0, 0.0])

    return at
