"""The driver with the emulated arm: collisions, power cycles and cut connections."""

from __future__ import annotations

import itertools
import random
import time
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext

import numpy as np
import pytest

from katana450.arm.control.state.arm_report import ArmAct, ArmMode
from katana450.extensions.device_address import DeviceAddress
from katana450.extensions.real_arm.codec import requests
from katana450.extensions.real_arm.driver.katana_driver import KatanaDriver
from katana450.extensions.real_arm.driver_thread import MAX_SILENCE
from katana450.extensions.real_arm.emulator.arm import EmulatedArm
from katana450.extensions.real_arm.emulator.firmware import Firmware
from tests.conftest import LONG
from tests.real_arm.control_loop import SmallLoop, swing
from tests.real_arm.emulated import FaultyServer
from tests.real_arm.paper_arm import ENDS, JOINTS

CUTS = 200 if LONG else 6

MOTIONS = (
    requests.MotorFlag.OFF,
    requests.MotorFlag.CALIBRATE,
    requests.MotorFlag.MOVE,
)


class Wire:
    """All requests that reached the firmware, with their times."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.requests: list[tuple[float, requests.ArmRequest]] = []
        handle = Firmware.handle

        def handled(firmware: Firmware, event: object) -> bytes:
            if isinstance(event, requests.ArmRequest):
                self.requests.append((time.perf_counter(), event))
            return handle(firmware, event)  # type: ignore[arg-type]

        monkeypatch.setattr(Firmware, "handle", handled)

    def motions(self) -> list[requests.ArmRequest]:
        """Return the requests that move the arm, in their order."""
        return [
            request
            for _, request in self.requests
            if isinstance(request, requests.SendSplines)
            or (isinstance(request, requests.CommandMotor) and request.flag in MOTIONS)
        ]


@pytest.fixture
def wire(monkeypatch: pytest.MonkeyPatch) -> Wire:
    return Wire(monkeypatch)


@contextmanager
def emulated() -> Iterator[tuple[SmallLoop, FaultyServer]]:
    """Yield a loop with the driver of an emulated arm."""
    arm = EmulatedArm(calibrated=True)
    server = FaultyServer(arm)
    server.start()
    loop = SmallLoop(KatanaDriver(DeviceAddress("127.0.0.1", server.port), ENDS, JOINTS))
    try:
        yield loop, server
    finally:
        loop.end()
        server.stop()


def inwards(loop: SmallLoop, size: float = 0.3, fingers: float = 0.0) -> None:
    """Let the setpoint swing away from the posture after a calibration.

    fingers: speed at which they close meanwhile [rad/s].
    """
    start_time = time.perf_counter()
    away, closing = swing(np.zeros(6), start_time, size), np.array([0.0] * 5 + [-fingers])
    start = loop.measured
    loop.setpoint = lambda t: start + away(t) + closing * max(t - start_time, 0.0)


def cut(server: FaultyServer, loop: SmallLoop, *, hangs: bool) -> float:
    """Reset the connection, or let the arm hang, and wait until the loss is reported.

    Returns the time from then to the last tick whose report still had the arm connected [s]. A busy
    machine may delay the next tick, but none may be later than that.
    """
    start = time.perf_counter()
    with server.lock if hangs else nullcontext():
        if not hangs:
            server.drop_client()
        loop.wait(ArmMode.LOST)
        while "Trying to connect again" not in loop.report.note:
            # The thread of the driver has not noticed it yet.
            time.sleep(0.005)
            assert time.perf_counter() < start + 5.0
    reports = loop.reports_since(start)
    lost = next(n for n, (_, report, _) in enumerate(reports) if report.mode is ArmMode.LOST)
    return reports[lost - 1][0] - start if lost else 0.0


def test_cuts_at_random_instants_repeat_no_motion(wire: Wire) -> None:
    chance = random.Random(21)
    times, moving, closing = [], 0, 0
    with emulated() as (loop, server):
        loop.act(ArmAct.CONNECT, ArmMode.UNCALIBRATED)
        for number in range(CUTS):
            count = len(wire.motions())
            loop.stop()
            loop.driver.perform(ArmAct.ENGAGE, 0.0)
            if number % 5:
                loop.wait(ArmMode.HOLDING)
                loop.clear_stop()
                # The fingers close and open in turn, so that they never reach an end.
                inwards(loop, 0.1, 0.1 if number % 2 else -0.1)
            time.sleep(chance.uniform(0.0, 0.8))
            times.append(cut(server, loop, hangs=number % 4 == 3))
            # The request that had no reply may still arrive from the old connection, once.
            loop.wait(ArmMode.UNCALIBRATED, 5.0)
            motions = wire.motions()
            time.sleep(0.1)
            assert wire.motions() == motions
            packets = [r for r in motions[count:] if isinstance(r, requests.SendSplines)]
            moving += len(packets) > 4
            # Targets of the fingers go one way, so an order that came twice is seen.
            targets = [r.value for r in motions[count:] if isinstance(r, requests.CommandMotor)]
            assert len(set(targets)) == len(targets)
            closing += len(targets) > 1
            # Each packet begins where the one before it ends, so none came twice.
            for before, after in itertools.pairwise(packets):
                ends = [axis.target for axis in before.segments]
                assert [axis.p0 for axis in after.segments] == ends
    assert max(times) <= MAX_SILENCE
    assert moving >= CUTS // 4
    assert closing >= CUTS // 4
