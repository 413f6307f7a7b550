"""The card of a real arm: acts that ask twice, what is measured, and an arm that was lost.

An emulated arm answers. Without viser in its frame, which would take most of the time.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from playwright.sync_api import Page

from katana450.client import Client, connect
from katana450.server.api import answers, requests
from tests.browser.camera import Drawing
from tests.browser.conftest import Windows
from tests.browser.server import APP, AppServer
from tests.browser.session import READY, Truth
from tests.browser.sizes import PHONE, SIZES, WIDE, in_sizes_and_schemes
from tests.browser.test_accessibility import findings
from tests.real_arm.emulated import emulator_process

SECONDS = 20_000
"""[ms] Timeout of each step: other programs may keep the machine busy."""


class Card:
    """A page of an emulated arm."""

    def __init__(self, stack: ExitStack, windows: Windows, *options: str) -> None:
        self.emulator, port = stack.enter_context(emulator_process(*options))
        self.log = Path(stack.enter_context(TemporaryDirectory())) / "exchanges.log"
        arm = ("--device", f"tcp://127.0.0.1:{port}", "--arm-log", str(self.log))
        self.server = stack.enter_context(AppServer((*APP, *arm)))
        self.truth = Truth(self.server)
        self._windows = windows
        self._stack = stack

    def open(self, size: tuple[int, int] = WIDE, **options: object) -> Page:
        """Open the page in a window of this size, and return it."""
        window = self._windows.open(self.server.url, window=size, drawing=Drawing.NONE, **options)
        self.window = self._stack.enter_context(window)
        self.page = self.window.page
        self.page.set_default_timeout(SECONDS)
        self.page.wait_for_selector("#arm")
        return self.page

    def shows(self, words: str, *, place: str = "#arm summary") -> str:
        """Wait until the text at a place begins with ``words``; return it in one line."""
        self.page.wait_for_function(
            "([place, words]) => document.querySelector(place)?.innerText.startsWith(words)",
            arg=[place, words],
        )
        return self.page.inner_text(place).replace("\n", " ")

    def press(self, act: str) -> None:
        self.page.click(f"#arm [data-act={act}]")

    def confirm(self, act: str) -> None:
        """Press the button of ``act``, tick what it asks, and press the button of the question."""
        self.press(act)
        self.page.check("dialog.hazard input")
        self.page.click("dialog.hazard button.main")

    def clear_stop(self) -> None:
        self.page.wait_for_selector("#clear-stop:not([hidden]):enabled")
        self.page.click("#clear-stop")
        self.truth.wait(stopped=None)


@pytest.fixture
def stack() -> Iterator[ExitStack]:
    with ExitStack() as stack:
        yield stack


def test_arm_is_engaged_moved_stopped_released_and_lost(
    stack: ExitStack, windows: Windows, artefacts: Path
) -> None:
    card = Card(stack, windows, "--calibrated")
    page = card.open()
    assert_hazards_are_confirmed(card, artefacts)
    with connect(card.server.url, "Program") as program:
        program.ask(requests.Take())
        assert_stop_is_measured(card, program)
        card.window.press_in_bar("Take over")
        card.press("release")
        assert "the arm falls" in page.inner_text("dialog.hazard")
        page.check("dialog.hazard input")
        page.click("dialog.hazard button.main")
        card.shows("Arm uncalibrated")
        assert page.inner_text("#arm [role=status]") != "", "a sentence about the motors"
        card.confirm("engage")
        card.shows("Arm holding")
        # An arm that is lost may still move.
        program.ask(requests.Take())
        program.clear_stop()
        program.ask(requests.Joints(q=READY))
        card.shows("Arm moving")
        card.emulator.kill()
        card.shows("Arm lost")
        card.shows("Arm lost", place="#headline")
        why = page.inner_text("#why")
        assert "It may still move." in why
        assert "The connection to the arm was lost." in why
        assert why.endswith("If it moves, use its switch.")
        card.window.keep(artefacts / "arm-card-lost.png")
    assert b" > 01 18 4b 48" in card.log.read_bytes(), "polynomials are in the log"
    assert card.window.errors == []


def assert_hazards_are_confirmed(card: Card, artefacts: Path) -> None:
    """Connect and engage the arm."""
    page, truth = card.page, card.truth
    assert card.shows("Arm disconnected")
    assert "No connection" in page.inner_text("#arm [role=status]")
    assert "no emergency stop" in page.inner_text("#arm .why")
    card.press("connect")
    card.shows("Arm uncalibrated")
    card.press("engage")
    dialog = page.locator("dialog.hazard")
    assert "calibrated since it was switched on" in dialog.inner_text()
    assert dialog.locator("button.main").is_disabled(), "the hazard must be confirmed"
    card.window.keep(artefacts / "arm-card-asks.png")
    page.keyboard.press("Escape")
    assert not dialog.is_visible(), "Esc also leaves the question"
    assert truth.status()["arm"]["mode"] == "uncalibrated"
    card.confirm("engage")
    card.shows("Arm holding")
    page.wait_for_selector("#arm .why", state="hidden")
    assert page.locator("#arm button.main").count() == 0, "a working arm needs no act"
    card.clear_stop()


def assert_stop_is_measured(card: Card, program: Client) -> None:
    """Stop a motion, and compare what the card shows with what was measured."""
    page = card.page
    program.ask(requests.Speed(value=0.5))
    program.ask(requests.Joints(q=READY))
    card.shows("Arm moving")
    start = np.array(program.query(answers.State).q)
    card.window.wait_until(
        lambda: np.abs(program.query(answers.State).q - start).max() > 0.1, "the motion"
    )
    page.click("#stop")
    shown = re.fullmatch(
        r"stopped in (\d\.\d\d) s, (\d+) mm", card.shows("stopped in", place="#arm .rested")
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
    page.click("#arm summary")
    assert f"{shown[1]} s, {shown[2]} mm, " in page.inner_text("#arm dl")


@pytest.mark.long
def test_arm_that_calibrates_is_not_shown_as_stopped(stack: ExitStack, windows: Windows) -> None:
    card = Card(stack, windows, "--calibration-scale", "1")
    page = card.open()
    assert "Connect reads the arm. Nothing moves." in page.inner_text("#arm")
    card.press("connect")
    card.shows("Arm uncalibrated")
    assert page.inner_text("#headline") == "Stopped"
    card.confirm("calibrate")
    card.shows("Arm calibrating")
    card.shows("Calibrating", place="#headline")
    why = page.inner_text("#why")
    assert why.startswith("The arm moves by itself.")
    assert why.endswith("STOP ends the calibration.")
    page.click("#stop")
    card.shows("Arm uncalibrated")
    card.shows("STOP ended the calibration", place="#arm [role=status]")
    card.shows("Stopped", place="#headline")
    assert page.inner_text("#why").endswith("Press Clear stop to continue.")
    assert card.window.errors == []


@in_sizes_and_schemes(SIZES)
def test_card_fits_and_is_accessible(
    stack: ExitStack, windows: Windows, size: str, scheme: str, artefacts: Path
) -> None:
    card = Card(stack, windows, "--calibrated")
    touch = {} if size.startswith("wide") else PHONE
    page = card.open(SIZES[size], color_scheme=scheme, **touch)
    card.press("connect")
    card.shows("Arm uncalibrated")
    assert page.evaluate("() => document.documentElement.scrollWidth <= innerWidth")
    card.press("calibrate")
    card.window.keep(artefacts / f"arm-card-asks-{size}-{scheme}.png")
    assert findings(page) == []
