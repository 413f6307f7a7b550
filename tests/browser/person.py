"""A person at a page: by mouse and keys at a desk, by real touches on a phone."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from playwright.sync_api import Locator

from tests.browser.finger import fingers, middle
from tests.browser.page import Pixel, ViserPage
from tests.browser.session import MOVE, Truth, bar, clear_stop

Keep = Callable[[str], None]


class Person:
    """A person who presses by mouse at a desk and by finger on a phone."""

    def __init__(self, page: ViserPage, truth: Truth, keep: Keep, *, touches: bool) -> None:
        self.page, self.truth, self.keep, self.touches = page, truth, keep, touches

    def press(self, element: Locator) -> None:
        if self.touches:
            element.tap()
        else:
            element.click()

    def button(self, name: str, *, inside: str = "body") -> None:
        self.press(self.page.page.locator(inside).get_by_role("button", name=name, exact=True))

    def point(self, pixel: Pixel) -> None:
        """Click or tap a pixel."""
        if self.touches:
            self.page.page.touchscreen.tap(*pixel)
        else:
            self.page.page.mouse.click(*pixel)

    def drag_arrow(self, metres: float) -> None:
        if not self.touches:
            self.page.drag_arrow(MOVE, "z", metres)
            return
        # A first visit shows its card beside the scene, and the camera follows the size of that.
        still(self.page, lambda: self.page.project(self.page.node_pose(MOVE)[:3, 3]))
        start, end = self.page.grip_arrow(MOVE, "z").pixels(metres)
        with fingers(self.page.page) as hand:
            hand.put(start)
            hand.move(end)
            hand.lift()

    def open_panel(self) -> None:
        sheet = self.page.frame.locator("#k450-sheet")
        while self.touches and sheet.is_visible():
            if sheet.get_attribute("aria-label") == "Controls, full height":
                break
            sheet.tap()
            self.rest(sheet)
        if self.touches and sheet.is_visible():
            self.assert_above(self.page.page.get_by_role("group", name="Camera"), sheet)

    def pause(self, status: Callable[[], Any]) -> None:
        """Pause by the bar."""
        self.press(self.page.page.locator("#pause"))
        self.page.wait_until(lambda: status() == "paused", "the pause")

    def assert_above(self, group: Locator, sheet: Locator) -> None:
        """Check that the buttons of ``group`` lie above the ``sheet``, not over its controls."""
        top = sheet.bounding_box()
        assert top is not None
        for button in group.locator("button, select").all():
            box = button.bounding_box() if button.is_visible() else None
            assert box is None or box["y"] + box["height"] <= top["y"] + 1.0

    def fold_panel(self) -> None:
        sheet = self.page.frame.locator("#k450-sheet")
        if self.touches and sheet.is_visible():
            sheet.tap()
            self.rest(sheet)

    def rest(self, sheet: Locator) -> None:
        """Wait until the sheet has moved."""
        self.page.settled(lambda: list((sheet.bounding_box() or {}).values()), "the sheet")

    def stop(self) -> None:
        """Stop by the key or the button, and clear the stop."""
        self.assert_stop_is_free()
        if self.touches:
            self.page.page.locator("#stop").tap()
        else:
            self.page.page.keyboard.press("Escape")
        self.truth.wait(mood="stopped")
        self.page.wait_until(lambda: bar(self.page, "headline") == "Stopped", "the stop")
        clear_stop(self.page, self.truth)

    def assert_stop_is_free(self) -> None:
        """Check that nothing lies over STOP and that the page does not scroll sideways."""
        place = middle(self.page.page.locator("#stop"))
        name = self.page.page.evaluate("(at) => document.elementFromPoint(...at).id", place)
        assert name == "stop"
        assert self.page.page.evaluate("() => document.documentElement.scrollWidth <= innerWidth")


def still(page: ViserPage, where: Callable[[], Pixel]) -> Pixel:
    """Return a pixel when it moves no more: the camera follows the size of the picture."""
    pixel: Pixel = page.settled(where, "the camera")
    return pixel
