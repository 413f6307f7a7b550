"""The control loop on a clock of the test's own, and once on the machine's."""

from __future__ import annotations

import logging
import threading
import time

import numpy as np
import pytest

from katana450.arm.control import commands as cmd
from katana450.arm.control.arm import ArmModel
from katana450.arm.control.session import Session
from katana450.arm.control.state import Status
from katana450.arm.drivers.driver import SentSetpoint
from katana450.arm.drivers.simulated import SimulatedDriver
from katana450.arm.runtime.clock import MonotonicClock
from katana450.arm.runtime.loop import ControlLoop
from katana450.arm.runtime.mailbox import Mailbox
from katana450.maths.geometry.arrays import FloatArray

RATE = 100.0


class SteppedClock:
    """Time goes on when the loop sleeps, and when the test says so."""

    def __init__(self) -> None:
        self.t = 100.0

    def now(self) -> float:
        return self.t

    def sleep_until(self, t: float) -> None:
        self.t = max(self.t, t)


class LoopOnATable:
    """A loop with its parts at hand."""

    def __init__(self, arm: ArmModel, session: Session) -> None:
        self.clock = SteppedClock()
        self.mailbox = Mailbox(session.check)
        self.driver = SimulatedDriver(arm, session.ready, 0.0)
        self.loop = ControlLoop(session, self.driver, self.mailbox, self.clock, RATE)

    def tick(self, times: int = 1) -> None:
        for _ in range(times):
            self.clock.t += 1.0 / RATE
            self.loop.tick()


@pytest.fixture
def table(arm: ArmModel, session: Session) -> LoopOnATable:
    return LoopOnATable(arm, session)


def test_a_command_moves_the_arm_until_it_is_there(arm: ArmModel, table: LoopOnATable) -> None:
    ticket = table.mailbox.put(cmd.SetJoint(0, 0.5))
    table.tick()
    assert table.loop.state_publisher.snapshot.ticket == ticket
    jerk = float(arm.limits.jerk[0])
    assert table.loop.state_publisher.snapshot.state.q[0] == pytest.approx(jerk / RATE**3 / 6.0)
    table.tick(150)
    assert table.loop.state_publisher.snapshot.state.q[0] == 0.5


def test_an_arm_at_rest_publishes_nothing(table: LoopOnATable) -> None:
    table.tick(3)
    resting = table.loop.state_publisher.snapshot
    table.tick(50)
    assert table.loop.state_publisher.snapshot is resting
    table.mailbox.put(cmd.EndDrag())
    table.tick()
    assert table.loop.state_publisher.snapshot is not resting


def test_after_a_rest_the_first_step_is_one_period_long(arm: ArmModel, table: LoopOnATable) -> None:
    table.tick(500)
    before = table.loop.state_publisher.snapshot.state.q
    table.mailbox.put(cmd.SetJoint(0, 2.0))
    table.tick()
    step = np.abs(table.loop.state_publisher.snapshot.state.q - before)
    assert step.max() == pytest.approx(float(arm.limits.jerk[0]) / RATE**3 / 6.0)


class BrokenDriver(SimulatedDriver):
    """Fails while ``broken``."""

    broken = False

    def send(self, q: FloatArray, gripper: float, t: float) -> SentSetpoint:
        if self.broken:
            raise OSError("the cable came out")
        return super().send(q, gripper, t)


def test_a_driver_that_fails_makes_the_arm_hold_and_say_so(
    arm: ArmModel, session: Session, caplog: pytest.LogCaptureFixture
) -> None:
    clock, mailbox = SteppedClock(), Mailbox(session.check)
    driver = BrokenDriver(arm, session.ready, 0.0)
    loop = ControlLoop(session, driver, mailbox, clock, RATE)
    mailbox.put(cmd.SetJoint(0, 2.0))
    for _ in range(5):
        clock.t += 0.01
        loop.tick()
    moving = loop.state_publisher.snapshot.state
    driver.broken = True
    clock.t += 0.01
    with caplog.at_level(logging.ERROR):
        loop.tick()
    held = loop.state_publisher.snapshot.state
    assert held.status is Status.FAULT
    assert (held.goal == moving.setpoint).all()
    assert "the cable came out" in caplog.text
    # The cable goes back in: the arm still holds, until a person asks anew.
    driver.broken = False
    for _ in range(20):
        clock.t += 0.01
        loop.tick()
    assert np.allclose(loop.state_publisher.snapshot.state.q, moving.setpoint)
    assert loop.state_publisher.snapshot.state.findings == held.findings
    mailbox.put(cmd.Home())
    clock.t += 0.01
    loop.tick()
    assert loop.state_publisher.snapshot.state.findings == ()


def test_waiting_for_a_change_returns_with_it_or_when_time_is_up(table: LoopOnATable) -> None:
    table.tick()
    seen = table.loop.state_publisher.snapshot
    assert table.loop.state_publisher.wait_for_change(seen, 0.01) is seen
    table.mailbox.put(cmd.Home())
    teller = threading.Thread(target=table.tick)
    teller.start()
    assert table.loop.state_publisher.wait_for_change(seen, 5.0) is not seen
    teller.join()


def test_on_the_machines_clock_the_loop_runs_and_stops(arm: ArmModel, session: Session) -> None:
    mailbox = Mailbox(session.check)
    driver = SimulatedDriver(arm, session.ready, 0.0)
    loop = ControlLoop(session, driver, mailbox, MonotonicClock(), RATE)
    loop.start()
    started = time.perf_counter()
    mailbox.put(cmd.SetJoint(0, 0.4))
    snapshot = loop.state_publisher.snapshot
    while snapshot.state.q[0] != 0.4:
        assert time.perf_counter() - started < 10.0
        snapshot = loop.state_publisher.wait_for_change(snapshot, 0.1)
    took = time.perf_counter() - started
    loop.stop()
    # Never sooner than the joint can: however the machine stutters.
    assert took >= 0.4 / arm.chain.speed[0] - 1.5 / RATE
    assert not [thread for thread in threading.enumerate() if thread.name == "control"]
