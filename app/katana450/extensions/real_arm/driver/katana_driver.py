"""The driver of a Katana450: a thread of its own exchanges requests with the arm."""

from __future__ import annotations

import logging
import threading
import time
from argparse import Namespace
from collections import deque
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from katana450.arm.control.session.stopping import SilenceProfile
from katana450.arm.control.state.arm_report import ArmAct, ArmMode
from katana450.arm.drivers.driver import DriverAnswer
from katana450.arm.robot.robot import Robot
from katana450.errors import InputError, KatanaError
from katana450.extensions.device_address import DeviceAddress
from katana450.extensions.real_arm.codec.requests import ArmRequest
from katana450.extensions.real_arm.driver.machine import ArmMachine
from katana450.extensions.real_arm.encoder_map import EncoderMap
from katana450.extensions.real_arm.link import (
    PORT,
    ArmLink,
    ArmRefusalError,
    ExchangeLog,
    LinkLostError,
    open_arm,
)
from katana450.extensions.real_arm.tool_travel import Travel, tool_travel
from katana450.extras import require
from katana450.maths.geometry.arrays import FloatArray

IDLE_TIME = 0.01
"""[s] Longest sleep of the thread, if nothing wakes it, while an arm is connected."""

UNCONNECTED_TIME = 0.1
"""[s] The same without a connection."""

SHORTEST_RETRY, LONGEST_RETRY = 0.25, 2.0
"""[s] Time between two attempts to connect. It doubles with each failed one, and is long enough for
the control loop to report each loss."""

MAX_SILENCE = 0.4
"""[s] Time since the newest request that the arm has answered above which it counts as lost. The
control loop ticks each 0.08 s or more often, so a silent arm is reported within 0.5 s."""

END_TIMEOUT = 1.5
"""[s] Maximum time in which a moving arm is stopped at the end."""

MAX_SETPOINTS = 1000
"""Setpoints that wait for a thread that hangs, at most."""

JOINTS = 5

log = logging.getLogger(__name__)


class _Setpoint(NamedTuple):
    joints: FloatArray
    t: float
    stopped: bool


class KatanaDriver:
    """A Katana450 behind the protocol of drivers."""

    silence_profile = SilenceProfile.REAL_ARM

    def __init__(
        self,
        url: DeviceAddress,
        bounds: FloatArray,
        joints: FloatArray,
        travel: Travel | None = None,
        exchange_log: ExchangeLog | None = None,
    ) -> None:
        """Create the driver without a connection.

        Args:
            url: Address of the arm.
            bounds: (2, 6) lower and upper limits of the joints and the finger joint [rad].
            joints: (6,) values of them that are reported before the first measurement [rad].
            travel: Travel of the tool between two postures; None if a stop is measured without it.
            exchange_log: File of all exchanges; None for none.

        Raises ConfigurationError if the limits of the joints are not those of the arm.
        """
        EncoderMap().check_limits(*bounds[:, :JOINTS])
        self._url, self._exchange_log = url, exchange_log
        self._clock = time.perf_counter
        self._machine = ArmMachine(bounds, joints, travel)
        self._link: ArmLink | None = None
        self._heard_at = self._clock()
        self._retry, self._retry_at = SHORTEST_RETRY, -np.inf
        self._setpoints: deque[_Setpoint] = deque(maxlen=MAX_SETPOINTS)
        self._acts: deque[ArmAct] = deque()
        self._wake = threading.Event()
        self._ending = threading.Event()
        self._stop_pressed = threading.Event()
        self._was_stopped = True
        self._end: float | None = None
        self._answer = self._machine.answer()
        self._version = self._machine.version
        self._thread = threading.Thread(target=self._run, name="katana450", daemon=True)

    def start(self, t: float) -> DriverAnswer:  # noqa: ARG002
        """Start the thread, which waits for the act to connect, and return where the arm is."""
        self._thread.start()
        return self._answer

    def send(self, q: FloatArray, gripper: float, t: float, stopped: bool = False) -> DriverAnswer:
        """Give a setpoint to the thread, and return the newest measurement, both at once.

        q: (5,) [rad]. gripper: the finger joint [rad]. t: now [s]. stopped: whether the arm is to
        be frozen and to stay so. Raises InputError for a setpoint that is not finite.
        """
        joints = np.array([*q, gripper])
        if not np.isfinite(joints).all():
            raise InputError(f"The setpoint must be finite, not {q}, {gripper}.")
        self._setpoints.append(_Setpoint(joints, t, stopped))
        if stopped and not self._was_stopped:
            self._wake.set()
        self._was_stopped = stopped
        answer, report = self._answer, self._answer.report
        assert report is not None
        # Checked in the tick, not in the driver's thread, which a busy machine may delay. So no
        # tick reports an arm as connected that has been silent for longer.
        connected = report.mode not in (ArmMode.DISCONNECTED, ArmMode.LOST)
        if connected and (silence := self._silence(t)) > MAX_SILENCE:
            note = f"The driver has not heard from the arm for {silence:.1f} s."
            return replace(answer, report=replace(report, mode=ArmMode.LOST, note=note))
        return answer

    def _silence(self, t: float) -> float:
        """Return the time for which the arm has been silent at ``t`` [s]."""
        link = self._link
        if link is not None:
            self._heard_at = link.heard_at
        return t - self._heard_at

    def perform(self, act: ArmAct, t: float) -> None:  # noqa: ARG002
        """Give ``act`` to the thread, at once."""
        self._acts.append(act)
        self._wake.set()

    def freeze(self, t: float) -> None:  # noqa: ARG002
        """Let the thread end what the arm does by itself, at once."""
        self._stop_pressed.set()
        self._wake.set()

    def place(self, q: FloatArray, gripper: float) -> None:
        """Do nothing: the session restores no state of an arm with a report."""

    def stop(self) -> None:
        """Stop an arm that moves, and disconnect. Its motors keep holding it."""
        self._ending.set()
        self._wake.set()
        if self._thread.is_alive():
            self._thread.join(END_TIMEOUT + MAX_SILENCE)

    def _run(self) -> None:
        while not self._has_ended():
            try:
                self._turn()
            except Exception as error:
                log.exception("The driver of the arm met an error.")
                self._lose(f"The driver met an internal error: {error}.")
            self._publish()
        self._close()

    def _has_ended(self) -> bool:
        """Return True at the end, when the arm stands or has had its time to stop."""
        if not self._ending.is_set():
            return False
        now = self._clock()
        if self._end is None:
            self._end = now + END_TIMEOUT
            self._machine.freeze(now)
        return now > self._end or self._link is None or not self._machine.moves

    def _turn(self) -> None:
        """Take what was given, and perform at most one exchange."""
        self._take()
        machine, now = self._machine, self._clock()
        if not machine.wants_link:
            self._close()
            self._sleep(UNCONNECTED_TIME)
        elif self._link is None:
            self._connect(now)
        elif (request := machine.urgent(now)) is not None or (
            request := machine.poll(now)
        ) is not None:
            self._exchange(request)
        else:
            self._sleep()

    def _take(self) -> None:
        while self._setpoints:
            joints, t, stopped = self._setpoints.popleft()
            if self._end is None:
                self._machine.steer(joints, t, stopped=stopped)
        if self._stop_pressed.is_set():
            self._stop_pressed.clear()
            # Acts that wait are older than the stop.
            self._acts.clear()
            self._machine.end_act(self._clock())
        while self._acts:
            act = self._acts.popleft()
            self._machine.perform(act)
            if act is ArmAct.CONNECT:
                self._retry, self._retry_at = SHORTEST_RETRY, -np.inf

    def _sleep(self, longest: float = IDLE_TIME) -> None:
        self._wake.wait(longest)
        self._wake.clear()

    def _connect(self, now: float) -> None:
        if now < self._retry_at:
            self._sleep()
            return
        try:
            self._link = ArmLink(open_arm(self._url), self._clock, self._exchange_log)
        except KatanaError as error:
            self._lose(str(error))
        else:
            self._machine.connected(str(self._url))

    def _exchange(self, request: ArmRequest) -> None:
        assert self._link is not None
        sent = self._clock()
        try:
            reply = self._link.exchange(request)
        except ArmRefusalError as refusal:
            self._machine.refused(request, refusal.error, self._clock())
        except LinkLostError as error:
            self._lose(str(error))
        else:
            self._retry = SHORTEST_RETRY
            self._machine.replied(request, reply, sent, self._clock())

    def _lose(self, problem: str) -> None:
        """Drop the connection, and connect again after a while."""
        self._close()
        self._machine.lost(problem)
        self._retry_at = self._clock() + self._retry
        self._retry = min(2.0 * self._retry, LONGEST_RETRY)

    def _close(self) -> None:
        if self._link is not None:
            self._link.close()
            self._link = None

    def _publish(self) -> None:
        """Let the control loop have what has changed."""
        version = self._machine.version
        if version != self._version:
            self._version = version
            answer = self._machine.answer()
            self._log(answer)
            self._answer = answer

    def _log(self, answer: DriverAnswer) -> None:
        before, after = self._answer.report, answer.report
        assert before is not None
        assert after is not None
        if after.mode is not before.mode:
            bad = after.mode in (ArmMode.LOST, ArmMode.FAULT, ArmMode.COLLIDED)
            log.log(
                logging.WARNING if bad else logging.INFO, "%s. %s", after.mode.value, after.note
            )


def driver_of(options: Namespace, robot: Robot, q: FloatArray, gripper: float) -> KatanaDriver:
    """Return the driver of the arm at ``options.device``, without a connection.

    q: (n,) [rad] and gripper [rad] are reported before the first measurement. Raises KatanaError
    for a wrong address, a missing extra, a log that cannot be written, and a robot that is not this
    arm.
    """
    url = DeviceAddress.parse(options.device, PORT)
    if url.port is None:
        # Before the server starts: the driver tries to connect until it is ended.
        require("serial", "serial", "Serial ports")
    exchange_log = None if options.arm_log is None else ExchangeLog(options.arm_log)
    arm = robot.require_arm()
    bounds = np.array(
        [
            [*arm.limits.lower, arm.gripper.lower],
            [*arm.limits.upper, arm.gripper.upper],
        ]
    )
    joints = np.array([*q, gripper])
    travel = tool_travel(robot)
    return KatanaDriver(url, bounds, joints, travel=travel, exchange_log=exchange_log)
