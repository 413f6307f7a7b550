"""The page of a real arm in the states that matter: it calibrates, it was stopped, it was lost.

Without viser in its frame, which would take most of the time.
"""

from __future__ import annotations

import re
import time
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Browser, Page

from katana450.arm.control.arm_commands import ArmAct, OperateArm
from katana450.client import Client, connect
from katana450.server.api import answers, requests
from tests.browser.server import APP, AppServer
from tests.browser.session import READY
from tests.gateway.client import enter
from tests.real_arm.emulated import emulator_process
from tests.real_arm.test_arm_commands import wait_for

SECONDS = 20_000
"""[ms] Timeout of each step: other programs may keep the machine busy."""


class Arm:
    """A page of an emulated arm, and a program at the same server."""

    def __init__(self, stack: ExitStack, browser: Browser, *options: str) -> None:
        self.emulator, port = stack.enter_context(emulator_process(*options))
        arm = ("--arm", f"tcp://127.0.0.1:{port}")
        self.server = stack.enter_context(AppServer((*APP, *arm)))
        context = browser.new_context(viewport={"width": 1280, "height": 800})
        stack.callback(context.close)
        context.route("**/viser/**", lambda route: route.abort())
        self.page: Page = context.new_page()
        self.page.set_default_timeout(SECONDS)
        self.errors: list[str] = []
        self.page.on("pageerror", lambda error: self.errors.append(str(error)))
        enter(self.server.url)
        self.page.goto(self.server.url)
        self.page.wait_for_selector("#arm")

    def shows(self, words: str, *, at: str = "#arm summary") -> str:
        """Wait until the text at a place begins with ``words``; return it in one line."""
        self.page.wait_for_function(
            "([at, words]) => document.querySelector(at)?.innerText.startsWith(words)",
            arg=[at, words],
        )
        return self.page.inner_text(at).replace("\n", " ")

    def act(self, act: str) -> None:
        """Press the button of an act, and confirm its hazard if it has one."""
        self.page.click(f"#arm [data-act={act}]")
        if self.page.locator("dialog.hazard").is_visible():
            self.page.check("dialog.hazard input")
            self.page.click("dialog.hazard button.main")


@pytest.fixture
def stack() -> Iterator[ExitStack]:
    with ExitStack() as stack:
        yield stack


def test_arm_that_calibrates_is_not_shown_as_stopped(
    stack: ExitStack, browser: Browser, artefacts: Path
) -> None:
    arm = Arm(stack, browser, "--calibration-scale", "1")
    assert "Connect reads the arm. Nothing moves." in arm.page.inner_text("#arm")
    arm.act("connect")
    arm.shows("Arm uncalibrated")
    assert arm.page.inner_text("#headline") == "Stopped"
    arm.act("calibrate")
    arm.shows("Arm calibrating")
    arm.shows("Calibrating", at="#headline")
    why = arm.page.inner_text("#why")
    assert why.startswith("The arm moves by itself.")
    assert why.endswith("STOP ends the calibration.")
    arm.page.screenshot(path=artefacts / "arm-states-calibrating.png")
    arm.page.click("#stop")
    arm.shows("Arm uncalibrated")
    arm.shows("STOP ended the calibration", at="#arm [role=status]")
    arm.shows("Stopped", at="#headline")
    assert arm.page.inner_text("#why").endswith("Nothing moves until Clear stop is pressed.")
    assert arm.errors == []


def engaged(arm: Arm, program: Client) -> None:
    for act, mode in ((ArmAct.CONNECT, "uncalibrated"), (ArmAct.ENGAGE, "holding")):
        program.ask(OperateArm(act=act, confirmed=True))
        wait_for(program, mode)
    program.clear_stop()
    arm.shows("Arm holding")


def test_stop_is_shown_as_measured_and_a_lost_arm_as_one_that_may_move(
    stack: ExitStack, browser: Browser, artefacts: Path
) -> None:
    arm = Arm(stack, browser, "--calibrated")
    program = stack.enter_context(connect(arm.server.url, "Program"))
    engaged(arm, program)
    assert arm.page.locator("#arm button.main").count() == 0, "a working arm needs no act"
    program.ask(requests.Speed(value=0.5))
    program.ask(requests.Joints(q=READY))
    arm.shows("Arm moving")
    begun = program.query(answers.State).q
    end = time.monotonic() + 10.0
    while np.abs(np.subtract(program.query(answers.State).q, begun)).max() < 0.1:
        assert time.monotonic() < end
        time.sleep(0.02)
    arm.page.click("#stop")
    shown = re.fullmatch(
        r"stopped in (\d\.\d\d) s, (\d+) mm", arm.shows("stopped in", at="#arm .rested")
    )
    assert shown
    measured = program.query(answers.State).arm
    assert measured is not None
    assert measured.stop_time is not None
    assert measured.stop_distance is not None
    assert measured.stop_angle is not None
    assert shown[1] == f"{measured.stop_time:.2f}"
    assert int(shown[2]) == pytest.approx(1e3 * measured.stop_distance, abs=0.51)
    assert measured.stop_time > 0.02
    assert measured.stop_angle > 0.002
    assert measured.stop_distance > 0.001
    arm.page.click("#arm summary")
    arm.page.screenshot(path=artefacts / "arm-states-stopped.png")
    assert f"{shown[1]} s, {shown[2]} mm, " in arm.page.inner_text("#arm dl")
    program.clear_stop()
    arm.page.wait_for_function(
        "() => document.querySelector('#arm summary').innerText === 'Arm holding'"
    )
    program.ask(requests.Joints(q=READY))
    arm.shows("Arm moving")
    arm.emulator.kill()
    arm.shows("Arm lost")
    arm.shows("Arm lost", at="#headline")
    why = arm.page.inner_text("#why")
    assert why.startswith("It may still move.")
    assert "The connection to the arm was lost." in why
    assert why.endswith("If it moves, use its switch.")
    arm.page.screenshot(path=artefacts / "arm-states-lost.png")
    assert arm.errors == []
