"""The sheets of a phone: the panel with its three heights, and Jog, by finger and keys."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import FloatRect, Locator

from tests.browser.conftest import OpenPage
from tests.browser.finger import fingers, middle
from tests.browser.page import ViserPage
from tests.browser.server import AppServer
from tests.browser.session import Truth, clear_stop, take
from tests.browser.sight import overlap, wait_whole
from tests.browser.sizes import LANDSCAPE, PHONE, PORTRAIT

MOVE = "/target/move"

FINGER = 44.0
"""Minimum width and height of what a finger hits [px]."""

ABOVE = 120.0
"""Height above the full sheet for the buttons that lie over the scene [px]."""


@pytest.fixture
def phone(server: AppServer, open_page: OpenPage) -> Iterator[ViserPage]:
    """Return a phone in portrait, whose person drives."""
    page = open_page(server.url, nodes=("/arm", MOVE), window=PORTRAIT, own_camera=True, **PHONE)
    take(page)
    yield page
    assert page.errors == []


def handle(page: ViserPage) -> Locator:
    return page.frame.locator("#k450-sheet")


def state(page: ViserPage) -> str | None:
    return handle(page).get_attribute("aria-label")


def wait_state(page: ViserPage, height: str) -> None:
    page.wait_until(lambda: state(page) == f"Controls, {height}", height)
    page.page.wait_for_timeout(300)


def box(element: Locator) -> FloatRect:
    found = element.bounding_box()
    assert found is not None, f"{element} is not shown"
    return found


def assert_stop_can_be_pressed(page: ViserPage) -> None:
    place = middle(page.page.locator("#stop"))
    found = page.page.evaluate("(at) => document.elementFromPoint(...at).id", place)
    assert found == "stop"


def drag(page: ViserPage, by: float, seconds: float = 0.4) -> None:
    """Drag the handle of the sheet downwards by ``by`` px."""
    with fingers(page.page) as hand:
        x, y = middle(handle(page))
        hand.put((x, y))
        hand.move((x, y + by), seconds=seconds)
        hand.lift()


@pytest.mark.long
def test_finger_moves_the_panel_between_three_heights(
    phone: ViserPage, server: AppServer, artefacts: Path
) -> None:
    truth = Truth(server)
    frame = box(phone.page.locator("#scene"))
    stop = box(phone.page.locator("#stop"))
    home = phone.frame.get_by_role("button", name="Home", exact=True)

    def top() -> float:
        """Return the height of the sheet's upper edge above the lower edge of the scene [px]."""
        return frame["y"] + frame["height"] - box(handle(phone))["y"]

    wait_state(phone, "folded")
    assert box(handle(phone))["height"] >= FINGER
    folded = top()
    assert folded < 1.3 * FINGER
    # Nothing of the folded panel can get the focus.
    assert home.count() == 0
    wait_whole(phone, "above the folded panel")

    drag(phone, -0.4 * frame["height"])
    wait_state(phone, "half height")
    assert top() == pytest.approx(frame["height"] / 2, abs=2.0)
    assert home.count() == 1
    wait_whole(phone, "above half of the panel")
    phone.keep(artefacts / "sheet-half.png")

    drag(phone, -0.25 * frame["height"])
    wait_state(phone, "full height")
    assert top() == pytest.approx(frame["height"] - ABOVE, abs=2.0)
    assert box(phone.page.locator("#stop")) == stop
    assert_stop_can_be_pressed(phone)
    phone.keep(artefacts / "sheet-full.png")
    # The handle stays when the controls are scrolled.
    phone.frame.get_by_text("Pose by numbers").first.scroll_into_view_if_needed()
    assert top() == pytest.approx(frame["height"] - ABOVE, abs=2.0)
    # A short quick movement is enough.
    drag(phone, 0.2 * frame["height"], seconds=0.06)
    phone.wait_until(lambda: state(phone) != "Controls, full height", "a lower height")
    # The handle still moves.
    phone.page.wait_for_timeout(300)
    drag(phone, 0.7 * frame["height"])
    wait_state(phone, "folded")
    assert top() == pytest.approx(folded, abs=1.0)

    for height in ("half height", "full height"):
        handle(phone).tap()
        wait_state(phone, height)
    phone.page.locator("#stop").tap()
    truth.wait(mood="stopped")
    # What lies over the scene is above the sheet.
    clear = phone.page.locator("#clear-stop:not([hidden])")
    clear.wait_for()
    assert box(clear)["y"] + box(clear)["height"] <= box(handle(phone))["y"]
    clear_stop(phone, truth)
    handle(phone).tap()
    wait_state(phone, "folded")


@pytest.mark.long
def test_keys_and_screen_readers_change_the_height(phone: ViserPage, server: AppServer) -> None:
    truth = Truth(server)
    button = phone.frame.get_by_role("button", name="Controls, folded", exact=True)
    button.wait_for()
    assert button.get_attribute("aria-expanded") == "false"
    handle(phone).focus()
    keyboard = phone.page.keyboard
    for key, height in (
        ("ArrowUp", "half height"),
        ("ArrowUp", "full height"),
        ("ArrowUp", "full height"),
        ("ArrowDown", "half height"),
        ("Enter", "full height"),
        ("Enter", "folded"),
        ("ArrowDown", "folded"),
        ("ArrowUp", "half height"),
    ):
        keyboard.press(key)
        wait_state(phone, height)
    assert handle(phone).get_attribute("aria-expanded") == "true"
    keyboard.press("Space")
    truth.wait(mood="stopped")
    assert state(phone) == "Controls, half height"
    clear_stop(phone, truth)


@pytest.mark.long
def test_swipe_and_arrow_keys_change_the_tab(phone: ViserPage, artefacts: Path) -> None:
    def chosen() -> str:
        return phone.frame.locator("[role=tab][aria-selected=true]").inner_text()

    def swipe(start: Locator, by: float, drop: float = 0.0) -> None:
        with fingers(phone.page) as hand:
            x, y = middle(start)
            hand.put((x, y))
            hand.move((x + by, y + drop), seconds=0.15)
            hand.lift()
        phone.page.wait_for_timeout(200)

    # Tabs that cannot be seen do not change.
    swipe(handle(phone), -120.0)
    wait_state(phone, "folded")
    handle(phone).tap()
    wait_state(phone, "half height")
    assert chosen() == "Drive"
    tabs = phone.frame.get_by_role("tablist")
    for start, by, drop, tab in (
        (handle(phone), -120.0, 20.0, "Programs"),
        (tabs, -120.0, 10.0, "Scene"),
        # There is no tab beyond the last.
        (handle(phone), -120.0, 0.0, "Scene"),
        (tabs, 120.0, 0.0, "Programs"),
        # A short movement is a mistake, and one that is mostly downwards means the height.
        (handle(phone), 20.0, 0.0, "Programs"),
        (tabs, 30.0, -80.0, "Programs"),
    ):
        swipe(start, by, drop)
        assert chosen() == tab, (by, drop)
        assert state(phone) == "Controls, half height"
        phone.keep(artefacts / f"sheet-{tab.lower()}.png")
    swipe(handle(phone), 30.0, -200.0)
    wait_state(phone, "full height")
    assert chosen() == "Programs"
    handle(phone).focus()
    for key, tab in (("ArrowLeft", "Drive"), ("ArrowLeft", "Drive"), ("ArrowRight", "Programs")):
        phone.page.keyboard.press(key)
        phone.wait_until(lambda tab=tab: chosen() == tab, tab)  # type: ignore[misc]
    assert state(phone) == "Controls, full height"
    # The tabs have keys of their own.
    phone.frame.get_by_role("tab", name="Programs").focus()
    phone.page.keyboard.press("ArrowRight")
    phone.wait_until(lambda: chosen() == "Scene", "the next tab")


@pytest.mark.long
def test_one_sheet_is_open_at_a_time(phone: ViserPage, server: AppServer, artefacts: Path) -> None:
    truth = Truth(server)
    jog = phone.page.locator("#jog")
    handle(phone).tap()
    wait_state(phone, "half height")
    phone.page.tap("#jog-button")
    wait_state(phone, "folded")
    phone.page.locator("#gripper button").first.wait_for()
    sheet, shown, stop = (box(each) for each in (jog, handle(phone), phone.page.locator("#stop")))
    for other in (shown, stop):
        # Fractions of a pixel do not count.
        assert not overlap(sheet, other["x"], other["y"], other["width"], other["height"] - 0.5)
    assert_stop_can_be_pressed(phone)
    wait_whole(phone, "above Jog")
    for button in jog.locator("button, .pad, .choice span").all():
        if button.is_visible():
            assert min(box(button)["width"], box(button)["height"]) >= FINGER - 0.5
    assert not any(each.is_visible() for each in jog.locator("kbd").all())
    phone.keep(artefacts / "sheet-jog.png")
    # A pad that is held lets go when the panel takes the place of its sheet.
    with fingers(phone.page) as hand:
        x, y = middle(jog.locator("#lift"))
        hand.put((x, y))
        hand.move((x, y - 40.0), seconds=0.1)
        truth.wait(moving=True)
        at, low = middle(handle(phone))
        hand.put((at, low), finger=1)
        hand.move((at, low - 100.0), finger=1)
        # At rest, so that its speed does not count.
        phone.page.wait_for_timeout(200)
        hand.lift(1)
        wait_state(phone, "half height")
        assert not jog.is_visible()
        truth.wait(moving=False)
        hand.lift()
    assert phone.page.get_attribute("#jog-button", "aria-expanded") == "false"


def test_second_finger_presses_stop_while_the_first_is_in_the_scene(
    phone: ViserPage, server: AppServer
) -> None:
    truth = Truth(server)
    with fingers(phone.page) as hand:
        hand.put(middle(phone.page.locator("#scene")))
        hand.put(middle(phone.page.locator("#stop")), finger=1)
        truth.wait(mood="stopped")
        hand.lift(1)
        hand.lift()
    clear_stop(phone, truth)


def test_help_of_a_touch_screen_tells_gestures_instead_of_keys(phone: ViserPage) -> None:
    phone.page.tap("#help-button")
    help_text = phone.page.get_by_role("dialog", name="Help")
    help_text.wait_for()
    assert phone.page.locator("#help kbd:visible").count() == 0
    words = help_text.inner_text()
    assert "Hold a pad or a button" in words
    assert "two fingers shift and zoom" in words
    assert "wheel" not in words


@pytest.mark.long
def test_jog_fits_beside_the_scene_in_landscape(
    server: AppServer, open_page: OpenPage, artefacts: Path
) -> None:
    page = open_page(server.url, nodes=("/arm", MOVE), window=LANDSCAPE, own_camera=True, **PHONE)
    take(page)
    wait_whole(page, "beside the panel")
    page.page.tap("#jog-button")
    jog = page.page.locator("#jog")
    page.page.locator("#gripper button").first.wait_for()
    assert jog.evaluate("(each) => each.scrollHeight <= each.clientHeight")
    assert box(jog)["x"] > LANDSCAPE[0] / 2
    wait_whole(page, "beside Jog")
    assert_stop_can_be_pressed(page)
    for button in page.page.locator("#jog button, #jog .pad, nav button").all():
        if button.is_visible():
            assert min(box(button)["width"], box(button)["height"]) >= FINGER - 0.5
            # No word is cut.
            assert button.evaluate("(each) => each.scrollWidth <= each.clientWidth")
    page.keep(artefacts / "sheet-landscape.png")
    # The panel takes the place of Jog, and is docked again.
    handle(page).tap()
    page.wait_until(lambda: page.frame.get_by_role("tab").count() == 3, "the docked panel")
    assert not jog.is_visible()
    wait_whole(page, "beside the panel again")
    assert page.errors == []
