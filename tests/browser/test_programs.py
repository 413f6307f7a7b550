"""Programs on the page of a person who previews, pauses, stops and continues them."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from katana450.client import Client, connect
from katana450.server.api import answers
from tests.browser.conftest import OpenPage
from tests.browser.page import ViserPage
from tests.browser.server import AppServer
from tests.browser.session import MOVE, Truth, bar, clear_stop, resume, take
from tests.browser.sizes import PHONE, PORTRAIT
from tests.gateway.test_programs import wait as wait_progress
from tests.waiting import state_when

pytestmark = pytest.mark.long

STEP_3 = ".steps li:nth-child(3) button"

PLANNED = 60.0
"""Timeout [s] of every plan here, on a busy machine."""


@pytest.fixture
def page(page: ViserPage) -> ViserPage:
    page.open_tab("Programs")
    return page


@pytest.fixture
def arm(server: AppServer) -> Iterator[Client]:
    with connect(server.url, "Test") as arm:
        yield arm


def orders(page: ViserPage) -> list[str]:
    """Return the labels of the buttons in the bar that steer the program."""
    return page.page.locator("#orders button").all_inner_texts()


def until(page: ViserPage, shown: str, seconds: float = PLANNED) -> None:
    """Wait until the bar's headline matches ``shown``."""
    page.wait_until(
        lambda: re.fullmatch(shown, bar(page, "headline")) is not None, shown, seconds=seconds
    )


def test_pause_during_planning_lasts_until_resume(
    page: ViserPage, arm: Client, artefacts: Path
) -> None:
    page.choose("Script", "Square")
    page.click_button("Run")
    until(page, r"Planning Square \d+ %")
    assert orders(page) == ["Cancel"]
    height = page.page.locator("header").bounding_box()
    pause = page.page.locator("#pause")
    page.press_in_bar("Pause")
    page.wait_until(lambda: pause.inner_text() == "Resume", "the pause")
    assert "Paused by you. " in page.page.inner_text("#why")
    assert page.page.locator("header").bounding_box() == height
    page.keep(artefacts / "planning-paused.png")
    until(page, r"Paused by you, \S+( [AP]M)?")
    page.wait_until(lambda: "Square: " in page.page.inner_text("#why"), "the program to begin")
    before = arm.query(answers.State)
    page.page.wait_for_timeout(200)
    after = arm.query(answers.State)
    assert after.q == before.q
    page.press_in_bar("Resume")
    until(page, r"Square: .*, step \d+ of \d+.*", 5.0)
    state_when(arm, lambda state: state.moving)
    page.keep(artefacts / "planning-running.png")
    # The same controls change the pace of the program.
    page.press_in_bar("Pause")
    until(page, r"Paused by you, .*", 5.0)
    resume(page)
    until(page, r"Square: .*", 5.0)
    page.page.get_by_role("slider", name="Speed in percent").fill("30")
    state_when(arm, lambda state: state.speed == 0.3)
    assert page.page.inner_text("#speed output") == "30 %"
    assert not page.page.locator("#toast.shown").is_visible()
    page.press_in_bar("STOP")
    state_when(arm, lambda state: state.stopped is not None and not state.moving)
    page.press_in_bar("Clear stop")
    until(page, "On target", 5.0)


def test_steps_of_a_program_are_controlled_in_the_list(
    server: AppServer, open_page: OpenPage, truth: Truth, artefacts: Path
) -> None:
    page = open_page(server.url, nodes=("/arm", MOVE), window=PORTRAIT, own_camera=True, **PHONE)
    take(page)
    page.frame.locator("#k450-sheet").tap()
    page.frame.get_by_role("tab", name="Programs").click()
    page.frame.get_by_role("button", name="Preview").click()
    page.frame.locator(STEP_3).first.wait_for(timeout=60_000)
    # The tab has the width of the panel.
    panel = page.frame.locator(".steps").bounding_box()
    tabs = page.frame.locator("[role=tablist]").bounding_box()
    assert panel is not None
    assert tabs is not None
    assert panel["width"] >= 0.8 * tabs["width"]

    with connect(server.url, "Reader") as reader:
        pause = page.frame.locator(f"{STEP_3}[name=pause]")
        pause.click()
        wait_progress(reader, lambda run: run.breakpoints == (3,))
        page.wait_until(lambda: pause.get_attribute("aria-pressed") == "true", "the breakpoint")
        # The list is drawn again, and the button keeps the focus.
        page.wait_until(lambda: pause.evaluate("each => each.matches(':focus')"), "the focus")
        page.keep(artefacts / "run_control.png")
        page.frame.locator(".steps li:nth-child(2) button[name=run]").click()
        wait_progress(reader, lambda run: run.status == "running" and run.step == 2)
        page.press_in_bar("STOP")
        wait_progress(reader, lambda run: run.status == "stopped")
        truth.wait(moving=False)
        clear_stop(page, truth)
        page.page.get_by_role("button", name="Continue ").click()
        end = page.page.get_by_role("button", name="End", exact=True).element_handle()
        wait_progress(reader, lambda run: run.status == "paused" and run.step == 3)
        # A button that is replaced with every step would lose a press.
        page.wait_until(lambda: "step 3" in page.page.inner_text("#why"), "the step in the bar")
        assert end.evaluate("each => each.isConnected")
        pause.click()
        wait_progress(reader, lambda run: run.breakpoints == ())
        resume(page)
        wait_progress(reader, lambda run: run.status == "done")
    assert page.errors == []
