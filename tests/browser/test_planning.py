"""Programs during planning, on the page of a person who steers them."""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from katana450.client import Client, connect
from katana450.extensions.programs.server.idle_planner import DELAY
from katana450.server.api import answers
from tests.browser.conftest import Windows
from tests.browser.page import ViserPage
from tests.browser.server import RECORDING_APP, AppServer
from tests.browser.session import bar

pytestmark = pytest.mark.long

PLANNED = 60.0
"""Timeout [s] of every plan here, on a busy machine."""


@pytest.fixture(scope="module")
def page(server: AppServer, windows: Windows) -> Iterator[ViserPage]:
    with windows.open(server.url, nodes=("/arm", "/target/move")) as page:
        page.open_tab("Programs")
        yield page
        assert page.errors == []


@pytest.fixture
def arm(server: AppServer) -> Iterator[Client]:
    with connect(server.url, "Test") as arm:
        yield arm


def headline(page: ViserPage) -> str:
    return bar(page, "headline")


def orders(page: ViserPage) -> list[str]:
    """Return the labels of the buttons in the bar that steer the program."""
    return page.page.locator("#orders button").all_inner_texts()


def press(page: ViserPage, label: str) -> None:
    page.page.locator("#orders").get_by_role("button", name=label, exact=True).click()


def until(page: ViserPage, shown: str, seconds: float = PLANNED) -> None:
    """Wait until the bar's headline matches ``shown``."""
    page.wait_until(lambda: re.fullmatch(shown, headline(page)) is not None, shown, seconds=seconds)


def wait(arm: Client, condition: Callable[[answers.State], bool]) -> answers.State:
    due = time.monotonic() + PLANNED
    while not condition(state := arm.query(answers.State)):
        assert time.monotonic() < due, state
        time.sleep(0.02)
    return state


def test_a_cancelled_preview_leaves_the_planner_free(page: ViserPage, artefacts: Path) -> None:
    page.choose("Script", "Pour")
    page.click_button("Preview")
    until(page, r"Planning Pour \d+ %")
    assert orders(page) == ["Cancel"]
    assert "does not start by itself" in page.page.inner_text("#why")
    page.keep(artefacts / "planning.png")
    press(page, "Cancel")
    until(page, "On target", 2.0)
    page.wait_until(lambda: "cancelled" in page.text_of(".k450.program"), "the panel to say so")
    assert orders(page) == []


def test_previewed_plan_shows_one_duration_and_runs_immediately(
    page: ViserPage, arm: Client, artefacts: Path
) -> None:
    page.choose("Script", "Pour")
    page.click_button("Preview")
    state = wait(arm, lambda state: state.program is not None and state.program.status == "ready")
    assert state.program is not None
    page.wait_until(lambda: "of motion" in page.text_of(".k450.program"), "its length")
    duration = re.search(r"([\d.]+) s of motion", page.text_of(".k450.program"))
    assert duration is not None
    thumb = page._labelled("Look at").get_by_role("slider")
    end = float(thumb.get_attribute("aria-valuemax") or 0)
    assert float(duration[1]) == pytest.approx(end)
    assert state.program.seconds <= end < state.program.seconds + 0.1
    page.keep(artefacts / "planning-previewed.png")
    # The cup is in the hand of the ghost, with its water; the time is given in words.
    shown = page.drag_slider("Look at", 7.5)
    page.wait_until(lambda: f"{shown:.1f} s of {end:.1f} s" in page.panel_text(), "the time")
    visible = """() => ["/path/ghost", "/path/objects/0", "/path/water/cup"].every(
        (name) => __viserMutable.nodeRefFromName[name]?.visible)"""
    page.wait_until(lambda: page.frame.evaluate(visible), "the ghosts", seconds=PLANNED)
    page.wait_until(lambda: "over basin" in page.text_of(".steps [aria-current]"), "the step")
    page.keep(artefacts / "planning-sought.png")
    begun = time.monotonic()
    page.click_button("Run")
    wait(arm, lambda state: state.program is not None and state.program.status == "running")
    assert time.monotonic() - begun < 2.0
    page.press_in_bar("STOP")
    wait(arm, lambda state: state.stopped is not None and not state.moving)
    page.press_in_bar("Clear stop")
    until(page, "On target", 5.0)


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
    page.page.wait_for_timeout(1500)
    after = arm.query(answers.State)
    assert after.q == before.q
    page.press_in_bar("Resume")
    until(page, r"Square: .*, step \d+ of \d+.*", 5.0)
    wait(arm, lambda state: state.moving)
    page.keep(artefacts / "planning-running.png")
    # The same controls change the pace of the program.
    page.press_in_bar("Pause")
    until(page, r"Paused by you, .*", 5.0)
    # A press just after the button changed may have meant Pause, and is ignored.
    page.page.wait_for_timeout(600)
    page.press_in_bar("Resume")
    until(page, r"Square: .*", 5.0)
    page.page.get_by_role("slider", name="Speed in percent").fill("30")
    wait(arm, lambda state: state.speed == 0.3)
    assert page.page.inner_text("#speed output") == "30 %"
    assert not page.page.locator("#toast.shown").is_visible()
    page.press_in_bar("STOP")
    wait(arm, lambda state: state.stopped is not None and not state.moving)
    page.press_in_bar("Clear stop")
    until(page, "On target", 5.0)


def test_demonstration_was_planned_while_nobody_used_the_server(windows: Windows) -> None:
    with (
        AppServer(RECORDING_APP) as server,
        windows.open(server.url, nodes=("/arm", "/target/move")) as page,
        connect(server.url, "Test") as arm,
    ):
        page.open_tab("Programs")
        page.choose("Script", "Pour")
        page.page.wait_for_timeout(1000.0 * (DELAY + 30.0))
        begun = time.monotonic()
        page.click_button("Run")
        wait(arm, lambda state: state.program is not None and state.program.status == "running")
        assert time.monotonic() - begun < 1.0
        page.press_in_bar("STOP")
        assert page.errors == []
