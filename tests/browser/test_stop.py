"""Stops on the page: requested or confirmed by the arm, and the persons who may clear them."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from tests.browser.camera import Drawing
from tests.browser.conftest import OpenPage
from tests.browser.page import ViserPage
from tests.browser.server import AppServer
from tests.browser.session import Truth, bar, clear_stop, mood

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="freezes a process")


def offers_clear_stop(page: ViserPage) -> bool:
    return page.page.locator("#clear-stop").is_visible()


def wait_headline(page: ViserPage, words: str) -> None:
    page.wait_until(lambda: bar(page, "headline") == words, words)


def test_stop_is_confirmed_on_its_own_port_while_the_web_server_is_frozen(
    page: ViserPage, server: AppServer, truth: Truth, artefacts: Path
) -> None:
    driver = page
    with server.frozen(server.front):
        driver.page.keyboard.press("Space")
        wait_headline(driver, "Stopped")
        driver.wait_until(lambda: "confirmed the stop" in bar(driver, "banner"), "the banner")
        assert "pressed STOP" in bar(driver, "why")
        assert driver.page.locator("#stop.asked").count() == 0
        driver.keep(artefacts / "stop-on-its-own-port.png")
    truth.wait(stop="confirmed")
    me = bar(driver, "name").partition(",")[0]
    assert truth.status()["stopped"] == f"{me} pressed STOP."
    driver.wait_until(lambda: ": You pressed STOP." in bar(driver, "why"), "time and presser")
    clear_stop(driver, truth)


def test_clear_stop_is_disabled_with_the_reason_until_it_is_possible(
    page: ViserPage, truth: Truth, artefacts: Path
) -> None:
    driver = page
    button = driver.page.locator("#clear-stop")
    # Each press begins the time again.
    for _ in range(3):
        driver.page.keyboard.press("Space")
        driver.page.wait_for_timeout(200)
    driver.wait_until(button.is_visible, "the button")
    assert button.is_disabled()
    assert "Clear the stop" in (button.get_attribute("title") or "")
    driver.keep(artefacts / "clear-stop-later.png")
    driver.wait_until(button.is_enabled, "the end of the time")
    assert button.get_attribute("title") == ""
    clear_stop(driver, truth)


def test_page_tells_a_requested_stop_from_a_confirmed_one(
    page: ViserPage, server: AppServer, open_page: OpenPage, artefacts: Path
) -> None:
    driver, other = page, open_page(server.url, drawing=Drawing.NONE)
    me = bar(driver, "name").partition(",")[0]
    with server.frozen(server.arm):
        wait_headline(other, "No answer from the arm")
        assert mood(other.page) == "lost"
        other.page.keyboard.press("Space")
        for window in (driver, other):
            wait_headline(window, "Stop requested")
            assert mood(window.page) == "stopped"
            assert "The arm has not confirmed the stop." in bar(window, "why")
        assert other.page.locator("#stop.asked").count() == 1
        other.keep(artefacts / "stop-requested.png")
    for window in (driver, other):
        wait_headline(window, "Stopped")
        assert mood(window.page) == "stopped"
    assert other.page.locator("#stop.asked").count() == 0
    # Clear stop is offered only to a person who may use it; the other page names that person.
    assert offers_clear_stop(driver)
    assert bar(driver, "why").endswith("Press Clear stop to continue.")
    assert not offers_clear_stop(other)
    assert bar(other, "why").endswith(f"{me} can clear the stop.")
    other.keep(artefacts / "stop-of-another.png")
    driver.press_in_bar("Clear stop")
    other.wait_until(lambda: mood(other.page) == "ok", "the stop to be cleared")
    # Without a driver everybody here may clear the stop.
    driver.press_in_bar("Release")
    driver.page.keyboard.press("Space")
    other.wait_until(lambda: offers_clear_stop(other), "the offer")
    other.press_in_bar("Clear stop")
    other.wait_until(lambda: not offers_clear_stop(other), "the stop to be cleared")
    assert other.errors == []
