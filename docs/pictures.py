"""Takes the pictures of the documentation from the running app: ``python -m docs.pictures``."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

from tests.browser.chromium import launched
from tests.browser.page import Camera, Drawing, ViserPage
from tests.browser.server import AppServer

IMAGES = Path(__file__).with_name("images")
WINDOW = (1440, 900)
MOVE = "/target/move"


def at_rest(page: ViserPage) -> None:
    """Let the arm arrive and the picture settle."""
    page.page.mouse.move(60, 60)
    page.wait_until(lambda: "Moving" not in page.panel_text(), "the arm to arrive")
    page.page.wait_for_timeout(1500)
    page.wait_drawn()


def app(page: ViserPage) -> None:
    """The app as it opens."""
    at_rest(page)
    page.screenshot(IMAGES / "app.png")


def out_of_reach(page: ViserPage) -> None:
    """The handle dragged away from what the arm can do."""
    page.drag_slider("Axis 1", -35.0)
    at_rest(page)
    with page.grip_arrow(MOVE, "z") as grip:
        grip.sweep(-0.16, 6)
    at_rest(page)
    with page.grip_arrow(MOVE, "x") as grip:
        grip.sweep(0.26, 8)
        page.wait_until(lambda: "out of reach" in page.panel_text(), "the reason")
        page.page.wait_for_timeout(2500)
        page.screenshot(IMAGES / "out-of-reach.png")


PICTURES: dict[Callable[[ViserPage], None], Camera] = {
    app: Camera((0.98, -0.82, 0.62), (0.17, 0.0, 0.25), math.radians(40.0)),
    out_of_reach: Camera((0.75, -1.25, 0.70), (0.3, -0.06, 0.17), math.radians(40.0)),
}


def main() -> None:
    """Take them all."""
    IMAGES.mkdir(exist_ok=True)
    with launched() as browser:
        for number, (take, camera) in enumerate(PICTURES.items(), start=1):
            print(f"{number}/{len(PICTURES)} {take.__name__}", flush=True)
            with AppServer() as server:
                page = ViserPage.open(
                    browser, server.url, camera=camera, drawing=Drawing.BEST, window=WINDOW
                )
                take(page)
                page.close()


if __name__ == "__main__":
    main()
