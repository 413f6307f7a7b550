"""The sheets of a phone: the panel with its three heights, and Jog, by finger and keys."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import FloatRect, Locator

from tests.browser.conftest import Windows
from tests.browser.finger import fingers, middle
from tests.browser.page import ViserPage
from tests.browser.server import AppServer
from tests.browser.session import MOVE, Truth, clear_stop, take
from tests.browser.sight import overlap, wait_whole
from tests.browser.sizes import PHONE, PORTRAIT

FINGER = 44.0
"""Minimum width and height of what a finger hits [px]."""

ABOVE = 120.0
"""Height above the full sheet for the buttons that lie over the scene [px]."""


PRESSABLE_SIZE = 40.0
"""Minimum width and height of a button of the page [px]."""

PRESSABLE = """() => Object.fromEntries(
    [...document.querySelectorAll("header button, #desk button")]
        .map((each) => [each.id || each.textContent, each.getBoundingClientRect()])
        .filter(([, { width }]) => width)
        .map(([name, { x, y, width, height }]) => [name, [x, y, width, height]]))"""
"""Script that returns position and size of all buttons of our page [px]."""


@pytest.fixture(scope="module")
def phone_window(server: AppServer, windows: Windows) -> Iterator[ViserPage]:
    options = {"window": PORTRAIT, "own_camera": True, **PHONE}
    with windows.open(server.url, nodes=("/arm", MOVE), **options) as page:
        yield page


@pytest.fixture
def phone(phone_window: ViserPage) -> Iterator[ViserPage]:
    """Return a phone in portrait, whose person drives."""
    take(phone_window)
    yield phone_window
    assert phone_window.errors == []


def handle(page: ViserPage) -> Locator:
    return page.frame.locator("#k450-sheet")


def state(page: ViserPage) -> str | None:
    return handle(page).get_attribute("aria-label")


def wait_state(page: ViserPage, height: str) -> None:
    page.wait_until(lambda: state(page) == f"Controls, {height}", height)
    page.settled(lambda: box(handle(page))["y"], "the sheet")


def box(element: Locator) -> FloatRect:
    area = element.bounding_box()
    assert area is not None, f"{element} is not shown"
    return area


def assert_stop_can_be_pressed(page: ViserPage) -> None:
    place = middle(page.page.locator("#stop"))
    name = page.page.evaluate("(at) => document.elementFromPoint(...at).id", place)
    assert name == "stop"


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
    phone.settled(lambda: box(handle(phone))["y"], "the sheet")
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
def test_one_sheet_is_open_at_a_time(phone: ViserPage, server: AppServer, artefacts: Path) -> None:
    truth = Truth(server)
    jog = phone.page.locator("#jog")
    handle(phone).tap()
    wait_state(phone, "half height")
    phone.page.tap("#jog-button")
    wait_state(phone, "folded")
    phone.page.locator("#gripper button").first.wait_for()
    sheet, shown, stop = (box(part) for part in (jog, handle(phone), phone.page.locator("#stop")))
    for other in (shown, stop):
        # Fractions of a pixel do not count.
        assert not overlap(sheet, other["x"], other["y"], other["width"], other["height"] - 0.5)
    assert_stop_can_be_pressed(phone)
    wait_whole(phone, "above Jog")
    for button in jog.locator("button, .pad, .choice span").all():
        if button.is_visible():
            assert min(box(button)["width"], box(button)["height"]) >= FINGER - 0.5
    assert not any(element.is_visible() for element in jog.locator("kbd").all())
    phone.keep(artefacts / "sheet-jog.png")
    # A pad that is held lets go when the panel takes the place of its sheet.
    with fingers(phone.page) as hand:
        x, y = middle(jog.locator("#lift"))
        hand.put((x, y))
        hand.move((x, y - 40.0), seconds=0.1)
        truth.wait(moving=True)
        middle_x, low = middle(handle(phone))
        hand.put((middle_x, low), finger=1)
        hand.move((middle_x, low - 100.0), finger=1)
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
    # The finger in the scene may have selected something.
    phone.page.evaluate(
        """() => document.querySelectorAll("#stage [aria-label=Deselect]")
            .forEach((each) => each.click())"""
    )


def test_help_of_a_touch_screen_tells_gestures_instead_of_keys(phone: ViserPage) -> None:
    phone.page.tap("#help-button")
    help_text = phone.page.get_by_role("dialog", name="Help")
    help_text.wait_for()
    assert phone.page.locator("#help kbd:visible").count() == 0
    words = help_text.inner_text()
    assert "Hold a pad or a button" in words
    assert "two fingers shift and zoom" in words
    assert "wheel" not in words
    phone.page.tap("#help button")


def test_buttons_are_finger_sized_and_covered_by_no_message(
    phone: ViserPage, artefacts: Path
) -> None:
    page = phone
    page.press_in_bar("STOP")
    page.page.wait_for_selector("#clear-stop:not([hidden])")
    for opener in ("jog-button", "objects-button"):
        page.page.tap(f"#{opener}")
        page.page.evaluate(
            "katana.toast('Axis 2: 300 is not between -124.3 and 7.8. It was not sent.')"
        )
        page.page.wait_for_selector("#toast.shown")
        buttons: dict[str, list[float]] = page.page.evaluate(PRESSABLE)
        assert {"stop", "clear-stop", opener} <= buttons.keys()
        assert min(min(box[2:]) for box in buttons.values()) >= PRESSABLE_SIZE, buttons

        def covered() -> list[str]:
            boxes = [page.page.locator(name).bounding_box() for name in ("#toast", "#why")]
            places = page.page.evaluate(PRESSABLE).items()
            return [name for name, box in places for text in boxes if text and overlap(text, *box)]

        # The sheet may still grow.
        page.wait_until(lambda: not covered(), "the texts to be beside all buttons")
        assert page.page.evaluate("() => document.documentElement.scrollWidth <= innerWidth")
        page.keep(artefacts / f"finger-{opener}.png")
    # The help covers Clear stop.
    page.page.tap("#help-button")
    page.page.tap("#help button")
    assert not page.page.get_by_role("dialog").is_visible()
    page.press_in_bar("Clear stop")
    page.page.tap("#objects-button")
