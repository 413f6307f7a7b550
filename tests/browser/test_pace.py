"""Pause, Resume and Speed in the bar: for a hand, by mouse and keys, or refused with a reason."""

from __future__ import annotations

from pathlib import Path

import pytest

from katana450.client import connect
from katana450.server.api import requests
from tests.browser.conftest import OpenPage
from tests.browser.page import ViserPage
from tests.browser.server import AppServer
from tests.browser.session import Truth, bar, clear_stop, take


def slider(page: ViserPage) -> str:
    return page.page.locator("#speed input").input_value()


@pytest.mark.long
def test_motion_by_hand_is_paused_resumed_and_slowed_in_the_bar(
    server: AppServer, open_page: OpenPage, artefacts: Path
) -> None:
    page, other = (open_page(server.url, nodes=("/arm",)) for _ in range(2))
    truth = Truth(server)
    take(page)
    # Keys change the speed; 1 % is the step.
    page.page.focus("#speed input")
    page.page.keyboard.press("ArrowLeft")
    truth.wait(speed=0.99)
    page.page.locator("#speed input").fill("10")
    truth.wait(speed=0.1)
    other.wait_until(lambda: slider(other) == "10", "the speed at the other page")
    # A page that does not drive says why its press changes nothing.
    for each in ("#pause", "#speed"):
        assert "drives: ask for the arm." in (other.page.get_attribute(each, "title") or "")
    other.page.click("#pause", force=True)
    other.wait_until(lambda: "drives: ask for the arm." in bar(other, "toast"), "the reason")
    assert other.page.locator("#speed input").is_disabled()
    page.click_button("Go to zero")
    truth.wait(moving=True)
    before = page.page.locator("#pause").bounding_box()
    # The second click of two does not resume.
    page.page.dblclick("#pause", delay=50)
    truth.wait(moving=False, status="paused")
    page.page.wait_for_timeout(500)
    assert truth.status()["status"] == "paused"
    me = bar(page, "name").partition(",")[0]
    page.wait_until(lambda: bar(page, "headline").startswith("Paused by you, "), "the pause")
    other.wait_until(lambda: bar(other, "headline").startswith(f"Paused by {me}, "), "its name")
    assert page.page.locator("#pause").bounding_box() == before
    page.keep(artefacts / "pace-paused.png")
    page.press_in_bar("Resume")
    truth.wait(moving=True)
    page.wait_until(lambda: bar(page, "headline") == "Moving to the target", "the motion")
    page.press_in_bar("STOP")
    page.wait_until(lambda: bar(page, "headline") == "Stopped", "the stop")
    page.wait_until(
        lambda: page.page.get_attribute("#pause", "aria-disabled") == "true", "no Pause"
    )
    clear_stop(page, truth)
    page.page.locator("#speed input").fill("100")
    truth.wait(speed=1.0)
    page.press_in_bar("Release")
    with connect(server.url, "Anna") as anna:
        anna.ask(requests.Acquire())
        page.wait_until(
            lambda: page.page.get_attribute("#pause", "title") == "Anna drives: ask for the arm.",
            "the reason",
        )
    assert page.errors == []
    assert other.errors == []
