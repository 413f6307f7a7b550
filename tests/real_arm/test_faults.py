"""Faults of the emulated arm: a script is checked, and each fault does what it says."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from katana450.errors import InputError
from katana450.extensions.real_arm.codec import requests as req
from katana450.extensions.real_arm.codec.axis_status import AxisStatus
from katana450.extensions.real_arm.emulator.arm import EmulatedArm
from katana450.extensions.real_arm.emulator.faults import (
    FaultSchedule,
    FaultScript,
    read_fault_script,
)
from katana450.extensions.real_arm.emulator.server import EmulatorServer
from katana450.extensions.real_arm.link.transport import LinkLostError
from tests.real_arm.emulated import linked, raw

ECHO = req.EchoRequest()


def script(text: str, folder: Path) -> FaultScript:
    path = folder / "faults.yaml"
    path.write_text(text)
    return read_fault_script(path)


@contextmanager
def faulty(text: str, folder: Path) -> Iterator[EmulatorServer]:
    faults = script(text, folder)
    server = EmulatorServer(EmulatedArm(calibrated=True), "127.0.0.1", 0, faults)
    server.start()
    try:
        yield server
    finally:
        server.stop()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("faults: [{do: explode}]", "explode"),
        ("faults: [{do: delay}]", "seconds.*faults\\[0\\]"),
        ("faults: [{do: delay, seconds: -1}]", "faults\\[0\\].seconds"),
        ("faults: [{do: stuck_axis, axis: 7}]", "faults\\[0\\].axis"),
        ("faults: [{do: reset, at: 1, after: 2}]", "`at` and `after`"),
        ("faults: [{do: reset, wen: 1}]", "wen"),
        ("fault: []", "fault"),
        ("faults: [", "is no YAML"),
    ],
)
def test_wrong_script_is_refused_with_its_place(text: str, words: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=words):
        script(text, tmp_path)


def test_missing_script_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"none\.yaml cannot be read"):
        read_fault_script(tmp_path / "none.yaml")


def test_script_may_be_json(tmp_path: Path) -> None:
    text = '{"faults": [{"do": "delay", "seconds": 0.04}], "object_mm": 40}'
    assert script(text, tmp_path).object_mm == 40.0


def test_delay_and_jitter_make_replies_late(tmp_path: Path) -> None:
    text = "faults: [{do: delay, seconds: 0.03}, {do: jitter, seconds: 0.02}]"
    with faulty(text, tmp_path) as server, linked(server.port) as link:
        for _ in range(10):
            link.exchange(ECHO)
        times = sorted(link.round_trips)
    assert times[0] >= 0.03
    assert times[-1] - times[0] > 0.004, "no two replies are equally late"


def test_delay_begins_and_ends_by_time(tmp_path: Path) -> None:
    schedule = FaultSchedule(
        script("faults: [{do: delay, seconds: 1, at: 2, lasts: 3}]", tmp_path),
        arm := EmulatedArm(),
    )
    late = []
    for _ in range(7):
        schedule.follow(0)
        late.append(schedule.next_reply().delay)
        arm.step(1.0)
    assert late == [0, 0, 1, 1, 1, 0, 0]


@pytest.mark.parametrize("fault", ["half_reply", "silence", "reset", "wrong_crc"])
def test_spoiled_reply_loses_the_link_after_so_many_requests(fault: str, tmp_path: Path) -> None:
    lasts = ", lasts: 0.3" if fault == "silence" else ""
    text = f"faults: [{{do: {fault}, after: 6{lasts}}}]"
    with faulty(text, tmp_path) as server:
        with linked(server.port) as link:
            for _ in range(5):
                link.exchange(ECHO)
            with pytest.raises(LinkLostError):
                link.exchange(ECHO, 0.1)
        time.sleep(0.3)
        with linked(server.port) as link:
            link.exchange(ECHO)


def test_reset_is_seen_as_a_reset(tmp_path: Path) -> None:
    with faulty("faults: [{do: reset}]", tmp_path) as server, raw(server.port) as client:
        client.sendall(bytes.fromhex("01 18 01 5A 3B 80"))
        with pytest.raises(ConnectionResetError):
            client.recv(16)


def test_stuck_axis_collides_and_is_free_again(tmp_path: Path) -> None:
    arm = EmulatedArm(calibrated=True)
    text = "faults: [{do: stuck_axis, axis: 4, at: 0.5, lasts: 2}]"
    schedule = FaultSchedule(script(text, tmp_path), arm)

    def wait(seconds: float) -> None:
        for _ in range(round(seconds / 0.01)):
            arm.step(0.01)
            schedule.follow(0)

    wait(1.0)
    arm.axes[3].move_to(20000)
    arm.touch()
    wait(1.0)
    assert arm.axes[3].status == AxisStatus.COLLIDED
    wait(1.0)
    arm.freeze(4)
    arm.axes[3].move_to(29000)
    arm.touch()
    wait(2.0)
    assert arm.axes[3].position == pytest.approx(29000, abs=30)


def test_obstacle_stands_in_the_way_of_an_axis(tmp_path: Path) -> None:
    arm = EmulatedArm(calibrated=True)
    text = "faults: [{do: obstacle, axis: 1, encoder: 29000}]"
    FaultSchedule(script(text, tmp_path), arm).follow(0)
    arm.axes[0].move_to(20000)
    for _ in range(300):
        arm.step(0.01)
    assert arm.collided == 1
    assert arm.axes[0].position == pytest.approx(29000, abs=30)


def test_power_cycle_drops_the_client_and_forgets_the_calibration(tmp_path: Path) -> None:
    text = "faults: [{do: power_cycle, after: 3, seconds: 0.2}]"
    with faulty(text, tmp_path) as server:
        with linked(server.port) as link:
            for _ in range(3):
                link.exchange(ECHO)
            time.sleep(0.1)
            with pytest.raises(LinkLostError):
                link.exchange(ECHO)
        time.sleep(0.3)
        with linked(server.port) as link:
            states = link.exchange(req.ReadStates()).states  # type: ignore[attr-defined]
            assert set(states) == {AxisStatus.OFF}
        assert not server.arm.is_calibrated


def test_client_can_be_dropped_from_outside(tmp_path: Path) -> None:
    with faulty("faults: []", tmp_path) as server, linked(server.port) as link:
        link.exchange(ECHO)
        server.drop_client()
        time.sleep(0.1)
        with pytest.raises(LinkLostError):
            link.exchange(ECHO)
