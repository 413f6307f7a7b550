"""Jogging at the page: held keys, pads, buttons, a gamepad and a SpaceMouse."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from katana450.client import connect
from tests.browser.page import WINDOW, ViserPage
from tests.browser.server import AppServer
from tests.browser.session import MOVE, Truth, bar, camera, clear_stop


def tool_point(page: ViserPage) -> Any:
    names = page.frame.evaluate("() => Object.keys(__viserMutable.nodeRefFromName)")
    tcp = next(name for name in names if name.startswith("/arm") and name.endswith("/tcp"))
    return page.node_pose(tcp)


def wait_moved(page: ViserPage, start: Any, axis: int, sign: int) -> None:
    page.wait_until(
        lambda: sign * (tool_point(page)[axis, 3] - start[axis]) > 0.01, "the tool to move"
    )


KEYS = (("KeyW", 0, 1), ("KeyS", 0, -1), ("KeyA", 1, 1), ("KeyD", 1, -1), ("KeyR", 2, 1))
"""Keys, each with the axis and the sign of the tool's motion."""


@pytest.mark.long
@pytest.mark.parametrize("document", ["page", "viser"])
def test_a_held_key_moves_the_tool_along_one_axis(
    page: ViserPage, truth: Truth, document: str
) -> None:
    page.page.click("#jog-button")
    if document == "viser":
        page.page.mouse.click(60, 300)
    looked = camera(page)

    def rests() -> bool:
        before = tool_point(page)
        page.page.wait_for_timeout(300)
        return np.array_equal(tool_point(page), before)

    for key, axis, sign in KEYS:
        start = tool_point(page)[:3, 3]
        page.page.keyboard.down(key)
        wait_moved(page, start, axis, sign)
        page.page.keyboard.up(key)
        truth.wait(mood="ok")
        page.wait_until(rests, "the tool to rest")
    # viser uses the same keys for its camera.
    assert np.allclose(camera(page), looked, atol=1e-6)


@pytest.mark.cases(1)
@pytest.mark.parametrize("between", ["Control", "#own-name"])
def test_released_key_ends_its_jog_whatever_was_pressed_or_has_the_focus(
    page: ViserPage, truth: Truth, between: str
) -> None:
    page.page.click("#jog-button")
    page.page.click("#more-button")
    page.page.evaluate("() => document.activeElement.blur()")
    page.page.keyboard.down("KeyW")
    truth.wait(moving=True)
    if between == "Control":
        page.page.keyboard.down(between)
    else:
        page.page.focus(between)
    page.page.keyboard.up("KeyW")
    page.page.keyboard.up("Control")
    truth.wait(moving=False)
    page.page.click("#more-button")


def test_pads_and_buttons_move_while_they_are_held(
    page: ViserPage, truth: Truth, artefacts: Path
) -> None:
    page.page.click("#jog-button")
    mouse = page.page.mouse
    for selector, (right, down), axis, sign in (
        ("#plane", (0.5, 0.05), 0, 1),
        ("#plane", (0.95, 0.5), 1, -1),
        ("#lift", (0.5, 0.05), 2, 1),
    ):
        box = page.page.locator(selector).bounding_box()
        assert box is not None
        start = tool_point(page)[:3, 3]
        mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
        mouse.down()
        mouse.move(box["x"] + right * box["width"], box["y"] + down * box["height"], steps=3)
        wait_moved(page, start, axis, sign)
        if axis == 1:
            page.keep(artefacts / "gateway-jog.png")
        mouse.up()
        truth.wait(mood="ok")
    start = page.slider_value("5 wrist roll")
    box = page.page.get_by_role("button", name="Roll right").bounding_box()
    assert box is not None
    mouse.move(box["x"] + 10, box["y"] + 10)
    mouse.down()
    page.wait_until(lambda: page.slider_value("5 wrist roll") > start + 3.0, "the tool to roll")
    mouse.up()
    truth.wait(mood="ok")
    # At 200 % zoom too, each button has room for its words and its key.
    page.page.set_viewport_size({"width": 720, "height": 450})
    room = """() => [...document.querySelectorAll("#turns button:not([hidden])")].every((each) =>
        each.scrollWidth <= each.clientWidth && each.getBoundingClientRect().right <= innerWidth)"""
    assert page.page.evaluate(room)
    page.page.set_viewport_size({"width": WINDOW[0], "height": WINDOW[1]})


GAMEPAD = """() => {
  window.pad = {connected: true, index: 0, mapping: "standard", id: "synthetic",
    axes: [0, 0, 0, 0], buttons: Array.from({length: 17}, () => ({pressed: false, value: 0}))};
  navigator.getGamepads = () => [window.pad];
}"""


def test_gamepad_moves_only_with_its_shoulder_button(page: ViserPage, truth: Truth) -> None:
    page.page.evaluate(GAMEPAD)
    page.page.click("#jog-button")
    start = tool_point(page)[:3, 3]
    page.page.evaluate("() => { pad.axes[0] = -1 }")
    page.page.wait_for_timeout(400)
    assert np.allclose(tool_point(page)[:3, 3], start, atol=1e-6)
    assert "hold LB or RB" in bar(page, "gamepad")
    page.page.evaluate("() => { pad.buttons[4].pressed = true }")
    wait_moved(page, start, 1, 1)
    page.page.evaluate("() => { pad.buttons[4].pressed = false }")
    truth.wait(mood="ok")
    # Button B is STOP. The gamepad is also unplugged while its stick is deflected.
    page.page.evaluate("() => { pad.buttons[5].pressed = true }")
    page.page.wait_for_timeout(200)
    page.page.evaluate("() => { navigator.getGamepads = () => [] }")
    truth.wait(mood="ok")
    page.page.evaluate(
        "() => { navigator.getGamepads = () => [pad]; pad.buttons[1].pressed = true }"
    )
    truth.wait(mood="stopped")
    page.page.evaluate("() => { navigator.getGamepads = () => [] }")
    clear_stop(page, truth)


@pytest.mark.cases(1)
@pytest.mark.parametrize("by", ["key", "gamepad"])
def test_what_is_held_when_a_stop_is_cleared_moves_nothing(
    page: ViserPage, server: AppServer, truth: Truth, by: str
) -> None:
    page.page.evaluate(GAMEPAD)
    page.page.click("#jog-button")
    page.page.wait_for_timeout(200)
    if by == "key":
        page.page.keyboard.down("KeyA")
    else:
        page.page.evaluate("() => { pad.buttons[4].pressed = true; pad.axes[0] = -1 }")
    truth.wait(moving=True)
    # Another person stops the arm.
    with connect(server.url, "Anna") as anna:
        anna.stop()
    truth.wait(mood="stopped")
    page.page.wait_for_timeout(1100)
    # The browser repeats a held key.
    if by == "key":
        page.page.keyboard.down("KeyA")
    clear_stop(page, truth)
    start = np.array(truth.status()["q"])
    page.page.wait_for_timeout(400)
    assert np.allclose(truth.status()["q"], start, atol=1e-6)
    # At rest, it counts again.
    page.page.keyboard.up("KeyA")
    page.page.evaluate("() => { pad.buttons[4].pressed = false }")
    page.page.wait_for_timeout(200)
    if by == "key":
        page.page.keyboard.down("KeyA")
    page.page.evaluate("(by) => { pad.buttons[4].pressed = by === 'gamepad' }", by)
    truth.wait(moving=True)
    page.page.keyboard.up("KeyA")
    page.page.evaluate("() => { pad.buttons[4].pressed = false }")
    truth.wait(moving=False)
    page.page.evaluate("() => { navigator.getGamepads = () => [] }")


def test_gamepad_stops_the_arm_with_the_sheet_closed(page: ViserPage, truth: Truth) -> None:
    page.page.evaluate(GAMEPAD)
    page.page.evaluate("() => { pad.buttons[1].pressed = true }")
    truth.wait(mood="stopped")
    page.page.evaluate("() => { navigator.getGamepads = () => [] }")
    clear_stop(page, truth)


SPACEMOUSE = """
  const device = Object.assign(new EventTarget(), {
    opened: false, productName: "Synthetic SpaceMouse", open: async () => { device.opened = true },
    push(id, numbers) {
      const data = new DataView(new ArrayBuffer(2 * numbers.length));
      numbers.forEach((number, i) => data.setInt16(2 * i, number, true));
      device.dispatchEvent(Object.assign(new Event("inputreport"), {reportId: id, data}));
    },
    press(bits) {
      const data = new DataView(new ArrayBuffer(2));
      data.setUint8(0, bits);
      device.dispatchEvent(Object.assign(new Event("inputreport"), {reportId: 3, data}));
    },
  });
  window.device = device;
  const hid = {getDevices: async () => [], requestDevice: async () => [device]};
  Object.defineProperty(navigator, "hid", {value: hid});
"""


@pytest.mark.long
def test_a_spacemouse_moves_while_it_is_pushed(truth: Truth, new_page: ViserPage) -> None:
    window = new_page.page
    window.add_init_script(SPACEMOUSE)
    window.reload()
    window.locator("#holder", has_text="You drive").wait_for()
    page = ViserPage(window, next(f for f in window.frames if "/viser/" in f.url), new_page.errors)
    page.wait_ready((MOVE,))
    page.page.click("#jog-button")
    page.press_in_bar("Connect a SpaceMouse")
    page.page.get_by_role("button", name="Synthetic SpaceMouse").wait_for()
    start = tool_point(page)[:3, 3]
    # The cap is pushed to the left; a held SpaceMouse reports all the time.
    page.page.evaluate(
        "() => { window.held = setInterval(() => device.push(1, [-350, 0, 0]), 16) }"
    )
    wait_moved(page, start, 1, 1)
    # The cable is unplugged during a push, so no report announces the release.
    page.page.evaluate("() => clearInterval(held)")
    truth.wait(mood="ok")
    # The cap stays pushed when the stop is cleared.
    push = "() => { window.held = setInterval(() => device.push(1, [-350, 0, 0]), 16) }"
    page.page.wait_for_timeout(1100)
    page.page.evaluate(push)
    truth.wait(moving=True)
    page.page.evaluate("() => device.press(1)")
    truth.wait(mood="stopped")
    clear_stop(page, truth)
    rests = np.array(truth.status()["q"])
    page.page.wait_for_timeout(400)
    assert np.allclose(truth.status()["q"], rests, atol=1e-6)
    page.page.evaluate("() => { clearInterval(held); device.push(1, [0, 0, 0]) }")
    page.page.evaluate(push)
    truth.wait(moving=True)
    page.page.evaluate("() => clearInterval(held)")
    truth.wait(moving=False)
