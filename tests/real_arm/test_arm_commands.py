"""The commands ``katana450 arm`` and ``katana450 emulate`` against an emulated arm."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from katana450.extensions.real_arm.codec import requests as req
from katana450.extensions.real_arm.emulator.arm import EmulatedArm
from katana450.extensions.real_arm.emulator.axis import AxisMode
from katana450.extensions.real_arm.emulator.server import EmulatorServer
from katana450.extensions.real_arm.exchange_lines import ExchangeDecoder
from katana450.extensions.real_arm.link import ArmLink, ExchangeLog, TcpTransport
from tests.browser.server import free_port
from tests.commands import completed
from tests.real_arm.emulated import TIMEOUT

KATANA450 = (sys.executable, "-m", "katana450")


@pytest.fixture
def server() -> Iterator[EmulatorServer]:
    server = EmulatorServer(EmulatedArm(calibration_scale=50.0), "127.0.0.1", 0)
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
    done = katana450("arm", "probe", url, "--repeat", "3", "--out", str(out))
    assert done.returncode == 0, done.stderr
    report = json.loads(out.read_text())
    readings = report["readings"]
    assert readings["master firmware"]["fields"] == {"version": 2, "revision": 1}
    assert readings["states"]["fields"]["states"] == [0] * 6
    assert readings["positions"]["reply"] == "6e" + " 00" * 12
    assert len(readings["sensors"]["fields"]["values"]) == 16
    times = readings["states"]["times_ms"]
    assert 0.0 < times["min"] <= times["median"] <= times["p95"] <= times["max"] < 1000.0
    text = out.with_suffix(".txt").read_text()
    assert "State of axis 1: 0 (its motor is off)" in text
    assert "the depth of the buffer of polynomials" in text
    assert {axis.mode for axis in server.arm.axes} == {AxisMode.OFF}, (
        "no motor was ordered anything"
    )


def test_probe_without_an_arm_says_so_and_keeps_what_it_has(tmp_path: Path) -> None:
    out = tmp_path / "probe.json"
    done = katana450("arm", "probe", "tcp://127.0.0.1:9", "--out", str(out))
    assert done.returncode == 1
    assert "no connection" in done.stderr
    assert "lost" in json.loads(out.read_text())


def test_log_shows_the_exchanges_in_words(server: EmulatorServer, tmp_path: Path) -> None:
    file = tmp_path / "exchanges.log"
    log = ExchangeLog(file)
    link = ArmLink(TcpTransport("127.0.0.1", server.port), log=log)
    link.exchange(req.ReadMasterVersion())
    with pytest.raises(Exception, match="not calibrated"):
        link.exchange(req.CommandMotor(2, req.MotorFlag.MOVE, 100))
    link.close()
    log.close()
    done = katana450("arm", "log", str(file))
    assert done.returncode == 0, done.stderr
    lines = [line[13:] for line in done.stdout.splitlines()]
    assert lines[0] == "connected"
    assert lines[1] == "> ReadMasterVersion"
    assert lines[2].startswith("< MasterVersion version 2, revision 1  [")
    assert lines[3] == "> CommandMotor axis 2, flag 24, value 100"
    assert lines[4].startswith("< refused")
    assert lines[5] == "> ErrorQuery"
    assert "axis is not calibrated" in lines[6]


def test_line_that_is_none_of_a_log_is_reported() -> None:
    decoder = ExchangeDecoder()
    assert decoder.words("nonsense\n") == ["This is not a line of a log: nonsense"]
    assert "nothing for" in decoder.words("1.0 <\n")[0]


def test_missing_log_is_reported(tmp_path: Path) -> None:
    done = katana450("arm", "log", str(tmp_path / "none"))
    assert done.returncode == 1
    assert "cannot be read" in done.stderr


@pytest.mark.long
@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--arm", "192.168.1.1"), "is not the address of an arm"),
        (("--arm-log", "exchanges.log"), "needs an arm"),
        (("--arm", "tcp://127.0.0.1", "--arm-log", "/nowhere/exchanges.log"), "cannot be written"),
        (
            ("--arm", "tcp://127.0.0.1", "--urdf", "tests/exchange/gantry.urdf"),
            "only by turning axes",
        ),
    ],
)
def test_server_refuses_an_arm_that_it_cannot_drive(options: tuple[str, ...], words: str) -> None:
    done = katana450("serve", "--port", str(free_port()), "--no-log", "--no-record", *options)
    assert done.returncode != 0
    assert words in done.stderr


@pytest.mark.parametrize(
    "options",
    [
        *(
            ("--port", "70000"),
            ("--object", "nan"),
            ("--calibration-scale", "0"),
        ),
        ("--plant", "rubber"),
    ],
)
def test_wrong_options_of_the_emulator_are_refused(options: tuple[str, str]) -> None:
    done = katana450("emulate", *options)
    assert done.returncode == 2
    assert repr(options[1]) in done.stderr
    # No name of the code in it.
    assert "invalid _" not in done.stderr
