"""A viser page in a real browser, driven by mouse and read through three.js and its messages."""

from __future__ import annotations

import base64
import json
import os
import re
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Literal, Self

import imageio.v3 as imageio
import numpy as np
import viser.transforms as vtf
from numpy.typing import ArrayLike, NDArray
from playwright.sync_api import Browser, Frame, Locator, Page
from playwright.sync_api import TimeoutError as PlaywrightTimeoutError

from tests.browser.camera import Camera, Drawing
from tests.browser.grip import ArrowGrip, Grip, RingGrip
from tests.browser.message import Message
from tests.browser.viser_frame import viser_frame

Matrix = NDArray[np.floating[Any]]
Pixel = tuple[float, float]
Axis = Literal["x", "y", "z"]

SCRIPTS = tuple(Path(__file__).with_name(name) for name in ("record.js", "scene.js", "visit.js"))
# Large enough for viser to dock its panel beside the scene.
WINDOW = (1280, 800)
READY_SECONDS = 60.0  # a software renderer compiles shaders for up to 22 s
POLL_MILLISECONDS = 20.0
THROTTLE_MILLISECONDS = 50.0
DRAG_STEPS = 8
FIRST_VISIT = "window.firstVisit = true;"
COARSE = 0.5  # drawn pixels per pixel of the window: a software renderer is four times as fast


class ViserPage:
    """One browser window on a viser server, bare or in the frame of the app's page.

    ``page`` is the window and ``frame`` the document of viser. Nodes have their names in viser's
    scene. Poses are 4x4 matrices in metres; pixels are relative to the window's top left corner.
    """

    def __init__(self, page: Page, frame: Frame, errors: list[str]) -> None:
        self.page = page
        self.frame = frame
        self.errors = errors

    @classmethod
    def open(
        cls,
        browser: Browser,
        url: str,
        *,
        camera: Camera | None = None,
        nodes: Sequence[str] = (),
        drawing: Drawing = Drawing.PICTURES,
        window: tuple[int, int] = WINDOW,
        own_camera: bool = False,
        script: str = "",
        **context_options: Any,
    ) -> Self:
        """Open `url` in a window of its own and wait until the scene can be used.

        `nodes` must exist in addition to the nodes that the server has sent by then. With
        `own_camera` the page uses its own initial camera. `script` runs first in both documents;
        with FIRST_VISIT the first steps are shown. `context_options` are Playwright's.
        """
        camera = camera or Camera()
        width, height = window
        context = browser.new_context(
            viewport={"width": width, "height": height}, **context_options
        )
        best = drawing is Drawing.BEST
        options = json.dumps({"draws": drawing is Drawing.ALWAYS, "fullQuality": best})
        scripts = "\n".join(path.read_text(encoding="utf-8") for path in SCRIPTS)
        context.add_init_script(f"window.harness = {options};\n{script}\n{scripts}")
        page = context.new_page()
        errors: list[str] = []
        page.on("pageerror", lambda error: errors.append(str(error)))
        try:
            if drawing is Drawing.NONE:
                page.route(f"{url}/viser/**", lambda route: route.abort())
                page.goto(url)
                return cls(page, page.main_frame, errors)
            page.on("console", lambda row: errors.append(row.text) if row.type == "error" else None)
            pixels = 1.0 if best else COARSE
            query = f"fixedDpr={pixels}" if own_camera else camera.query(pixels)
            page.goto(f"{url}/?{query}")
            viser_page = cls(page, viser_frame(page), errors)
            viser_page.wait_ready(nodes)
        except BaseException:
            context.close()
            raise
        return viser_page

    def close(self) -> None:
        """Close the window."""
        self.page.context.close()

    def reset(self) -> None:
        """Close all sheets, and show the first camera in the first size."""
        self.page.set_viewport_size({"width": WINDOW[0], "height": WINDOW[1]})
        self.page.emulate_media(color_scheme="light")
        self.page.evaluate(
            """() => {
                for (const each of document.querySelectorAll("nav [aria-expanded=true]"))
                    each.click();
            }"""
        )
        self.frame.evaluate("() => document.activeElement?.blur()")
        self.look_from(Camera())

    # Waiting

    def wait_until(
        self, condition: Callable[[], object], what: str, *, seconds: float = 10.0
    ) -> None:
        """Wait for the condition; raise AssertionError with `what` after `seconds`."""
        deadline = time.monotonic() + seconds
        while not condition():
            assert time.monotonic() < deadline, f"waited {seconds:g} s for {what}"
            self.page.wait_for_timeout(POLL_MILLISECONDS)

    def settled(self, value: Callable[[], Any], what: str) -> Any:
        """Return a value, such as a camera, once it stays the same for a fifth of a second."""
        values = [value()]

        def rests() -> bool:
            self.page.wait_for_timeout(2 * POLL_MILLISECONDS)
            values.append(value())
            return len(values) > 5 and all(
                np.allclose(value, values[-1], atol=1e-4) for value in values[-6:]
            )

        self.wait_until(rests, f"{what} to rest", seconds=20.0)
        return values[-1]

    def wait_ready(self, nodes: Sequence[str] = (), *, seconds: float = READY_SECONDS) -> None:
        """Wait until the page is connected and a frame with all nodes in their poses is drawn.

        Raises AssertionError with the missing parts.
        """
        deadline = time.monotonic() + seconds
        while missing := self.frame.evaluate("(names) => harness.missing(names)", list(nodes)):
            assert time.monotonic() < deadline, (
                f"the page was not usable after {seconds:g} s; missing: {', '.join(missing)}"
                + "".join(f"\n  console: {error}" for error in self.errors)
            )
            self.page.wait_for_timeout(POLL_MILLISECONDS)
        self.wait_until(
            lambda: self.frame.evaluate("() => harness.replayed()"),
            "the end of the scene",
            seconds=seconds,
        )
        self.wait_drawn()

    def wait_drawn(self) -> None:
        """Wait for one more frame, which includes every message that came before."""
        self.frame.evaluate("() => harness.drawn()")

    def wait_lost(self, *, seconds: float = 10.0) -> None:
        """Wait until the page has noticed the loss of its server."""
        self.wait_until(lambda: not self.connected, "the page to lose its server", seconds=seconds)

    @property
    def connected(self) -> bool:
        """True while the page's socket is open."""
        state: str | None = self.frame.evaluate("() => harness.links.at(-1)?.type ?? null")
        return state == "connected"

    # Messages

    def messages(
        self, kind: str, *, node: str | None = None, since: float = 0.0, last: int | None = None
    ) -> list[Message]:
        """Return the messages of one type from the server, in order.

        `node` selects those about one scene node, `since` (as `time.time()`) those that are not
        older, and `last` that number of the newest.
        """
        return self._recorded("received", kind, node, since, last)

    def sent(self, kind: str, *, since: float = 0.0) -> list[Message]:
        """Return the messages of one type from the page, in order."""
        return self._recorded("sent", kind, None, since, None)

    def _recorded(
        self, log: str, kind: str, node: str | None, since: float, last: int | None
    ) -> list[Message]:
        # Selected in the page, because the transfer of a long record takes long.
        messages = self.frame.evaluate(
            """([log, type, node, since, last]) => {
                const found = harness[log].filter((each) => each.type === type
                    && each.time >= since && (node === null || each.body.name === node));
                return last === null ? found : found.slice(-last);
            }""",
            [log, kind, node, since, last],
        )
        return [Message(message["time"], message["type"], message["body"]) for message in messages]

    def last_pose(self, node: str, *, since: float = 0.0) -> Matrix:
        """Return T_parent_node (4, 4) as the server sent it last.

        viser sends no pose for a node that stays in its initial pose, and none for a gizmo to the
        page that drags it. Raises LookupError if the server sent neither the frame nor a pose.
        """
        position, wxyz, built = (
            self.messages(kind, node=node, since=since, last=1)
            for kind in ("SetPositionMessage", "SetOrientationMessage", "FrameMessage")
        )
        if not (position or wxyz or built):
            raise LookupError(f"the server sent no pose of {node}")
        rotation = vtf.SO3(np.array(wxyz[0].body["wxyz"] if wxyz else (1.0, 0.0, 0.0, 0.0)))
        translation = np.array(position[0].body["position"] if position else (0.0, 0.0, 0.0))
        return vtf.SE3.from_rotation_and_translation(rotation, translation).as_matrix()

    # The scene

    def node_pose(self, node: str) -> Matrix:
        """Return T_world_node (4, 4) as drawn by three.js, after all messages that have come."""
        poses = self.frame.evaluate("(name) => harness.poses(name)", node)
        T_three_world, T_three_node = _matrix(poses["root"]), _matrix(poses["node"])
        return np.linalg.solve(T_three_world, T_three_node)

    def shows(self, node: str) -> bool:
        """Return whether a node and all above it are visible."""
        return bool(self.frame.evaluate("(name) => harness.shows(name)", node))

    def project(self, point: ArrayLike) -> Pixel:
        """Return the pixel of a point (3,) [m] of viser's world."""
        view = self.frame.evaluate("() => harness.view()")
        return self._pixel(view, _matrix(view["root"]) @ [*np.asarray(point, float), 1.0])

    def project_three(self, point: ArrayLike) -> Pixel:
        """Return the pixel of a point (3,) [m] of three.js's world."""
        return self._pixel(self.frame.evaluate("() => harness.view()"), np.append(point, 1.0))

    def look_from(self, camera: Camera) -> None:
        """Turn the window's camera."""
        self.frame.evaluate(
            "(look) => harness.lookFrom(...look)", [camera.position, camera.look_at]
        )

    def _pixel(self, view: dict[str, Any], point: Matrix) -> Pixel:
        clip = _matrix(view["projection"]) @ _matrix(view["inverse"]) @ point
        x, y = clip[:2] / clip[3]
        left, top, width, height = view["rectangle"]
        return self._in_window((left + (1 + x) / 2 * width, top + (1 - y) / 2 * height))

    def _in_window(self, pixel: Sequence[float]) -> Pixel:
        """Return the pixel of the window for ``pixel`` of viser's document."""
        left, top = 0.0, 0.0
        if self.frame.parent_frame is not None:
            box = self.frame.frame_element().bounding_box()
            assert box is not None, "viser's frame is hidden"
            left, top = box["x"], box["y"]
        return left + pixel[0], top + pixel[1]

    # Dragging in the scene

    def grip_arrow(self, node: str, axis: Axis) -> Grip:
        """Return a grip on the arrow along a control's own axis; values are in metres."""
        return ArrowGrip(self, node, axis)

    def grip_ring(self, node: str, axis: Axis) -> Grip:
        """Return a grip on the ring about a control's own axis; values are in radians."""
        return RingGrip(self, node, axis)

    def handle(self, node: str, kind: str, axis: Axis) -> tuple[Pixel, Matrix, Matrix]:
        """Return where a press meets an arrow or ring, in pixels and (3,), and its pose (4, 4).

        Point and pose are in three.js's world.
        """
        spot = self.frame.evaluate("(which) => harness.grip(...which)", [node, kind, axis])
        return self._in_window(spot["pixel"]), np.array(spot["hit"]), _matrix(spot["matrix"])

    def drag_arrow(self, node: str, axis: Axis, metres: float, *, steps: int = DRAG_STEPS) -> None:
        """Drag a control along one of its own axes and release it."""
        with self.grip_arrow(node, axis) as grip:
            grip.sweep(metres, steps)

    # The panel

    def _label(self, label: str) -> Locator:
        named = self.frame.locator("label").filter(has_text=re.compile(f"^{re.escape(label)}$"))
        return named.filter(visible=True).first

    def _labelled(self, label: str) -> Locator:
        return self.frame.locator(f'[id="{self._label(label).get_attribute("for")}"]')

    def slider_value(self, label: str) -> float:
        """Return the value that a slider shows, in its own unit."""
        thumb = self._labelled(label).get_by_role("slider")
        return float(thumb.get_attribute("aria-valuenow") or "nan")

    def slider_values(self) -> dict[str, float]:
        """Return the values of all sliders by label."""
        shown: dict[str, float] = self.frame.evaluate(
            """() => {
                const sliders = [...document.querySelectorAll("[role=slider]")];
                return Object.fromEntries(sliders.map((each) => {
                    const { id } = each.closest(".mantine-Slider-root");
                    const label = document.querySelector(`label[for="${id}"]`);
                    return [label?.innerText, Number(each.getAttribute("aria-valuenow"))];
                }));
            }"""
        )
        return shown

    def drag_slider(self, label: str, value: float, *, steps: int = DRAG_STEPS) -> float:
        """Drag a slider's thumb to a value, as exactly as pixels allow; return the shown value."""
        slider = self._labelled(label)
        slider.scroll_into_view_if_needed()
        thumb = slider.get_by_role("slider")
        low, high = (float(thumb.get_attribute(f"aria-value{end}") or 0) for end in ("min", "max"))
        track = slider.locator(".mantine-Slider-trackContainer").bounding_box()
        assert track is not None, f"the slider {label} is not visible"
        start, stop = (
            track["x"] + track["width"] * (number - low) / (high - low)
            for number in (self.slider_value(label), value)
        )
        y = track["y"] + track["height"] / 2
        self.page.mouse.move(start, y)
        self.page.mouse.down()
        self.page.mouse.move(stop, y, steps=steps)
        self.page.mouse.up()
        return self.slider_value(label)

    def number_box(self, label: str, *, index: int = 0) -> Locator:
        """Return the number box beside a label, or one of several boxes."""
        row = self._label(label).locator("xpath=ancestor::*[.//input][1]")
        return row.locator("input:not([type=hidden])").nth(index)

    def type_number(self, label: str, value: float, *, index: int = 0) -> None:
        """Type a number into the box beside a label, or into one of several boxes."""
        box = self.number_box(label, index=index)
        box.fill(str(value))
        box.press("Enter")
        # viser delays changes and keeps only the newest of each control.
        self.page.wait_for_timeout(2 * THROTTLE_MILLISECONDS)

    def chosen(self, label: str) -> str:
        """Return the chosen option of a list."""
        return self._labelled(label).input_value()

    def choose(self, label: str, option: str) -> None:
        """Choose an option of a list."""
        self._labelled(label).click()
        self.frame.get_by_role("option", name=option, exact=True).click()

    def click_button(self, label: str) -> None:
        """Click the button with this text."""
        self.frame.get_by_role("button", name=label, exact=True).click()

    def press_in_bar(self, label: str) -> None:
        """Press the button with this text in the app's own page, around viser's."""
        self.page.get_by_role("button", name=label, exact=True).click()

    # Evidence

    def picture(self) -> NDArray[np.uint8]:
        """Return the colours of the window (height, width, 3), indexed by pixels of `project`."""
        return np.asarray(imageio.imread(self._png(), extension=".png")[..., :3])

    def keep(self, path: Path) -> None:
        """Write a PNG for people if KATANA450_PICTURES is set; each takes seconds."""
        if "KATANA450_PICTURES" in os.environ:
            self.screenshot(path)

    def scene_picture(self) -> NDArray[np.uint8]:
        """Return the colours (height, width, 3) of the scene without the surrounding page."""
        with self._drawing():
            return np.asarray(imageio.imread(self._canvas(), extension=".png")[..., :3])

    def screenshot(self, path: Path) -> Path:
        """Write a PNG of the window, or only of the scene if the window cannot be captured."""
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(self._png())
        return path

    def _png(self) -> bytes:
        with self._drawing():
            try:
                # With a path, Playwright would write the file in a thread that it never ends.
                return self.page.screenshot(timeout=20_000)
            except PlaywrightTimeoutError:
                # While shaders compile, the browser gets no frame; the canvas can be read anyway.
                return self._canvas()

    def _canvas(self) -> bytes:
        data: str = self.frame.evaluate("__viserMutable.canvas.toDataURL('image/png')")
        return base64.b64decode(data.partition(",")[2])

    @contextmanager
    def _drawing(self) -> Iterator[None]:
        """Draw every frame within the block, if there is a scene."""
        if not self.frame.evaluate("() => Boolean(window.__viserMutable)"):
            yield
            return
        before = self.frame.evaluate("() => harness.draw(true)")
        self.wait_drawn()
        try:
            yield
        finally:
            self.frame.evaluate("(draws) => harness.draw(draws)", before)


def _matrix(elements: Sequence[float]) -> Matrix:
    return np.array(elements, float).reshape(4, 4).T
