"""The sheet of programs as a person uses it: poses are taught, dragged and played."""

from __future__ import annotations

import json
import time
from typing import Any

import numpy as np
from playwright.sync_api import Locator

from tests.browser.page import ViserPage
from tests.browser.session import MOVE, Truth

TURNS = (20.0, -25.0, 45.0)
"""Values of axis 1 of the taught poses [deg]."""

PLAYED = 60.0
"""Timeout of a script [s], on a busy machine."""


def open_sheet(page: ViserPage) -> None:
    page.page.click("#teach-button")
    page.page.wait_for_selector("#teach:not([hidden])")


def reload(page: ViserPage) -> ViserPage:
    """Load the page again, which opens the sheet; return the window with its new documents."""
    page.page.reload()
    page.page.locator("#holder", has_text="drive").wait_for()
    frame = next(frame for frame in page.page.frames if "/viser/" in frame.url)
    again = ViserPage(page.page, frame, page.errors)
    again.wait_ready(("/arm", MOVE))
    page.page.wait_for_selector("#teach:not([hidden])")
    return again


def press(page: ViserPage, name: str) -> None:
    page.page.locator("#teach").get_by_role("button", name=name, exact=True).click()


def says(page: ViserPage) -> str:
    return page.page.inner_text("#teach-says")


def rows(page: ViserPage) -> Locator:
    return page.page.locator("#teach li[data-id]")


def kept(page: ViserPage) -> Any:
    """Return what the browser keeps of the sheet."""
    own = "Object.keys(localStorage).find((key) => key.startsWith('katana450.teach '))"
    return json.loads(page.page.evaluate(f"localStorage.getItem({own})") or "null")


def turns(page: ViserPage) -> list[float]:
    """Return axis 1 of all poses [deg], rounded."""
    content = kept(page)
    return [] if content is None else [round(pose["joints"][0]) for pose in content["poses"]]


def teach(page: ViserPage, truth: Truth, values: tuple[float, ...] = TURNS) -> None:
    """Turn axis 1 with the mouse to each of ``values`` [deg], and record the pose there."""
    for number, value in enumerate(values, 1):

        def arrived(value: float = value) -> bool:
            if abs(np.degrees(truth.status()["goal"][0]) - value) < 0.01:
                return True
            # A busy browser may lose a number that is typed.
            page.type_number("1 base turn", value)
            return False

        page.wait_until(arrived, "the goal")
        truth.wait(15.0, moving=False)
        press(page, "Add pose")
        page.wait_until(lambda number=number: rows(page).count() == number, "the pose")  # type: ignore[misc]


def play(page: ViserPage, truth: Truth) -> list[tuple[float, int | None]]:
    """Press Run; return axis 1 [deg] and the number of the marked pose, until the end."""
    press(page, "Run")
    angles: list[tuple[float, int | None]] = []
    deadline = time.monotonic() + PLAYED
    while says(page) != "Done.":
        assert time.monotonic() < deadline, says(page)
        marked = page.page.evaluate(
            "() => document.querySelector('#teach li[aria-current] b')?.textContent"
        )
        number = int(marked) if marked else None
        angles.append((float(np.degrees(truth.status()["q"][0])), number))
        page.page.wait_for_timeout(30)
    return angles


def drag(page: ViserPage, source: int, target: int) -> None:
    """Drag the row ``source`` by its picture over the row ``target`` (indices from 0)."""
    boxes = [rows(page).nth(row).locator(".handle").bounding_box() for row in (source, target)]
    assert boxes[0] is not None
    assert boxes[1] is not None
    page.page.mouse.move(boxes[0]["x"] + 40, boxes[0]["y"] + 40)
    page.page.mouse.down()
    end = boxes[1]["y"] + (2 if target < source else boxes[1]["height"] - 2)
    page.page.mouse.move(boxes[1]["x"] + 40, end, steps=6)
    page.page.mouse.up()
