"""The driver with the emulated arm: it follows, survives slow replies and cuts, and stops."""

from __future__ import annotations

import itertools
import random
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext

import numpy as np
import pytest

from katana450.arm.control.arm_commands import ArmAct
from katana450.arm.control.arm_report import ArmMode
from katana450.extensions.real_arm.codec import requests
from katana450.extensions.real_arm.codec.firmware_codec import RequestReceived
from katana450.extensions.real_arm.driver.katana_driver import MAX_SILENCE, KatanaDriver
from katana450.extensions.real_arm.emulator.arm import EmulatedArm
from katana450.extensions.real_arm.emulator.firmware import Firmware
from katana450.extensions.real_arm.emulator.server import EmulatorServer
from katana450.extensions.real_arm.link.arm_url import ArmUrl
from tests.conftest import LONG
from tests.real_arm.control_loop import SmallLoop, swing
from tests.real_arm.paper_arm import ENDS, JOINTS, MAP

CUTS = 200 if LONG else 6

Delay = Callable[[], float]
"""Time by which the next reply is late [s]."""

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
            if isinstance(event, RequestReceived):
                self.requests.append((time.perf_counter(), event.request))
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


def prompt() -> float:
    return 0.0


def slow() -> float:
    return random.uniform(0.035, 0.045)


@contextmanager
def emulated(
    delay: Delay = prompt, *, calibrated: bool = True
) -> Iterator[tuple[SmallLoop, EmulatorServer]]:
    """Yield a loop with the driver of an emulated arm."""
    arm = EmulatedArm(calibrated=calibrated, calibration_scale=60.0)
    server = EmulatorServer(arm, "127.0.0.1", 0, delay)
    server.start()
    loop = SmallLoop(KatanaDriver(ArmUrl("127.0.0.1", server.port), ENDS, JOINTS))
    try:
        yield loop, server
    finally:
        loop.end()
        server.stop()


def inwards(loop: SmallLoop, size: float = 0.3, fingers: float = 0.0) -> None:
    """Let the setpoint swing away from the posture after a calibration.

    fingers: speed at which they close meanwhile [rad/s].
    """
    begun = time.perf_counter()
    away, closing = swing(np.zeros(6), begun, size), np.array([0.0] * 5 + [-fingers])
    start = loop.measured
    loop.setpoint = lambda t: start + away(t) + closing * max(t - begun, 0.0)


# In real time, so it needs a machine that does nothing else; test_machine.py has simulated time.
@pytest.mark.long
@pytest.mark.parametrize("delay", [prompt, slow])
def test_setpoints_are_followed(wire: Wire, delay: Delay) -> None:
    with emulated(delay) as (loop, _):
        loop.engage()
        begun = time.perf_counter() + 0.1
        start = loop.measured
        plan = swing(start, begun, 0.3)
        loop.setpoint = plan
        time.sleep(4.0 if LONG else 2.2)
        assert loop.report.mode is ArmMode.MOVING
        reports = loop.reports_since(begun)
        assert max(np.abs(q - report.expected[:5]).max() for _, report, q in reports) < 0.03
        # A machine that others keep busy delays single ones.
        ages = sorted(t - report.t for t, report, _ in reports)
        assert ages[-1 - len(ages) // 20] < 0.4
        assert loop.longest < 0.1
        held = MAP.encoders(start)
        moved = [t for t, _ in loop.answers if np.abs(MAP.encoders(plan(t)) - held).max() >= 1.0]
        sent = [r for r in wire.motions() if isinstance(r, requests.SendSplines)]
        knots = np.array([[axis.p0 for axis in packet.segments[:5]] for packet in sent])
        times = moved[0] - 0.01 + 0.08 * np.arange(len(knots))
        planned = np.array([MAP.encoders(plan(t))[:5] for t in times])
        # Half an encoder of rounding, and setpoints that the loop gave at irregular times.
        assert np.abs(knots - planned)[1:].max() < 0.5 + 0.3
        loop.stop()
        loop.wait(ArmMode.HOLDING)
        assert loop.report.measured_stop is not None


def test_arm_is_calibrated_by_an_act_only(wire: Wire) -> None:
    with emulated(calibrated=False) as (loop, server):
        loop.act(ArmAct.CONNECT, ArmMode.UNCALIBRATED)
        assert not wire.motions()
        loop.driver.perform(ArmAct.CALIBRATE, 0.0)
        loop.wait(ArmMode.CALIBRATING)
        loop.wait(ArmMode.HOLDING, 10.0)
        with server.lock:
            assert all(axis.is_calibrated for axis in server.arm.axes)
            assert server.arm.detects_collisions
        assert np.abs(MAP.encoders(loop.measured)).min() == pytest.approx(30500, abs=5)


def test_collision_is_reported_and_unblocked(wire: Wire) -> None:
    with emulated() as (loop, server):
        with server.lock:
            server.arm.obstruct(1, 29500)
        loop.engage()
        inwards(loop)
        loop.wait(ArmMode.COLLIDED, 4.0)
        assert "A collision stopped ax" in loop.report.note
        loop.stop()
        with server.lock:
            server.arm.release(1)
        loop.act(ArmAct.UNBLOCK, ArmMode.HOLDING)
        count = len(wire.motions())
        loop.clear_stop()
        time.sleep(0.3)
        assert len(wire.motions()) == count


def test_power_cycle_ends_in_a_state_where_nothing_moves(wire: Wire) -> None:
    with emulated() as (loop, server):
        loop.engage()
        inwards(loop)
        loop.wait(ArmMode.MOVING)
        with server.lock:
            server.arm.switch_off()
        loop.wait(ArmMode.LOST, 6.0)
        count = len(wire.motions())
        time.sleep(0.2)
        with server.lock:
            server.arm.switch_on()
        loop.wait(ArmMode.UNCALIBRATED, 5.0)
        time.sleep(0.3)
        assert len(wire.motions()) == count


def cut(server: EmulatorServer, loop: SmallLoop, *, hangs: bool) -> float:
    """Reset the connection, or let the arm hang, and wait until the loss is reported.

    Returns the time from then to the last tick whose report still had the arm connected [s]. A busy
    machine may delay the next tick, but none may be later than that.
    """
    begun = time.perf_counter()
    with server.lock if hangs else nullcontext():
        if not hangs:
            server.drop_client()
        loop.wait(ArmMode.LOST)
        while "Trying to connect again" not in loop.report.note:
            # The thread of the driver has not noticed it yet.
            time.sleep(0.005)
            assert time.perf_counter() < begun + 5.0
    reports = loop.reports_since(begun)
    lost = next(n for n, (_, report, _) in enumerate(reports) if report.mode is ArmMode.LOST)
    return reports[lost - 1][0] - begun if lost else 0.0


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


@pytest.mark.long
def test_replies_of_150_milliseconds_are_no_loss() -> None:
    with emulated(lambda: 0.15) as (loop, _):
        loop.act(ArmAct.CONNECT, ArmMode.UNCALIBRATED, 10.0)
        begun = time.perf_counter()
        loop.act(ArmAct.ENGAGE, ArmMode.HOLDING, 10.0)
        time.sleep(3.0)
        modes = {report.mode for _, report, _ in loop.reports_since(begun)}
        assert modes <= {ArmMode.UNCALIBRATED, ArmMode.HOLDING}
