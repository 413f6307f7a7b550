"""A driving session at the page: the server's state, and what a driver does in the bar."""

from __future__ import annotations

import json
import time
from typing import Any

import numpy as np
from playwright.sync_api import Page

from katana450.arm.control.state.messages import AXIS_NAMES
from katana450.settings import Settings
from tests.browser.page import ViserPage
from tests.browser.server import AppServer
from tests.gateway.client import ask, enter

MOVE = "/target/move"
AXES = tuple(f"{number} {name}" for number, name in enumerate(AXIS_NAMES, start=1))
"""Labels of the joints' sliders."""
READY = np.array(Settings().ready)
VIEW_LABELS = {
    "3D": "Iso: view from above and the side",
    "Side": "View: right",
    "Tool": "View that follows the tool until another one is chosen",
}


class Truth:
    """The state of the server, queried without a browser."""

    def __init__(self, server: AppServer) -> None:
        self._url = server.url
        self._cookie = enter(server.url)

    def status(self) -> dict[str, Any]:
        code, _, body = ask(f"{self._url}/api/v1/state", Cookie=self._cookie)
        assert code == 200
        state: dict[str, Any] = json.loads(body)
        mood = "moving" if state["moving"] and state["status"] == "ok" else state["status"]
        return state | {"mood": mood if state["stopped"] is None else "stopped"}

    def wait(self, seconds: float = 5.0, **wanted: Any) -> float:
        """Wait until the status has these values; return the time that it took [s]."""
        started = time.monotonic()
        while any(self.status()[key] != value for key, value in wanted.items()):
            assert time.monotonic() - started < seconds, (self.status(), wanted)
            time.sleep(0.005)
        return time.monotonic() - started


def mood(page: Page) -> str | None:
    return page.get_attribute("body", "data-mood")


def clear_stop(page: ViserPage, truth: Truth) -> None:
    page.press_in_bar("Clear stop")
    truth.wait(stopped=None)
    page.wait_until(lambda: mood(page.page) != "stopped", "the bar to follow")


def prepare(page: ViserPage, truth: Truth) -> None:
    take(page)
    if truth.status()["stopped"] is not None:
        # The previous window closed while the arm was moving.
        clear_stop(page, truth)
    go_home(page, truth)


def joints(page: ViserPage) -> Any:
    shown = page.slider_values()
    return np.radians([shown[label] for label in AXES])


def take(page: ViserPage) -> None:
    """Take the arm. The previous window may still hold it, or may have just lost it."""

    def taken() -> bool:
        page.page.evaluate(
            """() => [...document.querySelectorAll("#acts button")]
              .find((each) => /^Take/.test(each.textContent))?.click()"""
        )
        return bar(page, "holder") == "You drive"

    page.wait_until(taken, "the arm")


def bar(page: ViserPage, part: str) -> str:
    """Return the text of a part of the bar, in one line."""
    return page.page.inner_text(f"#{part}").replace("\n", " ")


def go_home(page: ViserPage, truth: Truth) -> None:
    page.click_button("Home")
    page.wait_until(lambda: np.allclose(joints(page), READY, atol=1e-6), "the sliders at home")
    truth.wait(20.0, mood="ok")


def resume(page: ViserPage) -> None:
    """Press Resume when the page no longer takes a press for the second one of Pause."""
    page.page.wait_for_function(
        "(then) => performance.now() > then", arg=page.page.evaluate("performance.now() + 600")
    )
    page.press_in_bar("Resume")


def camera(page: ViserPage) -> Any:
    body = page.sent("ViewerCameraMessage")[-1].body
    return np.array([body["position"], body["look_at"]])


def turn(page: ViserPage, view: str) -> None:
    """Press a button below the view cube, or one of its faces, by its view on the server."""
    label = VIEW_LABELS.get(view, f"View: {view.lower()}")
    button = page.page.get_by_role("group", name="Camera").get_by_label(label)
    # Also on a face that points away.
    button.evaluate("(each) => each.click()")
