"""The app's own page in a real browser: STOP, who drives, the state of the line, jogging."""

from __future__ import annotations

import asyncio
import json
import os
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from playwright.sync_api import Page

from katana450.arm.control.lease import Role
from katana450.resources import STATIC
from katana450.server.web.access_links import AccessFile
from katana450.settings import Settings
from tests.browser.conftest import OpenPage, Windows
from tests.browser.page import ViserPage
from tests.browser.server import APP, AppServer
from tests.gateway.client import SUBPROTOCOL as VISER
from tests.gateway.client import ask, enter, page_name, websocket
from tests.gateway.slow_link import SlowLink

MOVE = "/target/move"
READY = np.array(Settings().ready)
THIN = 15_000.0
"""[bytes/s] On which viser alone shows an arm of half a minute ago."""


class Truth:
    """What the server itself says, asked without a browser."""

    def __init__(self, server: AppServer) -> None:
        self._url = server.url
        self._cookie = enter(server.url)

    def status(self) -> dict[str, Any]:
        code, _, body = ask(f"{self._url}/api/v1/state", Cookie=self._cookie)
        assert code == 200
        told: dict[str, Any] = json.loads(body)
        mood = "moving" if told["moving"] and told["status"] == "ok" else told["status"]
        return told | {"mood": mood if told["stopped"] is None else "stopped"}

    def wait(self, seconds: float = 5.0, **wanted: Any) -> float:
        """Until the status has these values; how long that took [s]."""
        started = time.monotonic()
        while any(self.status()[key] != value for key, value in wanted.items()):
            assert time.monotonic() - started < seconds, (self.status(), wanted)
            time.sleep(0.005)
        return time.monotonic() - started


@contextmanager
def crowd(server: AppServer, size: int) -> Iterator[None]:
    """So many viewers, each of whom takes in all there is to see."""
    over = threading.Event()

    async def watch() -> None:
        path = f"/viser?page={page_name()}"
        async with websocket(server.url, path, enter(server.url), subprotocols=[VISER]) as socket:
            while not over.is_set():
                try:
                    await asyncio.wait_for(socket.recv(), 0.2)
                except TimeoutError:
                    continue

    async def watch_all() -> None:
        await asyncio.gather(*(watch() for _ in range(size)))

    thread = threading.Thread(target=lambda: asyncio.run(watch_all()))
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()


def mood(page: Page) -> str | None:
    return page.get_attribute("body", "data-mood")


def clear_stop(page: ViserPage, truth: Truth) -> None:
    page.press_in_bar("Clear stop")
    truth.wait(stopped=None)
    page.wait_until(lambda: mood(page.page) != "stopped", "the bar to follow")


@pytest.fixture(scope="module")
def server() -> Iterator[AppServer]:
    with AppServer() as server:
        yield server


@pytest.fixture
def truth(server: AppServer) -> Truth:
    return Truth(server)


@pytest.fixture(scope="module")
def window(server: AppServer, windows: Windows) -> Iterator[ViserPage]:
    with windows.open(server.url, nodes=("/arm", MOVE)) as page:
        yield page


@pytest.fixture
def page(window: ViserPage, truth: Truth) -> Iterator[ViserPage]:
    """A window whose person drives, the arm at home."""
    prepare(window, truth)
    yield window
    if window.page.get_attribute("#jog-button", "aria-expanded") == "true":
        window.page.click("#jog-button")
    assert window.errors == []


@pytest.fixture
def new_page(server: AppServer, open_page: OpenPage, truth: Truth) -> Iterator[ViserPage]:
    """Likewise, and no other test sees it."""
    page = open_page(server.url, nodes=("/arm", MOVE))
    prepare(page, truth)
    yield page
    assert page.errors == []


def prepare(page: ViserPage, truth: Truth) -> None:
    take(page)
    if truth.status()["stopped"] is not None:
        # The window before went while its arm still moved.
        clear_stop(page, truth)
    go_home(page, truth)


def joints(page: ViserPage) -> Any:
    shown = page.slider_values()
    return np.radians([shown[f"Axis {axis}"] for axis in range(1, 6)])


def take(page: ViserPage) -> None:
    """The window before may still count as there, or just not any more."""

    def taken() -> bool:
        page.page.evaluate(
            """() => [...document.querySelectorAll("#acts button")]
              .find((each) => /^Take/.test(each.textContent))?.click()"""
        )
        return bar(page, "holder") == "You drive"

    page.wait_until(taken, "the arm")


def bar(page: ViserPage, part: str) -> str:
    """What the bar shows there."""
    return page.page.inner_text(f"#{part}")


def go_home(page: ViserPage, truth: Truth) -> None:
    page.click_button("Home")
    page.wait_until(lambda: np.allclose(joints(page), READY, atol=1e-6), "the sliders at home")
    truth.wait(20.0, mood="ok")
    page.page.wait_for_timeout(100)


STOPS = 50 if "KATANA450_LONG" in os.environ else 3
"""In each of four situations; all of them with `make test-long`."""


def test_stop_works_under_any_load(
    page: ViserPage, server: AppServer, truth: Truth, open_page: OpenPage
) -> None:
    """Clicked while a key jogs, by keys in a drag, from the far end of a thin line."""
    took: list[float] = []

    def stopped() -> None:
        took.append(truth.wait(2.0, mood="stopped"))

    def while_jogging(presser: ViserPage) -> None:
        page.page.click("#jog-button")
        for number in range(STOPS):
            key = "KeyA" if number % 2 else "KeyD"
            page.page.keyboard.down(key)
            page.page.wait_for_timeout(60)
            presser.page.click("#stop")
            stopped()
            page.page.keyboard.up(key)
            clear_stop(page, truth)
        page.page.click("#jog-button")

    with SlowLink(server.port, 1e9) as line, crowd(server, 8):
        far = open_page(f"http://127.0.0.1:{line.port}", nodes=("/arm", MOVE))
        while_jogging(page)
        go_home(page, truth)
        for number in range(STOPS):
            with page.grip_arrow(MOVE, "z") as grip:
                grip.to(0.02)
                page.page.keyboard.press("Space" if number % 2 else "Escape")
                stopped()
                grip.to(-0.02)
            clear_stop(page, truth)
        for number in range(STOPS):
            page.drag_slider("Axis 1", 20.0 if number % 2 else -20.0, steps=2)
            page.frame.locator("body").press("Escape" if number % 2 else " ")
            stopped()
            clear_stop(page, truth)
        line.rate = THIN
        while_jogging(far)
        line.rate = 1e9
    assert len(took) == 4 * STOPS
    print(
        f"STOP {len(took)} of {4 * STOPS}, p50 {1e3 * np.median(took):.0f} ms, "
        f"worst {1e3 * max(took):.0f} ms"
    )


def test_command_from_before_a_stop_moves_nothing_after_it(page: ViserPage, truth: Truth) -> None:
    q = [page.slider_value(f"Axis {axis}") for axis in range(1, 6)]
    with page.grip_arrow(MOVE, "z") as grip:
        page.page.keyboard.press("Space")
        truth.wait(mood="stopped")
        reset_by_key(page, truth)
        # The hand that held the handle goes on, and moves nothing.
        grip.sweep(0.05, 5)
        page.page.wait_for_timeout(300)
        assert [page.slider_value(f"Axis {axis}") for axis in range(1, 6)] == q
    page.wait_until(
        lambda: page.node_pose(MOVE)[2, 3] == pytest.approx(0.282, abs=2e-3), "the handle to return"
    )
    page.drag_arrow(MOVE, "z", 0.03)
    page.wait_until(lambda: page.slider_value("Axis 2") != q[1], "a fresh drag to move it")
    page.click_button("Home")


def reset_by_key(page: ViserPage, truth: Truth) -> None:
    """The mouse is busy."""
    page.page.wait_for_selector("#clear-stop:not([hidden])")
    page.page.focus("#clear-stop")
    page.page.keyboard.press("Enter")
    truth.wait(stopped=None)


def test_the_arm_goes_from_hand_to_hand(
    page: ViserPage, server: AppServer, truth: Truth, open_page: OpenPage, artefacts: Path
) -> None:
    other = open_page(server.url, nodes=("/arm", MOVE))
    me, they = (bar(each, "name").partition(",")[0] for each in (page, other))
    other.wait_until(lambda: bar(other, "holder") == f"{me} drives", "who drives")
    # A control of who does not drive springs back, and says why.
    before = other.slider_value("Axis 1")
    other.drag_slider("Axis 1", 40.0)
    other.wait_until(lambda: bar(other, "toast") == f"{me} holds the arm: ask for it.", "why not")
    other.wait_until(lambda: other.slider_value("Axis 1") == before, "the slider to spring back")
    other.press_in_bar("Request")
    page.wait_until(lambda: f"{they} asks for it" in bar(page, "name"), "the request")
    page.keep(artefacts / "gateway-request.png")
    page.press_in_bar(f"Give to {they}")
    other.wait_until(lambda: bar(other, "holder") == "You drive", "the arm")
    assert truth.status()["holder"] == they
    page.press_in_bar("Take over")
    page.wait_until(lambda: bar(page, "holder") == "You drive", "the arm")
    page.page.select_option("#acts select", label=they)
    other.wait_until(lambda: bar(other, "holder") == "You drive", "the arm")
    other.press_in_bar("Release")
    page.wait_until(lambda: bar(page, "holder") == "Nobody drives", "nobody to drive")
    # Who touches a control first has it.
    other.drag_slider("Axis 1", 10.0)
    other.wait_until(lambda: bar(other, "holder") == "You drive", "the arm")
    assert other.errors == []


def camera(page: ViserPage) -> Any:
    body = page.sent("ViewerCameraMessage")[-1].body
    return np.array([body["position"], body["look_at"]])


def test_a_page_that_is_loaded_anew_still_drives(new_page: ViserPage) -> None:
    name = bar(new_page, "name")
    new_page.page.reload()
    new_page.page.locator("#holder", has_text="You drive").wait_for()
    assert bar(new_page, "name") == name


def test_a_thin_line_shows_few_pictures_but_no_old_ones(
    page: ViserPage, server: AppServer, truth: Truth, open_page: OpenPage
) -> None:
    with SlowLink(server.port, 1e9) as line:
        far = open_page(f"http://127.0.0.1:{line.port}", nodes=("/arm", MOVE))
        node = "/arm/base_link/arm_base_link/pan_link"
        node = next(
            name
            for name in far.frame.evaluate("() => Object.keys(__viserMutable.nodeRefFromName)")
            if name.endswith("/pan_link") and name.startswith("/arm")
        )
        line.rate = THIN

        def turns(each: ViserPage, since: float) -> list[tuple[float, float]]:
            told = each.messages("SetOrientationMessage", node=node, since=since)
            return [(m.time, 2.0 * np.arctan2(m.body["wxyz"][3], m.body["wxyz"][0])) for m in told]

        since = time.time()
        for degrees in (150.0, -150.0, 150.0, -150.0):
            page.type_number("Axis 1", degrees)
            page.page.wait_for_timeout(1000)
            truth.wait(20.0, mood="ok")
        rested = time.monotonic()
        far.wait_until(
            lambda: turns(far, since)[-1][1] == pytest.approx(turns(page, since)[-1][1], abs=1e-6),
            "the far window to show the end",
        )
        rested = time.monotonic() - rested
        near, seen = turns(page, since), turns(far, since)
        line.rate = 1e9
    # When was the near window where the far one is? On a line without memory: a moment ago.
    ages = []
    times, angles = (np.array(each) for each in zip(*near, strict=True))
    for at, angle in seen:
        before = times <= at
        same = np.abs(angles[before] - angle) < 1e-6
        if same.any():
            ages.append(at - times[before][same][-1])
    print(
        f"{len(near)} pictures near, {len(seen)} far; age p50 {np.median(ages):.2f} s, "
        f"worst {max(ages):.2f} s"
    )
    assert np.median(ages) < 2.5
    assert max(ages) < 5.0
    assert rested < 5.0


# Jogging


def tool_point(page: ViserPage) -> Any:
    names = page.frame.evaluate("() => Object.keys(__viserMutable.nodeRefFromName)")
    tcp = next(name for name in names if name.startswith("/arm") and name.endswith("/tcp"))
    return page.node_pose(tcp)


def wait_moved(page: ViserPage, start: Any, axis: int, sign: int) -> None:
    page.wait_until(
        lambda: sign * (tool_point(page)[axis, 3] - start[axis]) > 0.01, "the tool to move"
    )


@pytest.mark.parametrize(
    ("key", "axis", "sign"),
    [("KeyW", 0, 1), ("KeyS", 0, -1), ("KeyA", 1, 1), ("KeyD", 1, -1), ("KeyR", 2, 1)],
)
@pytest.mark.parametrize("document", ["page", "viser"])
def test_a_held_key_moves_the_tool_along_one_axis(
    page: ViserPage, truth: Truth, key: str, axis: int, sign: int, document: str
) -> None:
    page.page.click("#jog-button")
    if document == "viser":
        page.page.mouse.click(60, 300)
    looked = camera(page)
    start = tool_point(page)[:3, 3]
    page.page.keyboard.down(key)
    wait_moved(page, start, axis, sign)
    page.page.keyboard.up(key)
    truth.wait(mood="ok")

    def rests() -> bool:
        before = tool_point(page)
        page.page.wait_for_timeout(300)
        return np.array_equal(tool_point(page), before)

    page.wait_until(rests, "the tool to rest")
    # viser has the same keys for its camera.
    assert np.allclose(camera(page), looked, atol=1e-6)


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
    start = page.slider_value("Axis 5")
    box = page.page.get_by_role("button", name="Roll right").bounding_box()
    assert box is not None
    mouse.move(box["x"] + 10, box["y"] + 10)
    mouse.down()
    page.wait_until(lambda: page.slider_value("Axis 5") > start + 3.0, "the tool to roll")
    mouse.up()
    truth.wait(mood="ok")


GAMEPAD = """() => {
  window.pad = {connected: true, index: 0, mapping: "standard", id: "synthetic",
    axes: [0, 0, 0, 0], buttons: Array.from({length: 17}, () => ({pressed: false, value: 0}))};
  navigator.getGamepads = () => [window.pad];
}"""


def test_a_gamepad_moves_only_while_its_shoulder_button_is_held(
    page: ViserPage, truth: Truth
) -> None:
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
    # Its B is STOP, and it is pulled out while it pushes.
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
    # To the left, with the cap held: it reports all the time.
    page.page.evaluate(
        "() => { window.held = setInterval(() => device.push(1, [-350, 0, 0]), 16) }"
    )
    wait_moved(page, start, 1, 1)
    # The cable comes out in mid-push: no report says that it is let go.
    page.page.evaluate("() => clearInterval(held)")
    truth.wait(mood="ok")
    page.page.evaluate("() => device.press(1)")
    truth.wait(mood="stopped")
    clear_stop(page, truth)


# The page itself


SIZES = {"phone": (390, 844), "tablet": (820, 1180), "desk": (1440, 900)}


@pytest.fixture
def sized(window: ViserPage) -> Iterator[Page]:
    """A window whose size and colours may be changed."""
    before = window.page.viewport_size
    assert before is not None
    yield window.page
    window.page.set_viewport_size(before)
    window.page.emulate_media(color_scheme="light")


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_stop_is_always_there_and_the_biggest(
    page: ViserPage, sized: Page, truth: Truth, artefacts: Path, size: str, scheme: str
) -> None:
    width, height = SIZES[size]
    sized.emulate_media(color_scheme=scheme)  # type: ignore[arg-type]
    sized.set_viewport_size({"width": width, "height": height})

    def areas() -> dict[str, float]:
        """Of all that can be pressed in the bar and lies wholly in the window."""
        found: dict[str, float] = page.page.evaluate(
            """() => {
              const inside = ({left, top, right, bottom}) =>
                left >= 0 && top >= 0 && right <= innerWidth && bottom <= innerHeight;
              return Object.fromEntries(
                [...document.querySelectorAll("header button, header select")]
                  .map((each) => [each, each.getBoundingClientRect()])
                  .filter(([, box]) => box.width)
                  .map(([each, box]) => [each.id || each.textContent,
                    inside(box) ? box.width * box.height : -1]));
            }"""
        )
        return found

    places = []
    for state in ("driving", "stopped"):
        if state == "stopped":
            page.page.click("#stop")
            truth.wait(mood="stopped")
            page.page.wait_for_selector("#clear-stop:not([hidden])")
        found = areas()
        assert min(found.values()) > 0.0, found
        assert found["stop"] == max(found.values())
        assert page.page.evaluate("() => document.documentElement.scrollWidth <= innerWidth")
        page.page.wait_for_timeout(300)
        page.keep(artefacts / f"gateway-{size}-{scheme}-{state}.png")
        places.append(sized.locator("#scene").bounding_box())
    assert places[0] == places[1]
    clear_stop(page, truth)


def test_everything_can_be_reached_by_keys_and_is_named(page: ViserPage) -> None:
    page.page.focus("#stop")
    order = ["stop"]
    for _ in range(6):
        page.page.keyboard.press("Tab")
        order.append(page.page.evaluate("() => document.activeElement.id"))
    # In between, what may be done about who drives.
    buttons = ["instruments-button", "objects-button", "jog-button", "help-button"]
    assert [each for each in order if each] == ["stop", *buttons, "scene"]
    page.page.click("#help-button")
    assert page.page.get_by_role("dialog", name="Help and keys").is_visible()
    assert page.page.locator("#headline").is_visible()
    page.page.click("#stop", trial=True)
    page.page.keyboard.press("Enter")
    assert not page.page.get_by_role("dialog").is_visible()
    for region in ("#mode", "#holder", "#toast"):
        assert page.page.get_attribute(region, "role") == "status"
    assert page.page.get_attribute("#banner", "role") == "alert"


def test_the_page_is_small() -> None:
    assert sum(path.stat().st_size for path in STATIC.iterdir() if path.is_file()) < 75_000
    # These come when they are first wanted.
    assert sum(path.stat().st_size for path in (STATIC / "instruments").iterdir()) < 70_000


def test_a_link_lets_in_and_leaves_no_trace(browser: Any, tmp_path: Path, artefacts: Path) -> None:
    file = AccessFile.create(tmp_path / "access.json")
    token = file.give("Anna", Role.VIEWER, time.time() + 600.0)
    with AppServer((*APP, "--access", str(file.path))) as server:
        context = browser.new_context()
        asked: list[str] = []
        page = context.new_page()
        page.on("request", lambda request: asked.append(request.url))
        page.goto(server.url)
        page.wait_for_selector("#gate:not([hidden])")
        page.screenshot(path=artefacts / "gateway-gate.png")
        page.goto("about:blank")
        page.goto(f"{server.url}/#{token}")
        page.locator("#name", has_text="Anna").wait_for()
        assert page.url == f"{server.url}/"
        assert not [url for url in asked if token in url.partition("#")[0]]
        assert page.evaluate("() => document.cookie") == ""
        assert page.locator("#acts button").count() == 0
        # The next visit needs no link.
        again = context.new_page()
        again.goto(server.url)
        again.locator("#name", has_text="Anna").wait_for()
        context.close()
