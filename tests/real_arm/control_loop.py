"""A control loop at 100 Hz for tests of drivers."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

import numpy as np

from katana450.arm.control.state.arm_report import ArmAct, ArmMode, ArmReport
from katana450.arm.drivers.driver import Driver, DriverAnswer
from katana450.maths.geometry.arrays import FloatArray
from tests.real_arm.paper_arm import JOINTS

Setpoint = Callable[[float], FloatArray]


class SmallLoop:
    """A control loop at 100 Hz in a thread of its own, which measures the calls of the driver.

    Attributes:
        setpoint: Joints (6,) [rad] by time.
        stopped: Whether the arm is to be stopped.
        answers: Answers of the driver with their times.
        longest: Longest time of a call [s].
    """

    def __init__(self, driver: Driver) -> None:
        self.driver = driver
        self.setpoint: Setpoint = lambda _: JOINTS
        self.stopped = True
        self.answers: list[tuple[float, DriverAnswer]] = []
        self.longest = 0.0
        self._held = JOINTS
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        now = time.perf_counter()
        self.answers.append((now, driver.start(now)))
        self._thread.start()

    def _run(self) -> None:
        due = time.perf_counter()
        while not self._ending.is_set():
            t = time.perf_counter()
            if self.stopped:
                # As the session does: the setpoint of a stopped arm is where it is measured.
                self._held = self.measured
            joints = self._held if self.stopped else self.setpoint(t)
            answer = self.driver.send(joints[:5], float(joints[5]), t, self.stopped)
            self.longest = max(self.longest, time.perf_counter() - t)
            self.answers.append((t, answer))
            due = max(due + 0.01, time.perf_counter())
            time.sleep(max(due - time.perf_counter(), 0.0))

    @property
    def report(self) -> ArmReport:
        """The newest report."""
        report = self.answers[-1][1].report
        assert report is not None
        return report

    @property
    def measured(self) -> FloatArray:
        """The newest measurement, (6,) [rad]."""
        answer = self.answers[-1][1]
        return np.array([*answer.q, answer.gripper])

    def reports_since(self, t: float) -> list[tuple[float, ArmReport, FloatArray]]:
        """Return the reports from ``t`` [s] on, with their times and the joints (5,) [rad]."""
        return [
            (moment, answer.report, answer.q)
            for moment, answer in self.answers
            if moment >= t and answer.report is not None
        ]

    def act(self, act: ArmAct, mode: ArmMode, seconds: float = 3.0) -> None:
        """Perform ``act`` and wait for ``mode``."""
        self.driver.perform(act, time.perf_counter())
        self.wait(mode, seconds)

    def wait(self, mode: ArmMode, seconds: float = 3.0) -> float:
        """Return the time until ``mode`` is reported [s], however short it lasts."""
        start, place = time.perf_counter(), len(self.answers) - 1
        while time.perf_counter() - start < seconds:
            for t, answer in self.answers[place:]:
                place += 1
                if answer.report is not None and answer.report.mode is mode:
                    return max(t - start, 0.0)
            time.sleep(0.002)
        raise AssertionError(f"{self.report.mode} instead of {mode}: {self.report.note}")

    def engage(self) -> None:
        """Connect if needed and engage; then give the measured joints as setpoint."""
        if self.report.mode is ArmMode.DISCONNECTED:
            self.act(ArmAct.CONNECT, ArmMode.UNCALIBRATED)
        self.act(ArmAct.ENGAGE, ArmMode.HOLDING)
        self.clear_stop()

    def clear_stop(self) -> None:
        """Continue from where the arm is."""
        held = self._held
        self.setpoint = lambda _: held
        self.stopped = False

    def stop(self) -> None:
        """Stop the arm, whose setpoint is then where it is measured."""
        self.stopped = True

    def end(self) -> None:
        """End the loop and the driver."""
        self._ending.set()
        self._thread.join()
        self.driver.stop()


def swing(start: FloatArray, t0: float, size: float = 0.4) -> Setpoint:
    """Return a setpoint that begins at rest at ``start`` (6,) [rad] and does not end."""
    directions = size * np.array([1.0, 0.75, -0.5, 1.0, -1.0, 0.0])
    return lambda t: start + directions * (1.0 - np.cos(max(t - t0, 0.0)))
