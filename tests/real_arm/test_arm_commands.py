"""Wrong options of ``katana450 serve`` with a real arm, and of ``katana450 emulate``."""

from __future__ import annotations

import subprocess
import sys

import pytest

from tests.browser.server import free_port
from tests.commands import completed
from tests.real_arm.emulated import TIMEOUT

KATANA450 = (sys.executable, "-m", "katana450")


def katana450(*options: str, text: str = "") -> subprocess.CompletedProcess[str]:
    done = completed([*KATANA450, *options], text=text, seconds=TIMEOUT)
    assert "Traceback" not in done.stderr
    return done


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
