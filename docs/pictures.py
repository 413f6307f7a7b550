"""Take the pictures of the documentation from the app: ``python -m docs.pictures [NAME...]``."""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from zipfile import ZipFile

import imageio.v3 as imageio
import numpy as np
import yaml
from numpy.typing import NDArray

from katana450.client import Client, connect
from katana450.extensions.programs.script.script_files import library_file, script_text
from katana450.server.api import answers
from katana450.server.api.program_requests import Program, ProgramOrder, Steer
from katana450.server.viser_bridge.presets import CAMERA_POSES, FOV, Preset
from tests.browser.camera import Camera, Drawing
from tests.browser.chromium import launched
from tests.browser.page import ViserPage
from tests.browser.server import AppServer
from tests.browser.session import AXES, turn

IMAGES = Path(__file__).with_name("images")
WINDOW = (1440, 900)
MOVE = "/target/move"
VIEWS = (Preset.FREE, Preset.FRONT, Preset.SIDE, Preset.TOP, Preset.TOOL)


def at_rest(page: ViserPage) -> None:
    """Wait until the arm is at rest and the page is drawn."""
    page.page.mouse.move(60, 60)
    page.wait_until(lambda: "Moving" not in page.page.inner_text("#headline"), "the arm to arrive")
    page.page.wait_for_timeout(1500)
    page.wait_drawn()


def app(page: ViserPage) -> None:
    """Take a picture of the app as it opens."""
    at_rest(page)
    page.screenshot(IMAGES / "app.png")


def out_of_reach(page: ViserPage) -> None:
    """Take a picture while the handle is dragged out of reach."""
    page.drag_slider("1 base turn", -35.0)
    at_rest(page)
    with page.grip_arrow(MOVE, "z") as grip:
        grip.sweep(-0.16, 6)
    at_rest(page)
    with page.grip_arrow(MOVE, "x") as grip:
        grip.sweep(0.26, 8)
        page.wait_until(lambda: "out of reach" in page.page.inner_text("#why"), "the reason")
        page.page.wait_for_timeout(2500)
        page.screenshot(IMAGES / "out-of-reach.png")


POSES = {
    "ready": (0.0, -68.0, 85.0, 8.0, 0.0),
    "reaching": (-30.0, -40.0, 45.0, 35.0, 0.0),
    "upright": (40.0, -92.0, 12.0, 20.0, 60.0),
    "folded": (110.0, -112.0, 112.0, 70.0, -90.0),
}
"""Joint angles [deg] of the poses of the gallery, by name."""

BACK = Camera((-1.24, 0.98, 0.71), (0.0, 0.0, 0.36))
"""The view from behind; the other views are those of the panel."""

TILE = (880, 800)
"""Width and height [pixels] of the part of the scene in one picture; saved at half that size."""


def gallery(page: ViserPage) -> None:
    """Make one picture per theme, with a row for each pose and a column for each camera."""
    page.page.set_viewport_size({"width": 1300, "height": 980})
    for theme in ("Light", "Dark"):
        page.page.click("#more-button")
        page.page.get_by_label("Theme", exact=True).select_option(theme)
        page.page.click("#more-button")
        rows = []
        for pose in POSES.values():
            for number, angle in enumerate(pose):
                page.type_number(AXES[number], angle)
            at_rest(page)
            row = []
            for preset in VIEWS:
                if preset is Preset.TOOL:
                    # Take the view from behind first: this preset keeps control of the camera.
                    page.look_from(BACK)
                    page.page.wait_for_timeout(700)
                    row.append(tile(page))
                turn(page, preset.value)
                page.page.wait_for_timeout(700)
                row.append(tile(page))
            rows.append(np.hstack(row))
        imageio.imwrite(IMAGES / f"gallery-{theme.lower()}.jpg", np.vstack(rows), quality=82)


STAGES = (
    ("grasp cup: approach", 0.0),
    ("grasp cup: close", 0.0),
    ("over basin", 0.5),
    ("pour", 0.0),
)
"""Task of the pouring demo and the fraction of it done, as in figures 9 to 12 of the paper."""

POURED = 60.0
"""Water in the basin [ml] in the picture of the last stage."""

SPEED = 0.5
"""Fraction of full speed: slow enough to see every stage before it is over."""


def pouring(page: ViserPage) -> None:
    """Make a picture of four stages: initial, grasping, approaching, emptying."""
    # A taller scene shows its middle closer.
    page.page.set_viewport_size({"width": WINDOW[0], "height": WINDOW[1] + 200})
    url = page.page.url.split("/?")[0].rstrip("/")
    pictures = []
    with connect(url, "Pictures") as arm:
        send(arm, script_text(library_file("pour")))
        program(arm, lambda progress: progress.status in ("ready", "refused"))
        arm.ask(Steer(order=ProgramOrder.RUN))
        for task, fraction in STAGES:
            program(arm, lambda run, t=task, s=fraction: run.task == t and run.fraction >= s)  # type: ignore[misc]
            while task == "pour" and poured(arm) < POURED:
                time.sleep(0.02)
            arm.ask(Steer(order=ProgramOrder.PAUSE))
            page.page.wait_for_timeout(700)
            page.wait_drawn()
            pictures.append(tile(page))
            arm.ask(Steer(order=ProgramOrder.RESUME))
        arm.ask(Steer(order=ProgramOrder.END))
    sheet = np.vstack([np.hstack(pictures[:2]), np.hstack(pictures[2:])])
    imageio.imwrite(IMAGES / "pouring.jpg", sheet, quality=85)


def poured(arm: Client) -> float:
    """Return the volume of water in the basin [ml]."""
    water = arm.query(answers.State).water
    return 0.0 if water is None else water.basin_ml


CIRCLE_LEFT = 6.0
"""Time [s] before the end of the script at which three quarters of the circle are drawn."""


def instruments(page: ViserPage) -> None:
    """Take a picture of the instruments with the paper's circle, which is paused."""
    url = page.page.url.split("/?")[0].rstrip("/")
    # Drawing the scene would take the processor time that the plots need.
    page.frame.evaluate("() => harness.draw(false)")
    with connect(url, "Circle") as arm:
        page.press_in_bar("Instruments")
        send(arm, script_text(library_file("circle_with_gripper")))
        program(arm, lambda progress: progress.status in ("ready", "refused"))
        arm.ask(Steer(order=ProgramOrder.RUN))
        # The fraction would also count the path to the start of the circle, from 0 to 1.
        program(arm, lambda run: run.task == "circle" and 0.0 < run.seconds_left < CIRCLE_LEFT)
        arm.ask(Steer(order=ProgramOrder.PAUSE))
        page.page.locator("#instruments").get_by_role("button", name="Pause").click()
        page.page.wait_for_timeout(3000)
        page.screenshot(IMAGES / "instruments.png")


EXAMPLES = Path(__file__).parents[1] / "examples" / "programs"

STACK = """
name: Stack
frame: base
scene:
  - {name: lower, shape: box, size: [34, 34, 34], pose: [250, 50, 0, 0, 0, 0], can_be_held: true}
  - {name: middle, shape: box, size: [34, 34, 34], pose: [300, -60, 0, 0, 0, 0], can_be_held: true}
  - {name: upper, shape: box, size: [34, 34, 34], pose: [240, -140, 0, 0, 0, 0], can_be_held: true}
steps:
  - stack: {object: middle, on: lower}
  - stack: {object: upper, on: middle}
"""

SLIP = """
name: Slip
frame: base
scene: [{name: cup, shape: cylinder, size: [32, 90], pose: [380, 0, 0, 0, 0, 0], can_be_held: true}]
steps: [{pick: cup}]
"""

WINDOWS = {"light": WINDOW, "dark": WINDOW, "phone": (390, 844)}
"""Sizes of the window of the pictures of the physics, by their names."""


def physics(page: ViserPage) -> None:
    """Make one picture per window of an open drawer, a stack, a push and a cup that slips."""
    sheets: dict[str, list[NDArray[np.uint8]]] = {name: [] for name in WINDOWS}
    push, drawer = (
        (EXAMPLES / f"{name}.yaml").read_text(encoding="utf-8") for name in ("tower", "drawer")
    )
    with connect(page.page.url.split("/?")[0].rstrip("/"), "Physics") as arm:
        for text in (drawer, STACK, push, SLIP):
            file = BytesIO()
            with ZipFile(file, "w") as scene:
                objects = yaml.safe_load(text)["scene"]
                scene.writestr("scene.yaml", yaml.safe_dump({"scene": 1, "objects": objects}))
            arm.load_scene(file.getvalue())
            send(arm, text)
            program(arm, lambda progress: progress.status in ("ready", "refused"))
            # Drawing would make the ticks late, and a handle that is pulled by jerks slips.
            page.frame.evaluate("() => harness.draw(false)")
            arm.ask(Steer(order=ProgramOrder.RUN))
            program(arm, lambda progress: progress.status == "done")
            page.frame.evaluate("() => harness.draw(true)")
            if text == SLIP:
                arm.gripper(arm.query(answers.State).gripper - WEAKER)
            for name, (width, height) in WINDOWS.items():
                page.page.set_viewport_size({"width": width, "height": height})
                page.page.emulate_media(color_scheme="dark" if name == "dark" else "light")
                page.page.wait_for_timeout(1500)
                page.wait_drawn()
                picture = page.picture()
                sheets[name].append(picture if name == "phone" else halved(picture))
    for name, pictures in sheets.items():
        rows = [pictures] if name == "phone" else [pictures[:2], pictures[2:]]
        sheet = np.vstack([np.hstack(row) for row in rows])
        imageio.imwrite(IMAGES / f"physics-{name}.jpg", sheet, quality=80)


WEAKER = 0.002
"""[rad] Opening of the fingers that ends most of the force on what they hold."""


def send(arm: Client, text: str) -> None:
    """Send the text of a script to the server, which plans it."""
    parts = [text[start : start + 600] for start in range(0, len(text), 600)]
    for number, part in enumerate(parts, start=1):
        arm.ask(Program(text=part, more=number < len(parts), speed=SPEED))


def program(arm: Client, wanted: Callable[[answers.Progress], bool]) -> answers.Progress:
    """Return the progress of the program as soon as ``wanted`` is true of it."""
    while True:
        progress = arm.query(answers.State).program
        if progress is not None and wanted(progress):
            return progress
        if progress is not None and progress.status in ("refused", "stopped", "failed", "done"):
            sys.exit(f"The program {progress.name} is {progress.status}: {progress.why}")
        time.sleep(0.02)


def tile(page: ViserPage) -> NDArray[np.uint8]:
    """Return the middle of the scene at half its size."""
    picture = page.scene_picture()
    across, down = TILE
    height, width, _ = picture.shape
    x, y = (width - across) // 2, (height - down) // 2
    return halved(picture[y : y + down, x : x + across])


def halved(picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return ``picture`` (height, width, 3) at half its size."""
    down, across, _ = picture.shape
    quarters = picture.astype(np.uint16).reshape(down // 2, 2, across // 2, 2, 3)
    smaller: NDArray[np.uint8] = (quarters.sum(axis=(1, 3)) // 4).astype(np.uint8)
    return smaller


PICTURES: dict[Callable[[ViserPage], None], Camera] = {
    app: Camera(CAMERA_POSES[Preset.FREE].position, CAMERA_POSES[Preset.FREE].target, FOV),
    gallery: Camera(),
    pouring: Camera((1.19, 0.68, 0.80), (0.2, 0.09, 0.2), math.radians(50.0)),
    instruments: Camera((0.9, -0.75, 0.7), (0.25, 0.0, 0.2), math.radians(45.0)),
    physics: Camera((0.95, -0.85, 0.55), (0.33, 0.0, 0.1), math.radians(45.0)),
    out_of_reach: Camera((0.75, -1.25, 0.70), (0.3, -0.06, 0.17), math.radians(40.0)),
}


def main() -> None:
    """Take the named pictures, or all."""
    names = sys.argv[1:] or [take.__name__ for take in PICTURES]
    wanted = {take: camera for take, camera in PICTURES.items() if take.__name__ in names}
    if len(wanted) < len(names):
        known = ", ".join(take.__name__ for take in PICTURES)
        sys.exit(f"Unknown picture in {' '.join(names)}. Choose from: {known}.")
    IMAGES.mkdir(exist_ok=True)
    with launched() as browser:
        for number, (take, camera) in enumerate(wanted.items(), start=1):
            print(f"{number}/{len(wanted)} {take.__name__}", flush=True)
            with AppServer() as server:
                page = ViserPage.open(
                    browser, server.url, camera=camera, drawing=Drawing.BEST, window=WINDOW
                )
                take(page)
                page.close()


if __name__ == "__main__":
    main()
