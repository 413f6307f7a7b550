"""Number boxes of the panel: a value is sent on Enter or when the box is left, never before."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import pytest
from playwright.sync_api import Locator

from katana450.settings import Settings
from tests.browser.page import ViserPage
from tests.browser.session import Truth, clear_stop, prepare

MOVE = "/target/move"
READY = Settings().ready
BETWEEN_KEYS = 120.0  # ms; viser alone sends a keystroke after at most 50


@pytest.fixture
def page(window: ViserPage, truth: Truth) -> Iterator[ViserPage]:
    """Return a window whose person drives, with the arm in the ready posture and no box focused."""
    window.frame.evaluate("() => document.activeElement.blur()")
    prepare(window, truth)
    yield window
    assert window.errors == []


class Watch:
    """Records the values that the page sends for controls."""

    def __init__(self, page: ViserPage) -> None:
        self._page = page
        self._before = len(page.sent("GuiUpdateMessage"))

    @property
    def sent(self) -> list[object]:
        """Return the values sent since the start of the watch."""
        newer = self._page.sent("GuiUpdateMessage")[self._before :]
        return [each.body["updates"]["value"] for each in newer]

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


def wait_for_joint(page: ViserPage, truth: Truth, degrees: float) -> None:
    page.wait_until(
        lambda: abs(first_joint(truth) - degrees) < 1e-3, f"axis 1 at {degrees}", seconds=20.0
    )


def marked(box: Locator) -> bool:
    return box.get_attribute("aria-invalid") == "true"


def toast(page: ViserPage) -> str:
    return page.page.inner_text("#toast")


def test_typed_digits_are_sent_on_enter_only(page: ViserPage, truth: Truth) -> None:
    box = page.number_box("1 base turn")
    home, watch = first_joint(truth), Watch(page)
    type_slowly(page, box, "50")
    assert box.input_value() == "50"
    assert not marked(box)
    assert watch.sees()
    assert first_joint(truth) == home
    assert page.slider_value("1 base turn") == home
    box.press("Enter")
    assert watch.sees(50)
    wait_for_joint(page, truth, 50.0)
    box.press("Enter")
    assert watch.sees(50)


def test_comma_of_a_number_is_its_point(page: ViserPage, truth: Truth) -> None:
    box = page.number_box("1 base turn")
    watch = Watch(page)
    type_slowly(page, box, "12,5")
    assert not marked(box)
    box.press("Enter")
    assert watch.sees(12.5)
    wait_for_joint(page, truth, 12.5)
    # In the boxes of our own page too.
    own = "{id: 'own', type: 'number', step: 'any', style: 'position: fixed; z-index: 9'}"
    made = f"document.body.append(Object.assign(document.createElement('input'), {own}))"
    page.page.evaluate(made)
    page.page.locator("#own").focus()
    page.page.keyboard.type("12,5")
    assert page.page.locator("#own").input_value() == "12.5"
    page.page.evaluate("() => document.getElementById('own').remove()")


def test_value_out_of_range_is_marked_and_not_sent(page: ViserPage, truth: Truth) -> None:
    box = page.number_box("1 base turn")
    home, watch = first_joint(truth), Watch(page)
    type_slowly(page, box, "500")
    assert marked(box)
    box.press("Enter")
    page.wait_until(lambda: "500 is not between -173.35 and 165.65" in toast(page), "the reason")
    assert watch.sees()
    # With one digit less the value is in the range.
    box.press("Backspace")
    assert not marked(box)
    type_slowly(page, box, "5-0")
    assert marked(box)
    box.press("Tab")
    assert watch.sees()
    assert first_joint(truth) == home
    assert float(box.input_value()) == home
    assert not marked(box)
    page.wait_until(lambda: "5-0 is not a number" in toast(page), "the reason")


def test_leaving_the_box_sends_the_value(page: ViserPage) -> None:
    watch = Watch(page)
    type_slowly(page, page.number_box("1 base turn"), "12.5")
    page.page.keyboard.press("Tab")
    assert watch.sees(12.5)
    # The typed value is sent before the effect of the next button.
    type_slowly(page, page.number_box("Gripper"), "60")
    page.click_button("Home")
    assert watch.sees(12.5, 60, "Home")


def test_escape_restores_the_value_and_stops_the_arm(page: ViserPage, truth: Truth) -> None:
    box = page.number_box("1 base turn")
    home, watch = box.input_value(), Watch(page)
    type_slowly(page, box, "50")
    box.press("Escape")
    assert box.input_value() == home
    truth.wait(mood="stopped")
    # A typed value that was not sent must not be sent after Clear stop.
    type_slowly(page, box, "40")
    clear_stop(page, truth)
    page.wait_until(lambda: box.input_value() == home, "the value of before")
    assert watch.sees()
    assert np.allclose(truth.status()["q"], READY, atol=1e-9)


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
def test_arrow_keys_step_the_typed_value(page: ViserPage) -> None:
    box = page.number_box("1 base turn")
    watch = Watch(page)
    type_slowly(page, box, "20")
    for key in ("ArrowUp", "ArrowUp", "ArrowDown"):
        box.press(key)
    assert box.input_value() == "20.05"
    assert watch.sees()
    box.press("Enter")
    assert watch.sees(20.05)
    type_slowly(page, box, "165.65")
    box.press("ArrowUp")
    assert box.input_value() == "165.65"
    type_slowly(page, box, "20.05")
    box.press("Enter")
    # The buttons beside a box start from the typed value.
    box = page.number_box("x, y, z")
    type_slowly(page, box, "400")
    page.frame.locator("[data-direction=up]").first.click()
    page.page.wait_for_timeout(BETWEEN_KEYS)
    assert box.input_value() == "401"


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


@pytest.mark.long
def test_pose_form_converts_units_and_copies_the_present_pose(page: ViserPage) -> None:
    def numbers(label: str) -> list[float]:
        return [float(page.number_box(label, index=i).input_value()) for i in range(3)]

    watch = Watch(page)
    page.click_button("Copy current")
    page.wait_until(lambda: numbers("x, y, z") == [478.5, 0.0, 7.6], "the pose in mm and {S}")
    assert numbers("r, p, y") == [0.0, 25.0, 0.0]
    page.choose("Units", "cm, °")
    page.choose("Frame", "Base")
    page.wait_until(lambda: numbers("x, y, z") == [47.85, 0.0, 28.21], "the pose in cm and base")
    page.wait_until(lambda: page.text_of("[data-now=z]") == "28.21", "the read-out in cm")
    # A value beyond the arm's reach in the chosen unit is not sent.
    box = page.number_box("x, y, z")
    type_slowly(page, box, "101")
    assert marked(box)
    page.choose("Frame", "Shoulder {S}")
    page.choose("Units", "mm, °")
    page.wait_until(lambda: numbers("x, y, z") == [478.5, 0.0, 7.6], "the pose in mm again")
    # Angles in radians, here and in the read-out; the joints stay in degrees.
    page.choose("Units", "mm, rad")
    page.wait_until(lambda: numbers("r, p, y") == [0.0, 0.436, 0.0], "the angles in rad")
    page.wait_until(lambda: page.text_of("[data-now=pitch]") == "0.436", "the read-out in rad")
    assert page.slider_value("2 shoulder") == -68.0
    page.choose("Units", "mm, °")
    page.wait_until(lambda: numbers("r, p, y") == [0.0, 25.0, 0.0], "the angles in degrees")
    assert len(watch.sent) == 7


LONG_TABLE = """() => {
    const table = document.querySelector(".k450 table:has(td.unit)");
    const before = table.innerHTML;
    table.querySelector("th").textContent = "tool_of_a_long_name_".repeat(3);
    const cells = [...table.querySelectorAll("tbody td")].slice(0, 2);
    for (const cell of cells) cell.textContent = "\u2212133.3";
    const range = document.createRange();
    const [now, goal] = cells.map((cell) => {
        range.selectNodeContents(cell);
        return range.getBoundingClientRect();
    });
    table.innerHTML = before;
    return goal.left - now.right;
}"""
"""Function of the panel that shows a long name and numbers; it returns the gap between two [px]."""


def test_numbers_beside_a_long_name_stay_apart(page: ViserPage) -> None:
    assert page.frame.evaluate(LONG_TABLE) > 4.0


def test_gripper_is_closed_and_opened_by_buttons(page: ViserPage) -> None:
    for label, percent in (("Close", 0.0), ("Open", 100.0)):
        page.click_button(label)
        page.wait_until(lambda p=percent: page.slider_value("Gripper") == p, label)  # type: ignore[misc]
