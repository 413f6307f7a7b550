"""Number boxes of the panel: a value is sent on Enter or when the box is left, never before."""

from __future__ import annotations

import math

import numpy as np
import pytest
from playwright.sync_api import Locator

from tests.browser.conftest import OpenPage
from tests.browser.page import ViserPage
from tests.browser.server import AppServer
from tests.browser.session import MOVE, READY, Truth, clear_stop

BETWEEN_KEYS = 80.0  # ms; viser alone sends a keystroke after at most 50


class Watch:
    """Records the values that the page sends for controls."""

    def __init__(self, page: ViserPage) -> None:
        self._page = page
        self._before = len(page.sent("GuiUpdateMessage"))

    @property
    def sent(self) -> list[object]:
        """Return the values sent since the start of the watch."""
        newer = self._page.sent("GuiUpdateMessage")[self._before :]
        return [message.body["updates"]["value"] for message in newer]

    def sees(self, *values: object) -> bool:
        """Wait for the values, and then as long as one more would take; return if none came."""
        wanted = list(values)
        self._page.wait_until(lambda: len(self.sent) >= len(wanted), f"{wanted}")
        self._page.page.wait_for_timeout(BETWEEN_KEYS)
        return self.sent == wanted


def type_slowly(page: ViserPage, box: Locator, text: str) -> None:
    """Replace the text of the box key by key, as a person does."""
    box.click()
    box.press("Control+a")
    for key in text:
        page.page.keyboard.type(key)
        page.page.wait_for_timeout(BETWEEN_KEYS)


def first_joint(truth: Truth) -> float:
    """Return the first joint angle [deg] from the server."""
    return math.degrees(truth.status()["q"][0])


def marked(box: Locator) -> bool:
    return box.get_attribute("aria-invalid") == "true"


def toast(page: ViserPage) -> str:
    return page.page.inner_text("#toast")


def test_value_is_sent_on_enter_or_by_leaving_and_only_in_its_range(
    page: ViserPage, truth: Truth
) -> None:
    box = page.number_box("1 base turn")
    home, watch = first_joint(truth), Watch(page)
    type_slowly(page, box, "500")
    assert marked(box)
    box.press("Enter")
    page.wait_until(lambda: "500 is not between -173.35 and 165.65" in toast(page), "the reason")
    # The box shows where the joint is, and the next key replaces it.
    assert (float(box.input_value()), marked(box)) == (home, False)
    assert watch.sees()
    assert first_joint(truth) == page.slider_value("1 base turn") == home
    page.page.keyboard.type("50")
    box.press("Enter")
    assert watch.sees(50)
    page.wait_until(lambda: abs(first_joint(truth) - 50.0) < 1e-3, "axis 1 at 50", seconds=20.0)
    type_slowly(page, box, "5-0")
    assert marked(box)
    box.press("Tab")
    page.wait_until(lambda: "5-0 is not a number" in toast(page), "the reason")
    assert float(box.input_value()) == 50.0
    assert not marked(box)
    # A comma is a point, and a value is sent before the effect of the next button.
    type_slowly(page, box, "12,5")
    page.click_button("Home")
    assert watch.sees(50, 12.5, "Home")


def test_escape_restores_the_value_and_stops_the_arm(page: ViserPage, truth: Truth) -> None:
    box = page.number_box("1 base turn")
    home, watch = box.input_value(), Watch(page)
    type_slowly(page, box, "50")
    box.press("Escape")
    assert box.input_value() == home
    truth.wait(mood="stopped")
    clear_stop(page, truth)
    assert watch.sees()


def test_value_typed_before_a_stop_is_not_sent_after_it(page: ViserPage, truth: Truth) -> None:
    box = page.number_box("1 base turn")
    home, watch = box.input_value(), Watch(page)
    type_slowly(page, box, "40")
    # The focus stays in the box, as if somebody else stopped the arm and cleared the stop.
    for button, mood in (("stop", "stopped"), ("clear-stop", "ok")):
        page.page.evaluate("(id) => document.getElementById(id).click()", button)
        truth.wait(mood=mood)
        page.wait_until(lambda: box.input_value() == home, "the value of before")
        if mood == "stopped":
            type_slowly(page, box, "40")
            page.page.wait_for_selector("#clear-stop:not([disabled])")
    box.press("Tab")
    assert watch.sees()
    assert np.allclose(truth.status()["q"], READY, atol=1e-9)


@pytest.mark.long
def test_number_has_the_decimal_mark_of_the_language(
    server: AppServer, open_page: OpenPage
) -> None:
    page = open_page(server.url, nodes=("/arm", MOVE), locale="de-DE")
    box, watch = page.frame.locator("input[inputmode=decimal]").first, Watch(page)
    for text in ("12,5", "7.25"):
        type_slowly(page, box, text)
        box.press("Enter")
        shown = text.replace(".", ",")
        page.wait_until(lambda shown=shown: box.input_value() == shown, shown)  # type: ignore[misc]
    assert watch.sees(12.5, 7.25)
    for name in ("x plus", "x minus", "p plus"):
        assert page.frame.get_by_role("button", name=name, exact=True).count() == 1


@pytest.mark.long
def test_every_number_of_the_panel_waits(page: ViserPage) -> None:
    """Assistive technology types as a person does, or sets the value without the focus."""
    for label, index, text in (("Gripper", 0, "35"), ("r, p, y", 2, "-12")):
        box = page.number_box(label, index=index)
        before = float(box.input_value())
        watch = Watch(page)
        type_slowly(page, box, text)
        assert watch.sees()
        box.press("Enter")
        page.wait_until(lambda: watch.sent, "the value")  # noqa: B023
        (value,) = watch.sent
        assert (value[index] if isinstance(value, list) else value) == float(text)
        page.type_number(label, before, index=index)
    watch = Watch(page)
    page.frame.evaluate("() => document.activeElement.blur()")
    page.number_box("Gripper").evaluate(
        """(box) => {
            const { prototype } = HTMLInputElement;
            Object.getOwnPropertyDescriptor(prototype, "value").set.call(box, "80");
            for (const kind of ["input", "change"])
                box.dispatchEvent(new Event(kind, { bubbles: true }));
        }"""
    )
    assert watch.sees(80)
