"""Joints that are turned by their links in the scene, by mouse, finger and keys."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from katana450.client import connect
from katana450.server.api import answers
from tests.browser.camera import Camera
from tests.browser.conftest import OpenPage
from tests.browser.finger import fingers
from tests.browser.page import Pixel, ViserPage
from tests.browser.server import AppServer
from tests.browser.session import AXES, MOVE, READY, Truth, bar, camera, clear_stop, take
from tests.browser.sizes import PHONE, PORTRAIT
from tests.browser.spots import Spot, seen_at, spot

SIDE = Camera((0.25, -1.6, 0.45), (0.25, 0.0, 0.4))
TURN = -0.5
"""Angle [rad] by which the mouse goes round the axis, anticlockwise on the screen."""

FOLLOWS = 2.0
"""Maximum distance [px] between a grabbed point and the mouse."""

EMISSIVE = """(name) => {
    const lit = new Set();
    katanaScene.node(name).traverse((each) => each.material?.emissiveIntensity < 1
        && each.material.emissive.getHex() && lit.add(each));
    return lit.size;
}"""


@pytest.fixture
def page(page: ViserPage) -> ViserPage:
    """Return the window with the camera at the side."""
    page.page.wait_for_selector("#cube", state="attached")
    page.look_from(SIDE)
    return page


@pytest.fixture
def links(server: AppServer) -> list[str]:
    """Return the node of the link that each joint moves."""
    with connect(server.url, "Reader") as reader:
        return ["/arm/" + "/".join(link.path) for link in reader.query(answers.Arm).links]


def q(truth: Truth) -> Any:
    return np.array(truth.status()["q"])


def rest(truth: Truth) -> Any:
    truth.wait(20.0, moving=False)
    return q(truth)


def on_axis(page: ViserPage, link: str, place: Spot) -> Pixel:
    """Return the pixel on the axis (y of the link) nearest to ``place``."""
    return page.project((page.node_pose(link) @ [0.0, place.point[1], 0.0, 1.0])[:3])


def hover(page: ViserPage, pixel: Pixel) -> None:
    page.page.mouse.move(pixel[0] - 3.0, pixel[1])
    page.page.mouse.move(*pixel)


def label(page: ViserPage) -> str:
    shown = page.page.locator("#joint-label")
    return shown.inner_text() if shown.is_visible() else ""


def drag(page: ViserPage, start: Pixel, by: Pixel, *, steps: int = 10) -> None:
    """Press the mouse and move it; it stays pressed."""
    hover(page, start)
    page.page.mouse.down()
    page.page.wait_for_timeout(150)
    for step in range(1, steps + 1):
        page.page.mouse.move(start[0] + by[0] * step / steps, start[1] + by[1] * step / steps)
        page.page.wait_for_timeout(30)


@pytest.mark.long
def test_link_under_the_mouse_is_named_and_highlighted(
    page: ViserPage, links: list[str], artefacts: Path
) -> None:
    for joint, name in enumerate(AXES):
        hover(page, spot(page, links, joint).pixel)
        page.wait_until(lambda name=name: label(page) == name, name)  # type: ignore[misc]
        assert page.frame.evaluate("katanaScene.viewer().canvas.style.cursor") == "pointer"
        assert page.frame.evaluate(EMISSIVE, links[joint]) > 0
    page.keep(artefacts / "link-hover.png")
    hover(page, (500.0, 300.0))
    page.wait_until(lambda: label(page) == "", "the name to go")
    assert page.frame.evaluate(EMISSIVE, "/arm") == 0
    assert page.frame.evaluate("katanaScene.viewer().canvas.style.cursor") == ""


def test_grabbed_point_follows_the_mouse_and_one_undo_brings_it_back(
    page: ViserPage, links: list[str], truth: Truth, artefacts: Path
) -> None:
    grabbed, view = spot(page, links, 2), camera(page)
    axis = on_axis(page, links[2], grabbed)
    start = np.subtract(grabbed.pixel, axis)
    c, s = np.cos(TURN), np.sin(TURN)
    end = np.array(((c, -s), (s, c))) @ start
    drag(page, grabbed.pixel, tuple(end - start))
    assert label(page).startswith("3 elbow")
    rest(truth)
    away = np.subtract(seen_at(page, links[2], grabbed), axis + end)
    assert np.hypot(*away) < FOLLOWS
    page.keep(artefacts / "link-drag.png")
    page.page.mouse.up()
    moved = rest(truth)
    assert list(np.abs(moved - READY) > 1e-6) == [False, False, True, False, False]
    assert abs(moved[2] - READY[2]) > 0.3
    assert np.allclose(camera(page), view, atol=1e-3)
    page.page.keyboard.press("Control+z")
    page.wait_until(lambda: np.allclose(q(truth), READY, atol=1e-6), "the way back")


@pytest.mark.long
def test_stop_ends_a_drag_and_a_stopped_arm_refuses_another(
    page: ViserPage, links: list[str], truth: Truth
) -> None:
    start = spot(page, links, 2).pixel
    drag(page, start, (0.0, -40.0))
    page.page.keyboard.press("Space")
    truth.wait(mood="stopped")
    stopped = rest(truth)
    # What is held at a stop moves nothing, also after it is cleared.
    page.page.wait_for_selector("#clear-stop:not([hidden]):enabled")
    # The mouse still holds the link.
    page.page.locator("#clear-stop").evaluate("(each) => each.click()")
    truth.wait(stopped=None)
    page.page.mouse.move(start[0], start[1] + 60.0, steps=5)
    page.page.wait_for_timeout(200)
    page.page.mouse.up()
    assert np.allclose(rest(truth), stopped, atol=1e-6)
    page.page.keyboard.press("Space")
    truth.wait(mood="stopped")
    drag(page, spot(page, links, 2).pixel, (0.0, 50.0))
    page.wait_until(lambda: "stop" in bar(page, "toast").lower(), "the refusal")
    page.page.mouse.up()
    assert np.allclose(rest(truth), stopped, atol=1e-6)
    clear_stop(page, truth)


@pytest.mark.long
@pytest.mark.parametrize("loss", ["pointercancel", "blur"])
def test_lost_pointer_ends_the_drag_and_the_arm_holds(
    page: ViserPage, links: list[str], truth: Truth, loss: str
) -> None:
    start = spot(page, links, 1).pixel
    drag(page, start, (120.0, 20.0), steps=4)
    page.frame.evaluate(
        """(loss) => {
            if (loss === "blur") {
                parent.document.hasFocus = () => false;
                dispatchEvent(new Event("blur"));
            } else dispatchEvent(new PointerEvent("pointercancel", { pointerId: 1 }));
        }""",
        loss,
    )
    held = rest(truth)
    page.page.mouse.move(start[0] - 100.0, start[1], steps=5)
    page.page.wait_for_timeout(200)
    assert np.allclose(rest(truth), held, atol=1e-6)
    # It came to rest on the way.
    assert np.allclose(truth.status()["goal"], held, atol=1e-3)
    page.page.mouse.up()


@pytest.mark.long
def test_finger_takes_hold_of_the_selected_link_only(
    server: AppServer,
    open_page: OpenPage,
    links: list[str],
    truth: Truth,
    artefacts: Path,
) -> None:
    page = open_page(server.url, nodes=("/arm", MOVE), window=PORTRAIT, camera=SIDE, **PHONE)
    page.page.wait_for_selector("#cube", state="attached")
    take(page)
    start = rest(truth)

    def swipe(start: Pixel, by: Pixel) -> None:
        with fingers(page.page) as hand:
            hand.put(start)
            hand.move((start[0] + by[0], start[1] + by[1]), seconds=0.6, steps=10)
            hand.lift()

    view = camera(page)
    swipe(spot(page, links, 2).pixel, (30.0, 20.0))
    page.wait_until(lambda: not np.allclose(camera(page), view, atol=1e-2), "another view")
    assert np.allclose(rest(truth), start, atol=1e-6)
    page.look_from(SIDE)
    page.settled(lambda: camera(page), "the camera")
    page.page.touchscreen.tap(*spot(page, links, 2).pixel)
    chosen = page.page.get_by_role("group", name="Selected joint")
    chosen.wait_for()
    for button in chosen.get_by_role("button").all():
        box = button.bounding_box()
        assert box is not None
        assert min(box["width"], box["height"]) >= 44.0
    page.keep(artefacts / "link-selected-phone.png")
    swipe(spot(page, links, 2).pixel, (0.0, -30.0))
    turned = rest(truth) - start
    assert abs(turned[2]) > 0.1
    assert np.allclose(np.delete(turned, 2), 0.0, atol=1e-6)
    assert chosen.is_visible()
    assert page.errors == []
