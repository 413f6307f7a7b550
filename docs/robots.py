"""Take the pictures of the robots in docs/gallery.md: ``python -m docs.robots [NAME...]``.

All but so101 need the extra ``gallery``, git and a network: they are downloaded on first use.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import NamedTuple

import imageio.v3 as imageio

from docs.pictures import IMAGES, MOVE, at_rest
from tests.browser.camera import Drawing
from tests.browser.chromium import launched
from tests.browser.page import Axis, ViserPage
from tests.browser.server import APP, AppServer
from tests.browser.session import take

WINDOW = (1160, 720)
"""Size of the window [px]; the scene is what the panel and the bar leave of it."""

HELD = 0.001
"""Distance [m] by which the handle is moved for the picture."""


class Drag(NamedTuple):
    """A drag of one arrow by some metres, and the options of the server."""

    axis: Axis
    metres: float
    options: tuple[str, ...] = ()


DRAGS = {
    "so101": Drag("z", 0.08),
    "ur5e": Drag("y", -0.25),
    "panda": Drag("y", -0.2),
    "xarm6": Drag("z", 0.15),
    "open_manipulator_x": Drag("z", 0.06),
    "allegro": Drag("z", 0.02, ("--tool", "link_3_tip")),
}
"""Drag of each robot by its name in the gallery."""


def picture(page: ViserPage, drag: Drag, file: Path) -> None:
    """Write a picture of the scene after a drag, with the handle still held."""
    take(page)
    page.drag_arrow(MOVE, drag.axis, drag.metres)
    at_rest(page)
    page.press_in_bar("Fit")
    page.page.wait_for_timeout(1000)
    page.wait_drawn()
    # The handle that is held has another colour.
    with page.grip_arrow(MOVE, drag.axis) as grip:
        grip.sweep(HELD, 2)
        page.page.wait_for_timeout(500)
        imageio.imwrite(file, page.scene_picture(), quality=85)
    assert not page.errors, page.errors


def main(names: list[str]) -> None:
    """Take the pictures of ``names``, or all of them."""
    with launched() as browser:
        for name in names or DRAGS:
            drag = DRAGS[name]
            command = (*APP, "--arm", name, *drag.options)
            with AppServer(command, seconds=300.0) as server:
                page = ViserPage.open(
                    browser, server.url, own_camera=True, window=WINDOW, drawing=Drawing.BEST
                )
                picture(page, drag, IMAGES / f"robot-{name.replace('_', '-')}.jpg")
                page.close()


if __name__ == "__main__":
    main(sys.argv[1:])
