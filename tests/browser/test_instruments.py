"""The instruments in a real browser: knobs, gauges, plots and their layout."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from katana450.client import connect
from katana450.server.api import answers, requests
from tests.browser.instruments import card, dial, goal, legend, middle, show, slowly, turn, turned
from tests.browser.page import ViserPage
from tests.browser.server import AppServer
from tests.browser.session import Truth, bar

SIZES = {"phone": (390, 844), "tablet": (820, 1180), "desk": (1440, 900)}


@pytest.fixture
def page(own_page: ViserPage, truth: Truth) -> ViserPage:
    """Return our page alone with open instruments and the arm at rest."""
    show(own_page, True)
    own_page.page.locator("#speed input").fill("100")
    truth.wait(20.0, mood="ok", speed=1.0)
    return own_page


def test_a_knob_turns_a_joint_and_the_plots_follow(page: ViserPage, truth: Truth) -> None:
    start = goal(page, "axis-1")
    # A mere touch and a scroll past the knob move nothing.
    x, y, _ = middle(dial(page, "axis-1"))
    page.page.mouse.click(x + 20, y + 20)
    page.page.focus("#stop")
    page.page.mouse.wheel(0, -1)
    page.page.wait_for_timeout(200)
    assert goal(page, "axis-1") == start
    assert truth.status()["goal"][0] == pytest.approx(math.radians(start), abs=1e-9)

    page.page.locator("#speed input").fill("30")
    truth.wait(speed=0.3)
    # What comes late on a busy machine is sent again while the knob is held.
    with turned(page, "axis-1", 50.0):
        end = math.radians(start + 50.0)
        page.wait_until(
            lambda: abs(truth.status()["goal"][0] - end) < 0.04, "the goal", seconds=20.0
        )
    reached = goal(page, "axis-1")
    end = math.radians(reached)
    page.wait_until(
        lambda: abs(truth.status()["q"][0] - end) < 1e-4, "the end of the turn", seconds=20.0
    )
    page.wait_until(
        lambda: legend(page, "joint-angles")[0] == pytest.approx(reached, abs=0.06), "the end"
    )
    # A cursor reads the past: the points on the way, and the angle of before.
    pause = page.page.locator("#instruments .toolbar button", has_text="Freeze")
    pause.click()
    card(page, "joint-angles").locator(".drawn").focus()
    read: list[float] = []
    while not read or read[-1] > start + 0.1:
        assert len(read) < 100
        page.page.keyboard.press("ArrowLeft")
        page.page.evaluate("() => new Promise(requestAnimationFrame)")
        read.append(legend(page, "joint-angles")[0])
    assert len({angle for angle in read if start + 1.0 < angle < reached - 1.0}) > 2
    assert read == sorted(read, reverse=True)
    card(page, "joint-speeds").locator(".drawn").focus()
    presses = 0
    while legend(page, "joint-speeds")[0] < 1.0:
        assert presses < 100
        page.page.keyboard.press("ArrowLeft")
        page.page.evaluate("() => new Promise(requestAnimationFrame)")
        presses += 1
    pause.click()


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
    # The last command may still be on its way when the arm rests at the one before.
    end = math.radians(start + 10.0)
    page.wait_until(lambda: abs(truth.status()["q"][4] - end) < 1e-5, "the end of the wheel")
    dial(page, "gripper").focus()
    before = truth.status()["gripper_goal"]
    keyboard.press("PageDown")
    page.wait_until(lambda: truth.status()["gripper_goal"] < before - 0.05, "the fingers")
    dial(page, "speed").focus()
    keyboard.press("ArrowDown")
    page.wait_until(lambda: truth.status()["speed"] == pytest.approx(0.95), "the speed")
    keyboard.press("ArrowUp")
    page.wait_until(lambda: truth.status()["speed"] == 1.0, "the speed")


@pytest.mark.long
def test_knob_of_a_spectator_springs_back_with_the_reason(
    page: ViserPage, server: AppServer, truth: Truth
) -> None:
    page.press_in_bar("Release")
    page.wait_until(lambda: bar(page, "holder") == "Nobody drives", "the release")
    with connect(server.url, "Octave") as other:
        other.ask(requests.Acquire())
        page.wait_until(lambda: bar(page, "holder") == "Octave drives", "who drives")
        # A program counts as connected, although it has no page.
        assert bar(page, "name").endswith(" connected")
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


@pytest.mark.long
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


def test_instruments_fit_the_page(page: ViserPage, artefacts: Path) -> None:
    before = page.page.viewport_size
    assert before is not None
    for size, (width, height) in SIZES.items():
        page.page.set_viewport_size({"width": width, "height": height})
        page.page.wait_for_timeout(100)
        assert page.page.evaluate("() => document.documentElement.scrollWidth <= innerWidth")
        stop, scene = (page.page.locator(f"#{name}").bounding_box() for name in ("stop", "scene"))
        assert stop is not None
        assert scene is not None
        assert min(stop["x"], stop["y"]) >= 0.0
        assert scene["height"] > 0.25 * height
        assert scene["width"] > 0.45 * width
        over = "(each) => each.scrollWidth > each.clientWidth"
        assert not page.page.locator("#instruments .body").evaluate(over)
        page.keep(artefacts / f"instruments-{size}.png")
    page.page.set_viewport_size(before)
