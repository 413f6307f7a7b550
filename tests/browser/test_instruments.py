"""The instruments in a real browser: knobs, gauges, plots and their layout."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Literal

import numpy as np
import pytest
from playwright.sync_api import Browser

from katana450.client import connect
from katana450.server.api import answers, requests
from tests.browser.conftest import OpenPage
from tests.browser.instruments import (
    arrange,
    card,
    dial,
    goal,
    middle,
    places,
    reload,
    show,
    slowly,
    table,
    turn,
)
from tests.browser.page import ViserPage
from tests.browser.server import AppServer
from tests.browser.session import MOVE, THIN, Truth, bar, clear_stop, take
from tests.gateway.slow_link import SlowLink

KEPT = "katana450.instruments"
SCHEMES: tuple[Literal["light", "dark"], ...] = ("light", "dark")
SIZES = {"phone": (390, 844), "tablet": (820, 1180), "desk": (1440, 900)}


@pytest.fixture(scope="module")
def truth(server: AppServer) -> Truth:
    return Truth(server)


@pytest.fixture(scope="module")
def window(server: AppServer, browser: Browser) -> Iterator[ViserPage]:
    """Open only our own page, which is fast without viser in its frame."""
    context = browser.new_context(viewport={"width": 1440, "height": 900})
    context.route("**/viser/**", lambda route: route.abort())
    window = context.new_page()
    errors: list[str] = []
    window.on("pageerror", lambda error: errors.append(str(error)))
    window.goto(server.url)
    yield ViserPage(window, window.main_frame, errors)
    context.close()


@pytest.fixture
def page(window: ViserPage, truth: Truth) -> Iterator[ViserPage]:
    """Return the page of a driver with open instruments and the arm at rest."""
    take(window)
    if truth.status()["stopped"] is not None:
        clear_stop(window, truth)
    show(window, True)
    truth.wait(20.0, mood="ok")
    yield window
    assert window.errors == []


def test_a_knob_turns_a_joint_and_the_plots_grow_meanwhile(page: ViserPage, truth: Truth) -> None:
    start = goal(page, "axis-1")
    # A mere touch and a scroll past the knob move nothing.
    x, y, _ = middle(dial(page, "axis-1"))
    page.page.mouse.click(x + 20, y + 20)
    page.page.focus("#stop")
    page.page.mouse.wheel(0, -1)
    page.page.wait_for_timeout(200)
    assert goal(page, "axis-1") == start
    assert truth.status()["goal"][0] == pytest.approx(math.radians(start), abs=1e-9)

    turn(page, "axis-1", 50.0)
    assert goal(page, "axis-1") == pytest.approx(start + 50.0, abs=2.0)
    early = table(page, "joint-angles")
    truth.wait(10.0, mood="ok")
    page.page.wait_for_timeout(600)
    there = math.degrees(truth.status()["q"][0])
    assert there == pytest.approx(goal(page, "axis-1"), abs=0.01)

    grown = table(page, "joint-angles")
    t, angle = grown["t [s]"], grown["Axis 1 [deg]"]
    assert t[-1] > early["t [s]"][-1] + 0.5
    assert (np.diff(t) > 0.0).all()
    assert angle[-1] == pytest.approx(there, abs=0.01)
    # The plot has many points between, and the integral of the speed is the distance.
    moving = angle[(angle > start + 1.0) & (angle < there - 1.0)]
    assert len(np.unique(moving)) > 10
    speeds = table(page, "joint-speeds")
    distance = np.trapezoid(speeds["Axis 1 [deg/s]"], speeds["t [s]"])
    assert distance == pytest.approx(there - start, rel=0.1)


def test_keys_and_wheel_turn_what_has_the_focus(page: ViserPage, truth: Truth) -> None:
    start = goal(page, "axis-5")
    dial(page, "axis-5").focus()
    keyboard = page.page.keyboard
    keyboard.press("PageUp")
    keyboard.press("ArrowRight")
    keyboard.press("Shift+ArrowDown")
    assert goal(page, "axis-5") == pytest.approx(start + 10.9, abs=1e-6)
    # No single key moves the arm to a limit.
    keyboard.press("End")
    page.page.mouse.move(*middle(dial(page, "axis-5"))[:2])
    page.page.mouse.wheel(0, 100)
    page.wait_until(
        lambda: goal(page, "axis-5") == pytest.approx(start + 10.0, abs=1e-6), "the wheel"
    )
    truth.wait(10.0, mood="ok")
    assert math.degrees(truth.status()["q"][4]) == pytest.approx(start + 10.0, abs=1e-3)
    dial(page, "gripper").focus()
    before = truth.status()["gripper_goal"]
    keyboard.press("PageDown")
    page.wait_until(lambda: truth.status()["gripper_goal"] < before - 0.05, "the fingers")
    dial(page, "speed").focus()
    keyboard.press("ArrowDown")
    page.wait_until(lambda: truth.status()["speed"] == pytest.approx(0.95), "the speed")
    keyboard.press("ArrowUp")
    page.wait_until(lambda: truth.status()["speed"] == 1.0, "the speed")


def test_knob_of_a_spectator_springs_back_with_the_reason(
    page: ViserPage, server: AppServer, truth: Truth
) -> None:
    page.press_in_bar("Release")
    with connect(server.url, "Octave") as other:
        other.ask(requests.Acquire())
        page.wait_until(lambda: bar(page, "holder") == "Octave drives", "who drives")
        # A program counts as connected, although it has no page.
        assert bar(page, "name").endswith(", 2 connected")
        before = goal(page, "axis-2")
        turn(page, "axis-2", -30.0)
        page.wait_until(lambda: bar(page, "toast") == "Octave holds the arm: ask for it.", "why")
        page.wait_until(lambda: goal(page, "axis-2") == before, "the knob to spring back")
        assert not other.query(answers.State).moving
        # The knob follows the driver.
        other.ask(requests.Joint(axis=2, value=math.radians(before + 5.0)))
        page.wait_until(
            lambda: goal(page, "axis-2") == pytest.approx(before + 5.0, abs=0.02), "the goal"
        )
        truth.wait(10.0, mood="ok")
        other.ask(requests.ReleaseLease())


@pytest.mark.cases(1)
@pytest.mark.parametrize("key", ["Space", pytest.param("Escape", marks=pytest.mark.long)])
def test_stop_keys_work_on_a_knob(page: ViserPage, truth: Truth, key: str) -> None:
    pause = page.page.locator("#instruments .toolbar").get_by_role("button", name="Pause")
    with slowly(page, truth):
        turn(page, "axis-1", -60.0)
        desired = goal(page, "axis-1")
        dial(page, "axis-1").focus()
        truth.wait(mood="moving")
        page.page.keyboard.press(key)
        truth.wait(2.0, mood="stopped")
        page.page.keyboard.press("PageUp")
        page.wait_until(lambda: bar(page, "toast").startswith("The arm is stopped"), "why not")
        truth.wait(5.0, moving=False)
        rests = math.degrees(truth.status()["q"][0])
        assert rests > desired + 5.0
        page.wait_until(lambda: goal(page, "axis-1") == pytest.approx(rests, abs=0.1), "the knob")
        # Also with the focus on a button, which is not pressed by the key.
        pause.focus()
        page.page.keyboard.press(key)
        assert pause.get_attribute("aria-pressed") == "false"
        clear_stop(page, truth)


def test_gauges_show_the_values_of_the_server(page: ViserPage, truth: Truth) -> None:
    def shows(name: str) -> float:
        meter = card(page, name).get_by_role("meter").first
        return float(meter.get_attribute("aria-valuenow") or "nan")

    page.wait_until(lambda: shows("tool-speed") == 0.0, "rest")
    margins = truth.status()["margins"]
    assert shows("clearance") == pytest.approx(1e3 * margins["clearance"], abs=1e-3)
    assert shows("limit") == pytest.approx(math.degrees(margins["limit"]), abs=1e-3)
    assert shows("singular") == pytest.approx(margins["smallest_singular_value"], abs=1e-3)
    assert f"axis {margins['axis']}" in card(page, "limit").inner_text()
    with slowly(page, truth):
        turn(page, "axis-1", 60.0)
        page.wait_until(lambda: shows("tool-speed") > 5.0, "the tool to move")
        page.wait_until(lambda: shows("rates") > 1.0, "the joint to move")
    truth.wait(20.0, mood="ok")
    page.wait_until(lambda: shows("tool-speed") == 0.0, "the tool to rest")


@pytest.mark.long
def test_plot_can_be_read_and_paused_and_stops_while_closed(page: ViserPage, truth: Truth) -> None:
    turn(page, "axis-1", 30.0)
    truth.wait(10.0, mood="ok")
    toolbar = page.page.locator("#instruments .toolbar")
    toolbar.get_by_text("10 s").click()
    pause = toolbar.get_by_role("button", name="Pause")
    pause.click()
    kept = table(page, "joint-angles")
    page.page.wait_for_timeout(300)
    assert np.array_equal(table(page, "joint-angles")["t [s]"], kept["t [s]"])
    assert kept["t [s]"][-1] - kept["t [s]"][0] <= 10.0
    canvas = card(page, "joint-angles").locator("canvas")
    box = canvas.bounding_box()
    assert box is not None
    read = card(page, "joint-angles").get_by_role("button", name="Axis 1").locator("output")
    for back in (0.3, 1.0, 2.0):
        # The drawing has margins of 42 px on the left and 8 px on the right.
        x = box["width"] - 8.0 - (box["width"] - 50.0) * back / 10.0
        canvas.hover(position={"x": x, "y": 40.0})
        nearest = np.abs(kept["t [s]"] - kept["t [s]"][-1] + back).argmin()
        wanted = kept["Axis 1 [deg]"][max(nearest - 1, 0) : nearest + 2]
        page.page.wait_for_timeout(150)
        shown = float(read.inner_text().replace("−", "-"))
        assert min(wanted) - 0.06 <= shown <= max(wanted) + 0.06, back
    pause.click()
    show(page, False)
    page.page.wait_for_timeout(1200)
    show(page, True)
    page.page.wait_for_timeout(300)
    assert np.diff(table(page, "joint-angles")["t [s]"]).max() > 1.0
    assert np.median(np.diff(kept["t [s]"])) < 0.06


@pytest.mark.long
def test_layout_is_arranged_by_mouse_and_keys_and_kept(page: ViserPage) -> None:
    first, elbow = places(page), goal(page, "axis-3")
    arrange(page)
    keyboard = page.page.keyboard
    page.page.get_by_role("button", name="Move 1 base turn").focus()
    keyboard.press("ArrowRight")
    keyboard.press("ArrowRight")
    assert page.page.evaluate("() => document.activeElement.ariaLabel") == "Move 1 base turn"
    page.page.get_by_role("button", name="Size of Gripper").focus()
    keyboard.press("Enter")
    page.page.get_by_role("button", name="Hide Speed").click()
    x, y, _ = middle(card(page, "clearance").locator("h2"))
    mouse = page.page.mouse
    mouse.move(x, y)
    mouse.down()
    mouse.move(*middle(card(page, "axis-2"))[:2], steps=6)
    mouse.up()
    # In arrange mode no knob turns.
    turn(page, "axis-3", 40.0)
    arrange(page)
    after = places(page)
    assert [name for name, _ in after[:4]] == ["clearance", "axis-2", "axis-3", "axis-1"]
    assert ("gripper", "large") in after
    assert "speed" not in dict(after)
    assert goal(page, "axis-3") == elbow
    reload(page)
    assert places(page) == after
    arrange(page)
    page.press_in_bar("Reset layout")
    assert places(page) == first
    arrange(page)


BROKEN = (
    "{",
    "null",
    json.dumps({"version": 99, "places": []}),
    json.dumps({"version": 1, "places": {"id": 3}}),
    json.dumps(
        {
            "version": 1,
            "places": [
                None,
                7,
                {"id": "speed", "size": "vast", "shown": "yes"},
                {"id": "speed", "size": "large", "shown": False},
                {"id": "<b>", "size": "small", "shown": True},
            ],
        }
    ),
)


@pytest.mark.long
def test_damaged_layout_is_repaired(page: ViserPage) -> None:
    first = places(page)
    for kept in BROKEN:
        page.page.evaluate("([key, text]) => localStorage.setItem(key, text)", [KEPT, kept])
        reload(page)
        # The first place of the last layout is partly valid.
        wanted = first if kept is not BROKEN[-1] else [("speed", "small"), *first]
        assert places(page) == list(dict.fromkeys(wanted))
    page.page.evaluate("(key) => localStorage.removeItem(key)", KEPT)
    reload(page)
    assert places(page) == first


@pytest.mark.long
def test_slow_connection_shows_few_but_no_old_states(
    server: AppServer, truth: Truth, page: ViserPage, browser: Browser
) -> None:
    context = browser.new_context()
    context.route("**/viser/**", lambda route: route.abort())
    with SlowLink(server.port, 1e9) as line:
        window = context.new_page()
        window.goto(f"http://127.0.0.1:{line.port}")
        far = ViserPage(window, window.main_frame, [])
        show(far, True)
        line.rate = THIN
        turn(page, "axis-1", 40.0)
        far.page.wait_for_timeout(2000)
        truth.wait(10.0, mood="ok")
        there = goal(page, "axis-1")
        far.wait_until(lambda: goal(far, "axis-1") == pytest.approx(there, abs=0.01), "the knob")
        assert far.page.inner_text("#instruments .age") == "Live"
        # The queries leave room for STOP.
        far.page.click("#stop")
        assert truth.wait(2.0, mood="stopped") < 1.0
        line.rate = 1e9
    context.close()


@pytest.mark.cases(1)
@pytest.mark.parametrize("size", SIZES)
def test_instruments_fit_the_page(page: ViserPage, artefacts: Path, size: str) -> None:
    before = page.page.viewport_size
    assert before is not None
    width, height = SIZES[size]
    page.page.set_viewport_size({"width": width, "height": height})
    for scheme in SCHEMES:
        page.page.emulate_media(color_scheme=scheme)
        page.page.wait_for_timeout(300)
        assert page.page.evaluate("() => document.documentElement.scrollWidth <= innerWidth")
        stop, scene = (page.page.locator(f"#{each}").bounding_box() for each in ("stop", "scene"))
        assert stop is not None
        assert scene is not None
        assert min(stop["x"], stop["y"]) >= 0.0
        assert scene["height"] > 0.25 * height
        assert scene["width"] > 0.45 * width
        over = "(each) => each.scrollWidth > each.clientWidth"
        assert not page.page.locator("#instruments .body").evaluate(over)
        picture = artefacts / f"instruments-{size}-{scheme}.png"
        picture.write_bytes(page.page.screenshot())
    page.page.set_viewport_size(before)
    page.page.emulate_media(color_scheme="light")


@pytest.mark.long
def test_instruments_follow_sliders_and_theme_of_visers_page(
    server: AppServer, truth: Truth, open_page: OpenPage
) -> None:
    page = open_page(server.url, nodes=("/arm", MOVE))
    take(page)
    show(page, True)
    start = goal(page, "axis-4")
    dial(page, "axis-4").focus()
    page.page.keyboard.press("PageUp")
    page.wait_until(
        lambda: page.slider_value("4 wrist bend") == pytest.approx(start + 10.0, abs=0.06),
        "the slider",
    )
    truth.wait(10.0, mood="ok")
    page.drag_slider("4 wrist bend", start)
    page.wait_until(
        lambda: goal(page, "axis-4") == pytest.approx(page.slider_value("4 wrist bend"), abs=0.01),
        "the knob",
    )

    def ink() -> str:
        found: str = page.page.evaluate(
            "() => getComputedStyle(document.querySelector('#instruments .goal')).color"
        )
        return found

    light = ink()
    page.open_tab("Scene")
    page.click_button("Dark")
    page.wait_until(lambda: ink() != light, "the dark theme")
    page.click_button("Light")
    page.wait_until(lambda: ink() == light, "the light theme")
    assert page.errors == []
