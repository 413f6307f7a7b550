"""Take the animated pictures of the README from the app: ``python -m docs.films [NAME …]``."""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable, Iterable
from io import BytesIO
from pathlib import Path

import numpy as np
from PIL import Image

from docs.pictures import IMAGES, MOVE, at_rest
from katana450.extensions.media.stage import Shot, rendering_pool
from katana450.extensions.programs.run.simulation import plan_script, run_by_clock
from katana450.extensions.programs.script.script import parse
from katana450.extensions.programs.script.script_files import library_file, script_text
from katana450.resources import URDF_PATH
from katana450.settings import Settings
from tests.browser.camera import Camera, Drawing
from tests.browser.chromium import launched
from tests.browser.page import Axis, ViserPage
from tests.browser.server import AppServer

WINDOW = (1100, 690)
WIDTH = 720
"""Pixels of a film from left to right."""

FRAMES_PER_SECOND = 12

VIEW = Camera((0.95, -1.10, 0.62), (0.26, -0.02, 0.26), 0.72)

STROKES: tuple[tuple[Axis, tuple[float, float]], ...] = (("z", (0.12, 0.0)), ("x", (0.26, 0.0)))
"""Arrow of the gizmo, and the values [m] to which the mouse moves it, one after the other."""

POUR_REGION, TOWER_REGION = (400, 260, 1136, 790), (480, 240, 1216, 770)
"""Left, top, right and bottom [pixels] of the part of the drawn frames that is shown."""

CURSOR = """
const cursor = document.createElement("div");
cursor.style = "position:fixed;z-index:99999;width:22px;height:22px;margin:-11px;border-radius:50%;"
  + "border:3px solid #fff;background:#1c7ed6;box-shadow:0 1px 4px #0008;pointer-events:none";
document.body.append(cursor);
addEventListener("pointermove", (event) => {
  cursor.style.left = event.clientX + "px";
  cursor.style.top = event.clientY + "px";
}, true);
"""
"""Draws the mouse pointer, because a screenshot does not contain it."""


def drag() -> Iterable[Image.Image]:
    """Yield frames of the tool dragged up, out and back by the arrows of the gizmo."""
    with launched() as browser, AppServer() as server:
        page = ViserPage.open(browser, server.url, camera=VIEW, drawing=Drawing.BEST, window=WINDOW)
        at_rest(page)
        page.frame.evaluate(CURSOR)
        for axis, ends in STROKES:
            with page.grip_arrow(MOVE, axis) as grip:
                start = 0.0
                for end in ends:
                    # Slow at both ends, as a hand moves.
                    for phase in np.linspace(0.0, np.pi, 11)[1:]:
                        grip.to(start + (end - start) * (1.0 - float(np.cos(phase))) / 2.0)
                        page.page.wait_for_timeout(60)
                        yield shot(page)
                    start = end
                    for _ in range(3):
                        page.page.wait_for_timeout(120)
                        yield shot(page)
        page.close()


def run(script: str, region: tuple[int, int, int, int], fps: int) -> Iterable[Image.Image]:
    """Yield frames of a script, drawn from its plan and cut to ``region``."""
    plan = plan_script(parse(script_text(Path(script))), URDF_PATH)
    states = run_by_clock(plan).states[:: round(Settings().rate / fps)]
    with rendering_pool((Shot("free", (1280, 800)),), URDF_PATH, False, len(states)) as rendered:
        yield from (Image.fromarray(frame).crop(region) for (frame,) in rendered(iter(states)))


def shot(page: ViserPage) -> Image.Image:
    """Return a screenshot of the page while what it shows is current.

    Without a graphics card a screenshot takes so long that the page turns grey meanwhile.
    """
    stale = "document.body.classList.contains('stale')"
    page.wait_until(lambda: not page.page.evaluate(stale), "a current picture")
    with tempfile.TemporaryDirectory() as folder:
        picture = page.screenshot(Path(folder, "shot.png"))
        return Image.open(BytesIO(picture.read_bytes())).convert("RGB")


def save(name: str, frames: Iterable[Image.Image]) -> Path:
    """Write ``frames`` as an animated WebP that repeats, and return its path."""
    film = IMAGES / f"{name}.webp"
    first, *rest = (
        frame.resize((WIDTH, round(frame.height * WIDTH / frame.width)), Image.Resampling.LANCZOS)
        for frame in frames
    )
    first.save(
        film,
        save_all=True,
        append_images=rest,
        duration=round(1000 / FRAMES_PER_SECOND),
        loop=0,
        quality=62,
        method=6,
    )
    return film


FILMS: dict[str, Callable[[], Iterable[Image.Image]]] = {
    "drag": drag,
    "pour": lambda: run(str(library_file("pour")), POUR_REGION, 4),
    "tower": lambda: run("examples/programs/tower.yaml", TOWER_REGION, 12),
}


def main() -> None:
    """Take the named films, or all."""
    for name in sys.argv[1:] or FILMS:
        if name not in FILMS:
            sys.exit(f"There are: {', '.join(FILMS)}.")
        film = save(name, FILMS[name]())
        print(f"{film}: {film.stat().st_size / 1e6:.1f} MB", flush=True)


if __name__ == "__main__":
    main()
