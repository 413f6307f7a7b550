"""The commands ``katana450 arm`` and ``katana450 emulate`` against an emulated arm."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from katana450.extensions.real_arm.emulator.arm import EmulatedArm
from katana450.extensions.real_arm.emulator.axis import AxisMode
from katana450.extensions.real_arm.emulator.server import EmulatorServer
from tests.browser.server import free_port
from tests.commands import completed
from tests.real_arm.emulated import TIMEOUT

KATANA450 = (sys.executable, "-m", "katana450")


@pytest.fixture
def server() -> Iterator[EmulatorServer]:
    server = EmulatorServer(EmulatedArm())
    server.start()
    yield server
    server.stop()


def katana450(*options: str, text: str = "") -> subprocess.CompletedProcess[str]:
    done = completed([*KATANA450, *options], text=text, seconds=TIMEOUT)
    assert "Traceback" not in done.stderr
    return done


def test_probe_writes_what_the_arm_tells(server: EmulatorServer, tmp_path: Path) -> None:
    out = tmp_path / "probe.json"
    url = f"tcp://127.0.0.1:{server.port}"
    done = katana450("arm", "probe", url, "--out", str(out))
    assert done.returncode == 0, done.stderr
    report = json.loads(out.read_text())
    readings = report["readings"]
    assert readings["master firmware"]["fields"] == {"version": 2, "revision": 1}
    assert readings["states"]["fields"]["states"] == [0] * 6
    assert readings["positions"]["reply"] == "6e" + " 00" * 12
    assert len(readings["sensors"]["fields"]["values"]) == 16
    times = readings["states"]["times_ms"]
    assert 0.0 < times["min"] <= times["median"] <= times["max"] < 1000.0
    assert "ms  {'states': [0, 0, 0, 0, 0, 0]}" in done.stdout
    assert {axis.mode for axis in server.arm.axes} == {AxisMode.OFF}, (
        "no motor was ordered anything"
    )


def test_probe_without_an_arm_says_so_and_keeps_what_it_has(tmp_path: Path) -> None:
    out = tmp_path / "probe.json"
    done = katana450("arm", "probe", "tcp://127.0.0.1:9", "--out", str(out))
    assert done.returncode == 1
    assert "no connection" in done.stderr
    assert "lost" in json.loads(out.read_text())


@pytest.mark.long
@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--device", "192.168.1.1"), "is not the address of a device"),
        (("--arm-log", "exchanges.log"), "needs a real arm"),
        (
            ("--device", "tcp://127.0.0.1", "--arm-log", "/nowhere/exchanges.log"),
            "cannot be written",
        ),
        (
            ("--device", "tcp://127.0.0.1", "--urdf", "tests/exchange/gantry.urdf"),
            "only by turning axes",
        ),
    ],
)
def test_server_refuses_an_arm_that_it_cannot_drive(options: tuple[str, ...], words: str) -> None:
    done = katana450("serve", "--port", str(free_port()), "--no-log", "--no-record", *options)
    assert done.returncode != 0
    assert words in done.stderr


@pytest.mark.parametrize("options", [("--port", "70000"), ("--calibration-scale", "0")])
def test_wrong_options_of_the_emulator_are_refused(options: tuple[str, str]) -> None:
    done = katana450("emulate", *options)
    assert done.returncode == 2
    assert repr(options[1]) in done.stderr
    # No name of the code in it.
    assert "invalid _" not in done.stderr
