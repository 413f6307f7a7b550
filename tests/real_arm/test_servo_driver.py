"""The driver of bus servos with emulated motors on a real socket: motion, STOP, faults."""

from __future__ import annotations

import random
import socket
import time
from argparse import Namespace
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import msgspec
import numpy as np
import pytest

from katana450.arm.control.state.arm_report import ArmAct, ArmMode
from katana450.arm.robot.robot import Robot
from katana450.client import connect as connect_client
from katana450.errors import ConfigurationError, KatanaError
from katana450.extensions.device_address import DeviceAddress
from katana450.extensions.motor_bus import bus
from katana450.extensions.motor_bus.bus import MotorBus, MotorRequestError, open_port
from katana450.extensions.motor_bus.dynamixel import DYNAMIXEL
from katana450.extensions.real_arm import driver_thread
from katana450.extensions.real_arm.emulator.server import ServoServer
from katana450.extensions.real_arm.options import driver
from katana450.extensions.real_arm.servo import machine
from katana450.extensions.real_arm.servo.arms import SERVO_ARMS, ServoArm
from katana450.extensions.real_arm.servo.joints import ServoJoints
from katana450.server.api import answers, requests
from tests.browser.server import APP, AppServer
from tests.conftest import LONG
from tests.real_arm.control_loop import SmallLoop
from tests.real_arm.emulated import emulator_process
from tests.real_arm.emulated_servo_arm import (
    PATIENCE,
    calibration,
    connect,
    driven,
    engage,
    move,
    served,
    so101,
    wait_until,
)

ROUNDS = 50 if LONG else 1
"""Faults of each kind."""

KINDS = ("so101", "koch", "omx") if LONG else ("so101", "koch")


@pytest.fixture(scope="module")
def arm() -> Robot:
    return so101()


@pytest.fixture(params=KINDS)
def kind(request: pytest.FixtureRequest) -> ServoArm:
    return SERVO_ARMS[request.param]


@pytest.fixture
def server(kind: ServoArm, monkeypatch: pytest.MonkeyPatch) -> Iterator[ServoServer]:
    """Yield a server, on a machine that may be too busy to answer in time."""
    monkeypatch.setattr(bus, "TRIES", 6)
    for module, name in ((machine, "SILENT_TIME"), (driver_thread, "MAX_SILENCE")):
        monkeypatch.setattr(module, name, 2.0)
    with served(kind) as server:
        yield server


@pytest.fixture
def loop(server: ServoServer, arm: Robot, kind: ServoArm) -> Iterator[SmallLoop]:
    with driven(server, arm, kind=kind) as loop:
        yield loop


def places(server: ServoServer) -> list[float]:
    with server.lock:
        return [motor.counted for motor in server.arm.motors]


def values(server: ServoServer, register: str) -> list[int]:
    with server.lock:
        return [motor[getattr(motor.make, register)] for motor in server.arm.motors]


def goals(server: ServoServer) -> list[int]:
    return values(server, "goal_position")


def torques(server: ServoServer) -> list[int]:
    return values(server, "torque_enable")


@pytest.mark.parametrize("name", SERVO_ARMS)
def test_ticks_and_joints_are_inverse_and_the_middle_is_the_middle_of_the_joint(
    arm: Robot, name: str
) -> None:
    own, kind = calibration(SERVO_ARMS[name]), SERVO_ARMS[name]
    joints = ServoJoints(own, arm, kind)
    middle = np.array([(motor.range_min + motor.range_max) // 2 for motor in own.values()])
    # A jaw that was calibrated to a whole turn counts from its zero.
    jaw = 0.0 if 5 in kind.whole_turns else 0.5 * (joints.lower[5] + joints.upper[5])
    np.testing.assert_allclose(joints.joints(middle), [0.0] * 5 + [jaw], atol=1e-3)
    for ticks in (middle + 100, middle - 333):
        np.testing.assert_array_equal(joints.ticks(joints.joints(ticks)), ticks)
    assert (joints.ticks(np.full(6, 9.0)) <= [m.range_max for m in own.values()]).all()
    turned = {**own, "elbow_flex": msgspec.structs.replace(own["elbow_flex"], drive_mode=1)}
    # A Dynamixel motor has turned around by itself.
    sign = -1 if name == "so101" else 1
    assert ServoJoints(turned, arm, kind).scale[2] == sign * joints.scale[2]
    assert ServoJoints(own, arm, kind, ["elbow_flex"]).scale[2] == -joints.scale[2]
    shifted = middle + 4096 * np.arange(6)
    turns = 4096 * np.arange(6) * (name != "so101")
    np.testing.assert_array_equal(joints.turns(shifted), turns)


def test_another_arm_and_another_motor_are_refused(robot: Robot, arm: Robot) -> None:
    with pytest.raises(ConfigurationError, match="is not an SO-100 or SO-101: it needs the joints"):
        ServoJoints(calibration(), robot)
    with pytest.raises(ConfigurationError, match="No motor is called elbow, but shoulder_pan"):
        ServoJoints(calibration(), arm, reversed_motors=["elbow"])


@pytest.mark.parametrize("terminal", [False, True])
def test_bus_scans_reads_writes_and_changes_ids(
    server: ServoServer, kind: ServoArm, terminal: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(bus, "SCAN_DEADLINE", 0.3)
    address = DeviceAddress("127.0.0.1", server.port)
    if terminal:
        pytest.importorskip("serial")
        address = DeviceAddress(server.terminal, None)
    make, first = kind.make, kind.first_id
    motors = MotorBus(open_port(address, "the arm"), make)
    try:
        ids = tuple(range(first, first + 6))
        assert motors.scan(range(first, first + 8)) == ids
        assert tuple(motors.read(number, make.model) for number in ids) == kind.models
        assert motors.errors(first) == 0
        motors.write(first + 5, make.id, first + 7)
        assert motors.scan((first + 5, first + 7)) == (first + 7,)
        motors.write_all(
            make.goal_position, {first: 2000, first + 2: -1 if make.counts_turns else 9}
        )
        assert motors.read(first, make.goal_position) == 2000
        assert motors.read(first + 2, make.goal_position) == (-1 if make.counts_turns else 9)
        if make is DYNAMIXEL:
            motors.write(first, make.torque_enable, 1)
            with pytest.raises(MotorRequestError, match=rf"Motor {first} refuses .*\(error 7\)"):
                motors.write(first, make.id, 9)
        with server.lock:
            server.arm.lost = 0.05
        values = [motors.read(first + 1, make.force_limit) for _ in range(30)]
        assert set(values) == {make.full_force}, "an answer that lost a byte is no answer"
    finally:
        motors.close()


def test_arm_follows_its_setpoints_and_rests_at_them(server: ServoServer, loop: SmallLoop) -> None:
    assert torques(server) == [0] * 6
    engage(loop)
    start = loop.measured
    move(loop)
    time.sleep(1.5)
    target = loop.setpoint(time.perf_counter())
    loop.setpoint = lambda _: target

    def rests() -> bool:
        # A step of a motor is 0.09 degrees; the rest is the weight, which no motor holds exactly.
        near = np.degrees(np.abs(loop.measured - target)).max() < 4.5
        return bool(near) and loop.report.mode is ArmMode.HOLDING

    wait_until(rests, "the arm rests at its setpoint")
    assert np.abs(loop.measured - start)[:5].max() > 0.1
    report = loop.report
    assert report.note == ""
    # Loads, then voltages and temperatures.
    assert report.sensors[6:] == (7.4,) * 6 + (30.0,) * 6


def test_stop_holds_where_the_arm_is_and_release_alone_lets_it_fall(
    server: ServoServer, loop: SmallLoop
) -> None:
    engage(loop)
    move(loop, 0.8)
    time.sleep(0.5)
    loop.stop()
    wait_until(lambda: loop.report.measured_stop is not None, "the stop is measured")
    stop = loop.report.measured_stop
    assert stop is not None
    assert stop.distance is not None
    assert stop.angle < 0.5
    held = goals(server)
    assert np.abs(np.subtract(held, places(server))).max() < 40
    assert torques(server) == [1] * 6
    for _ in range(3):
        # Neither another stop nor another begin lets it sink.
        loop.clear_stop()
        time.sleep(0.1)
        loop.stop()
        time.sleep(0.1)
    assert np.abs(np.subtract(held, goals(server))).max() < 30
    loop.act(ArmAct.RELEASE, ArmMode.CONNECTED, PATIENCE)
    assert torques(server) == [0] * 6
    assert "off" in loop.report.note


def test_stop_reaches_the_bus_soon(loop: SmallLoop) -> None:
    """The goals of the motors are where the arm is; the machine may be busy meanwhile."""
    engage(loop)
    times = []
    for _ in range(20 if LONG else 4):
        move(loop, 0.6)
        time.sleep(0.3)
        pressed = time.perf_counter()
        loop.stop()
        wait_until(lambda: not loop.driver._machine._setpoints, "the stop is taken")  # type: ignore[attr-defined]
        wait_until(lambda: not loop.driver._machine.hurries, "the stop is sent")  # type: ignore[attr-defined]
        times.append(time.perf_counter() - pressed)
        wait_until(lambda: loop.report.mode is ArmMode.HOLDING, "the arm rests")
        loop.clear_stop()
    print(f"STOP to the bus: median {1e3 * float(np.median(times)):.0f} ms, {max(times):.3f} s")
    assert np.median(times) < 0.5


@dataclass(frozen=True)
class Fault:
    """A fault of a motor, which comes and goes, and what is reported of it."""

    name: str
    words: str
    mode: ArmMode = ArmMode.FAULT

    def put(self, server: ServoServer, number: int, *, present: bool) -> None:
        motor = server.arm.motors[number]
        with server.lock:
            if self.name in ("silent", "blocked"):
                setattr(motor, self.name, present)
            elif self.name == "reset":
                if present:
                    motor.reboot()
            else:
                bits = {name: bit for bit, name in motor.make.errors.items()}
                motor.fault = bits[self.name] if present else 0


FAULTS = (
    *(Fault(name, text) for name, text in machine.ERRORS.items()),
    Fault("silent", "No answer of"),
    Fault("reset", "is limp: it was reset"),
    Fault("blocked", "Something blocks", ArmMode.COLLIDED),
)


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.name)
def test_fault_stops_the_arm_where_it_is_with_a_true_sentence(
    server: ServoServer, kind: ServoArm, loop: SmallLoop, fault: Fault
) -> None:
    errors = kind.make.errors.values()
    if fault.name in machine.ERRORS and fault.name not in errors:
        pytest.skip("the motors report no such error")
    chance = random.Random(fault.name)
    engage(loop)
    for _ in range(ROUNDS):
        number = chance.choice((1, 2) if fault.name == "blocked" else range(5))
        move(loop, chance.uniform(0.2, 0.5))
        time.sleep(chance.uniform(0.1, 0.5))
        if fault.name == "blocked":
            # It pushes against something that is a little before its goal.
            target = loop.measured + np.where(np.arange(6) == number, np.radians(6.0), 0.0)
            loop.setpoint = lambda _, target=target: target  # type: ignore[misc]
        fault.put(server, number, present=True)
        loop.wait(fault.mode, PATIENCE)
        note = loop.report.note
        assert fault.words in note
        if fault.name in errors:
            assert "(7.4 V, 30 °C)" in note
        assert list(calibration())[number] in note
        # As the session does for a report that does not follow.
        loop.stop()
        time.sleep(0.15)
        held = goals(server)
        time.sleep(0.15)
        assert goals(server) == held, "nothing moves the goals after a fault"
        others = [place for place in range(5) if place != number]
        apart = np.abs(np.subtract(held, places(server)))[others]
        assert apart.max() < 60, "the other motors hold the arm where it is"
        assert [torques(server)[place] for place in others] == [1] * 4
        fault.put(server, number, present=False)
        loop.act(ArmAct.UNBLOCK, ArmMode.HOLDING, PATIENCE)
        loop.clear_stop()


@pytest.mark.parametrize("how", ["unplugged", "without power"])
def test_lost_arm_is_reported_and_found_again(
    server: ServoServer, loop: SmallLoop, how: str
) -> None:
    engage(loop)
    move(loop)
    with server.lock:
        if how == "unplugged":
            assert server._client is not None
            server._client.shutdown(socket.SHUT_RDWR)
        for motor in server.arm.motors:
            motor.silent = True
    loop.wait(ArmMode.LOST, PATIENCE)
    wait_until(lambda: "Trying to connect" in loop.report.note, "the driver has noticed")
    loop.stop()
    with server.lock:
        for motor in server.arm.motors:
            motor.silent = False
    loop.wait(ArmMode.CONNECTED, PATIENCE)
    assert "Connected again" in loop.report.note
    held = goals(server)
    time.sleep(0.2)
    assert goals(server) == held, "nothing moves before a person engages the arm"
    engage(loop)


def test_bytes_that_are_lost_stop_nothing(server: ServoServer, loop: SmallLoop) -> None:
    engage(loop)
    with server.lock:
        server.arm.lost = 0.02
    move(loop)
    time.sleep(2.0)
    assert loop.report.mode.follows, loop.report.note


def refused(loop: SmallLoop) -> str:
    loop.driver.perform(ArmAct.CONNECT, 0.0)
    first = loop.report.note
    wait_until(lambda: loop.report.note not in (first, "Connecting to the arm."), "an answer")
    assert loop.report.mode is ArmMode.DISCONNECTED
    return loop.report.note


def test_wrong_id_is_named(server: ServoServer, kind: ServoArm, loop: SmallLoop) -> None:
    with server.lock:
        server.arm.motors[3][kind.make.id] = 9
    note = refused(loop)
    assert f"No answer of wrist_flex (id {kind.first_id + 3}). A motor answers as id 9" in note


def test_foreign_calibration_and_wrong_mode_are_refused(
    server: ServoServer, kind: ServoArm, arm: Robot
) -> None:
    own = calibration(kind)
    own["elbow_flex"] = msgspec.structs.replace(own["elbow_flex"], homing_offset=5)
    with driven(server, arm, own=own, kind=kind) as loop:
        assert "homing offset of elbow_flex is 0 in the motor and 5" in refused(loop)
    with server.lock:
        server.arm.motors[2][kind.make.mode] = 1
    with driven(server, arm, kind=kind) as loop:
        assert "elbow_flex is in operating mode 1, in which it holds no position" in refused(loop)
    assert torques(server) == [0] * 6


@pytest.mark.parametrize("kind", ["so101"], indirect=True)
def test_arm_beyond_its_limit_does_not_jump(server: ServoServer, arm: Robot) -> None:
    """The pan is 20 degrees beyond its limit, in a range that was calibrated wider."""
    own, pan, place = calibration(), server.arm.motors[0], 2070 + round(130.0 / 360.0 * 4096)
    own["shoulder_pan"] = msgspec.structs.replace(own["shoulder_pan"], range_min=45, range_max=4095)
    with server.lock:
        pan[pan.make.min_position], pan[pan.make.max_position] = pan._ends = 45, 4095
        pan.place = float(place)
    with driven(server, arm, own=own) as loop:
        connect(loop)
        wait_until(lambda: "shoulder_pan is beyond its limit" in loop.report.note, "it is named")
        loop.act(ArmAct.ENGAGE, ArmMode.HOLDING, PATIENCE)
        assert goals(server)[0] == place
        engage(loop)
        move(loop)
        loop.stop()
        wait_until(lambda: loop.report.mode is ArmMode.HOLDING, "the arm rests")
        assert abs(goals(server)[0] - places(server)[0]) < 10
        assert places(server)[0] > place - 100


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"calibration": "c.json"}, "--calibration needs a real arm"),
        ({"driver": "koch"}, "--driver needs a real arm"),
        ({"device": "tcp://h", "driver": "koch"}, "A Koch v1.1 needs --calibration FILE"),
        ({"device": "tcp://h"}, "needs --calibration FILE"),
        ({"device": "tcp://h", "calibration": "none.json"}, "cannot be read"),
        ({"device": "h", "calibration": "c.json"}, "is not the address of a device"),
    ],
)
def test_options_that_name_no_such_arm_are_refused(
    arm: Robot, options: dict[str, str], message: str
) -> None:
    defaults: dict[str, object] = dict.fromkeys(("device", "calibration", "arm_log", "driver"))
    defaults["reversed"] = []
    paths = {name: Path(value) for name, value in options.items() if name == "calibration"}
    with pytest.raises(KatanaError, match=message):
        driver(Namespace(**defaults | options | paths), arm, np.zeros(5), 0.0)


@pytest.mark.long
def test_server_drives_the_emulated_process_by_its_page_requests(tmp_path: Path) -> None:
    file = tmp_path / "calibration.json"
    with emulator_process("so101", "--calibration", str(file)) as (process, port):
        device = ("--device", f"tcp://127.0.0.1:{port}", "--calibration", str(file))
        with (
            AppServer((*APP, "--arm", "so101", *device)) as server,
            connect_client(server.url, "Ada") as client,
        ):

            def arm() -> answers.MeasuredArm:
                report = client.query(answers.State).arm
                assert report is not None
                return report

            client.ask(requests.OperateArm(act=ArmAct.CONNECT))
            wait_until(lambda: arm().mode == "connected", "connected")
            client.ask(requests.OperateArm(act=ArmAct.ENGAGE, confirmed=True))
            wait_until(lambda: arm().mode == "holding", "holding")
            time.sleep(1.1)
            client.clear_stop()
            start = np.array(client.query(answers.State).q)
            target = start + np.array((0.6, 0.5, -0.5, -0.4, 0.3))
            client.ask(requests.Joints(q=target))
            wait_until(
                lambda: np.abs(np.array(client.query(answers.State).q) - target).max() < 0.08,
                "the arm is where it was sent",
            )
            assert client.query(answers.State).stopped is None
            process.kill()
            wait_until(lambda: arm().mode == "lost", "lost")
            assert client.query(answers.State).stopped is not None
