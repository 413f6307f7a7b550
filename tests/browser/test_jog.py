"""Jogging at the page: held keys, pads and buttons.

What the sheet sends for keys, steps, gamepads and a SpaceMouse is tested in ``test_page_logic``.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from katana450.client import connect
from tests.browser.page import ViserPage
from tests.browser.server import AppServer
from tests.browser.session import Truth, camera, clear_stop

EXACT = 2e-6
"""[m] Tolerance of a rest."""


@pytest.fixture
def sheet(own_page: ViserPage) -> Iterator[ViserPage]:
    """Return our page with the Jog sheet open."""
    own_page.page.click("#jog-button")
    own_page.page.wait_for_selector("#jog [name=step]", state="attached")
    yield own_page
    own_page.page.click("#jog-button")


def point(truth: Truth) -> Any:
    """Return the position (3,) [m] of the tool."""
    return np.array(truth.status()["T"])[:3, 3]


def at_rest(truth: Truth) -> Any:
    """Return the position (3,) [m] of the tool once it rests."""
    truth.wait(10.0, moving=False)
    return point(truth)


def wait_moved(page: ViserPage, truth: Truth, start: Any, axis: int, sign: int) -> None:
    page.wait_until(lambda: sign * (point(truth)[axis] - start[axis]) > 0.01, "the tool to move")


@pytest.mark.long
def test_pads_and_buttons_move_while_they_are_held(
    sheet: ViserPage, truth: Truth, artefacts: Path
) -> None:
    mouse = sheet.page.mouse
    for selector, (right, down), axis, sign in (
        ("#plane", (0.5, 0.05), 0, 1),
        ("#plane", (0.95, 0.5), 1, -1),
        ("#lift", (0.5, 0.05), 2, 1),
    ):
        box = sheet.page.locator(selector).bounding_box()
        assert box is not None
        start = at_rest(truth)
        mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
        mouse.down()
        mouse.move(box["x"] + right * box["width"], box["y"] + down * box["height"], steps=3)
        wait_moved(sheet, truth, start, axis, sign)
        mouse.up()
        at_rest(truth)
    roll = truth.status()["q"][4]
    sheet.page.get_by_role("button", name="Roll right").hover()
    mouse.down()
    sheet.wait_until(lambda: truth.status()["q"][4] > roll + 0.05, "the tool to roll")
    mouse.up()
    at_rest(truth)
    # At 200 % zoom too, each button has room for its words and its key.
    size = sheet.page.viewport_size
    assert size is not None
    sheet.page.set_viewport_size({"width": 720, "height": 450})
    room = """() => [...document.querySelectorAll("#turns button:not([hidden])")].every((each) =>
        each.scrollWidth <= each.clientWidth && each.getBoundingClientRect().right <= innerWidth)"""
    assert sheet.page.evaluate(room)
    sheet.keep(artefacts / "jog.png")
    sheet.page.set_viewport_size(size)


@pytest.mark.long
def test_key_is_released_where_the_focus_has_moved_to(sheet: ViserPage, truth: Truth) -> None:
    sheet.page.click("#more-button")
    sheet.page.evaluate("() => document.activeElement.blur()")
    sheet.page.keyboard.down("KeyS")
    truth.wait(moving=True)
    sheet.page.focus("#own-name")
    sheet.page.keyboard.up("KeyS")
    truth.wait(moving=False)
    sheet.page.click("#more-button")


@pytest.mark.long
def test_key_held_in_the_scene_moves_the_arm_and_not_the_camera(
    page: ViserPage, truth: Truth
) -> None:
    page.page.click("#jog-button")
    page.page.mouse.click(60, 300)
    looked, start = camera(page), point(truth)
    # viser uses the same keys for its camera.
    page.page.keyboard.down("KeyW")
    wait_moved(page, truth, start, 0, 1)
    page.page.keyboard.up("KeyW")
    at_rest(truth)
    assert np.allclose(camera(page), looked, atol=1e-6)


def test_key_held_when_a_stop_is_cleared_moves_nothing(
    sheet: ViserPage, server: AppServer, truth: Truth
) -> None:
    sheet.page.keyboard.down("KeyA")
    truth.wait(moving=True)
    # Another person stops the arm.
    with connect(server.url, "Anna") as anna:
        anna.stop()
    truth.wait(mood="stopped")
    sheet.page.wait_for_selector("#clear-stop:not([hidden]):enabled")
    # The browser repeats a held key.
    sheet.page.keyboard.down("KeyA")
    clear_stop(sheet, truth)
    start = point(truth)
    sheet.page.wait_for_timeout(200)
    assert np.allclose(point(truth), start, atol=EXACT)
    sheet.page.keyboard.up("KeyA")
    sheet.page.keyboard.down("KeyA")
    truth.wait(moving=True)
    sheet.page.keyboard.up("KeyA")
    truth.wait(moving=False)
