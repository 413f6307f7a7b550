"""Functions that operate and read the instruments of the page."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest

from tests.browser.page import ViserPage
from tests.browser.session import Truth


@contextmanager
def slowly(page: ViserPage, truth: Truth) -> Iterator[None]:
    """Slow the arm down for a browser that draws without a graphics card."""
    speed = dial(page, "speed")
    speed.focus()
    for key, wanted in (("PageDown", 0.05), ("PageUp", 1.0)):
        while truth.status()["speed"] != pytest.approx(wanted):
            page.page.keyboard.press(key)
            page.page.wait_for_timeout(60)
        if wanted < 1.0:
            yield
            speed.focus()


def show(page: ViserPage, wanted: bool) -> None:
    button = page.page.locator("#instruments-button")
    if (button.get_attribute("aria-expanded") == "true") != wanted:
        button.click()
    if wanted:
        page.page.wait_for_function(
            "() => document.querySelector('.knob .goal')?.textContent.endsWith('°')"
        )


def card(page: ViserPage, name: str) -> Any:
    element = page.page.locator(f"#instruments .card[data-id={name}]")
    element.scroll_into_view_if_needed()
    return element


def dial(page: ViserPage, name: str) -> Any:
    return card(page, name).get_by_role("slider")


def goal(page: ViserPage, name: str) -> float:
    """Return the goal that a knob shows, in its own unit."""
    return float(dial(page, name).get_attribute("aria-valuenow") or "nan")


def middle(element: Any) -> tuple[float, float, float]:
    """Return x and y of the middle of an element in the window, and half its width [px]."""
    box = element.bounding_box()
    assert box is not None
    return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2, box["width"] / 2


@contextmanager
def turned(page: ViserPage, name: str, degrees: float) -> Iterator[None]:
    """Drag round a knob clockwise, from its top, and hold it for the duration of the block."""
    x, y, radius = middle(dial(page, name))
    mouse = page.page.mouse
    for step in range(11):
        angle = math.radians(degrees * step / 10)
        mouse.move(x + 0.7 * radius * math.sin(angle), y - 0.7 * radius * math.cos(angle))
        if step == 0:
            mouse.down()
    yield
    mouse.up()


def turn(page: ViserPage, name: str, degrees: float) -> None:
    """Drag round a knob clockwise, from its top."""
    with turned(page, name, degrees):
        pass


def legend(page: ViserPage, name: str) -> list[float]:
    """Return the values that the legend of a plot shows."""
    texts = card(page, name).locator(".legend output").all_inner_texts()
    return [float(text.replace("−", "-").replace("–", "nan")) for text in texts]
