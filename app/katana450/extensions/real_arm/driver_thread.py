"""The thread of a driver, which alone speaks to the arm: setpoints and acts in, reports out."""

from __future__ import annotations

import logging
import threading
import time
from abc import ABC, abstractmethod
from collections import deque
from dataclasses import replace
from typing import Generic, TypeVar

import numpy as np

from katana450.arm.control.session.stopping import SilenceProfile
from katana450.arm.control.state.arm_report import ArmAct, ArmMode
from katana450.arm.drivers.driver import DriverAnswer
from katana450.errors import InputError, KatanaError
from katana450.extensions.motor_bus.bus import MotorBus
from katana450.extensions.real_arm.arm_modes import ArmModes
from katana450.extensions.real_arm.link import ArmLink
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

log = logging.getLogger(__name__)


MachineT = TypeVar("MachineT", bound=ArmModes)
LinkT = TypeVar("LinkT", ArmLink, MotorBus)


class DriverThread(ABC, Generic[MachineT, LinkT]):
    """An arm behind the protocol of drivers, whose modes are those of a machine."""

    silence_profile = SilenceProfile.REAL_ARM

    def __init__(self, machine: MachineT, address: str) -> None:
        """Create the driver of the arm at ``address`` without a connection."""
        self._machine, self._address = machine, address
        self._clock = time.perf_counter
        self._link: LinkT | None = None
        self._heard_at = self._clock()
        self._retry, self._retry_at = SHORTEST_RETRY, -np.inf
        self._setpoints: deque[tuple[FloatArray, float, bool]] = deque(maxlen=MAX_SETPOINTS)
        self._acts: deque[ArmAct] = deque()
        self._wake = threading.Event()
        self._ending = threading.Event()
        self._stop_pressed = threading.Event()
        self._was_stopped = True
        self._end: float | None = None
        self._answer = machine.answer()
        self._version = machine.version
        self._thread = threading.Thread(target=self._run, name="arm driver", daemon=True)

    @abstractmethod
    def _open(self) -> LinkT:
        """Return a new connection. Raises KatanaError."""

    @abstractmethod
    def _work(self, link: LinkT, now: float) -> float:
        """Perform what is due at ``now`` [s]; return the time until the next work [s].

        Raises KatanaError if the connection is lost.
        """

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
        self._setpoints.append((joints, t, stopped))
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
        """Take what was given, and do what is due."""
        self._take()
        now = self._clock()
        if not self._machine.wants_link:
            self._close()
            self._sleep(UNCONNECTED_TIME)
        elif self._link is None:
            self._connect(now)
        else:
            try:
                pause = self._work(self._link, now)
            except KatanaError as error:
                self._lose(str(error))
            else:
                if pause > 0.0:
                    self._sleep(pause)

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
            self._link = self._open()
        except KatanaError as error:
            self._lose(str(error))
        else:
            self._machine.connected(self._address)

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
