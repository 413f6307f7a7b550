"""Steps and the gripper in the Jog sheet, by mouse, touch, keys and a gamepad."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.browser.conftest import OpenPage
from tests.browser.page import ViserPage
from tests.browser.server import AppServer
from tests.browser.session import Truth, clear_stop, take
from tests.browser.test_jog import GAMEPAD

EXACT = 2e-6
"""[m] Tolerance of one step."""

PHONES = [(390, 844), pytest.param((844, 390), marks=pytest.mark.long)]
LEAST_FINGER = 44.0
"""Minimum width and height of a button of the sheet on a phone [px]."""


@pytest.fixture
def sheet(page: ViserPage) -> Iterator[ViserPage]:
    """Return a window of the driver with the Jog sheet and its steps open."""
    page.page.click("#jog-button")
    page.page.wait_for_selector("#jog [name=step]", state="attached")
    yield page
    page.page.locator("#jog [value=base]").check(force=True)
    page.page.locator("#jog [name=step][value='0']").check(force=True)


def choose(page: ViserPage, name: str, value: str) -> None:
    page.page.locator(f"#jog [name={name}][value='{value}'] + span").click()


def tool(truth: Truth) -> Any:
    """Return the position (3,) [m] of the tool once it rests."""
    truth.wait(10.0, moving=False)
    return np.array(truth.status()["T"])[:3, 3]


def wait_for(page: ViserPage, truth: Truth, place: Any) -> None:
    page.wait_until(lambda: np.allclose(tool(truth), place, atol=EXACT), f"the tool at {place}")


def test_one_press_is_one_step(sheet: ViserPage, truth: Truth, artefacts: Path) -> None:
    start = tool(truth)
    choose(sheet, "step", "1")
    assert not sheet.page.locator("#pads").is_visible()
    sheet.page.get_by_role("button", name="z minus 1 mm").click()
    wait_for(sheet, truth, start - (0.0, 0.0, 0.001))
    # A key that stays pressed counts once; the browser repeats it.
    sheet.page.keyboard.down("KeyS")
    for _ in range(3):
        sheet.page.keyboard.down("KeyS")
    sheet.page.wait_for_timeout(300)
    sheet.page.keyboard.up("KeyS")
    wait_for(sheet, truth, start - (0.001, 0.0, 0.001))
    sheet.keep(artefacts / "jog-steps.png")
    choose(sheet, "step", "10")
    for _ in range(3):
        sheet.page.get_by_role("button", name="y plus 10 mm").click()
    wait_for(sheet, truth, np.add(start, (-0.001, 0.03, -0.001)))
    choose(sheet, "step", "0.1")
    sheet.page.get_by_role("button", name="x minus 0.1 mm").focus()
    for _ in range(3):
        sheet.page.keyboard.down("Enter")
    sheet.page.keyboard.up("Enter")
    wait_for(sheet, truth, np.add(start, (-0.0011, 0.03, -0.001)))
    # Back at Hold, the pads are there again and the keys move while they are held.
    choose(sheet, "step", "0")
    sheet.page.keyboard.down("KeyF")
    sheet.wait_until(lambda: truth.status()["T"][2][3] < start[2] - 0.02, "the tool to go down")
    sheet.page.keyboard.up("KeyF")
    truth.wait(10.0, moving=False)


@pytest.mark.long
def test_key_held_while_a_step_is_chosen_is_released(sheet: ViserPage, truth: Truth) -> None:
    sheet.page.keyboard.down("KeyA")
    truth.wait(moving=True)
    choose(sheet, "step", "1")
    start = tool(truth)
    sheet.page.keyboard.up("KeyA")
    choose(sheet, "step", "0")
    sheet.page.wait_for_timeout(300)
    assert np.allclose(tool(truth), start, atol=EXACT)


@pytest.mark.long
def test_joints_move_by_steps(sheet: ViserPage, truth: Truth) -> None:
    start = np.array(truth.status()["q"])
    choose(sheet, "frame", "joints")
    # Joints move by steps only, so a step is chosen.
    assert sheet.page.locator("#jog [name=step][value='1']").is_checked()
    sheet.page.get_by_role("button", name="2 shoulder plus 1 °").click()
    choose(sheet, "step", "10")
    sheet.page.get_by_role("button", name="5 wrist roll minus 10 °").click()
    wanted = start + np.radians((0.0, 1.0, 0.0, 0.0, -10.0))
    sheet.wait_until(
        lambda: np.allclose(truth.status()["q"], wanted, atol=1e-6), "the joints to turn"
    )


def test_gripper_opens_and_closes_by_buttons_and_keys(sheet: ViserPage, truth: Truth) -> None:
    def wait_goal(sign: int, act: Callable[[], None]) -> None:
        before = truth.status()["gripper_goal"]
        act()
        sheet.wait_until(
            lambda: sign * (truth.status()["gripper_goal"] - before) > 0.1, "the gripper's goal"
        )

    # The arm begins with an open gripper.
    wait_goal(-1, lambda: sheet.page.keyboard.press("KeyC"))
    wait_goal(1, lambda: sheet.page.keyboard.press("KeyO"))
    wait_goal(-1, lambda: sheet.page.locator("#gripper button", has_text="Close").click())
    wait_goal(1, lambda: sheet.page.locator("#gripper button", has_text="Open").click())


def test_gamepad_steps_and_grips_only_with_its_shoulder_button(
    sheet: ViserPage, truth: Truth
) -> None:
    sheet.page.evaluate(GAMEPAD)
    choose(sheet, "step", "1")
    start = tool(truth)
    sheet.page.evaluate("() => { pad.axes[0] = -1; pad.buttons[0].pressed = true }")
    sheet.page.wait_for_timeout(300)
    assert np.allclose(tool(truth), start, atol=EXACT)
    before = truth.status()["gripper_goal"]
    sheet.page.evaluate("() => { pad.axes[0] = 0; pad.buttons[0].pressed = false }")
    sheet.page.evaluate("() => { pad.buttons[4].pressed = true }")
    sheet.page.wait_for_timeout(150)
    sheet.page.evaluate("() => { pad.axes[0] = -1; pad.buttons[0].pressed = true }")
    wait_for(sheet, truth, np.add(start, (0.0, 0.001, 0.0)))
    sheet.page.wait_for_timeout(300)
    wait_for(sheet, truth, np.add(start, (0.0, 0.001, 0.0)))
    assert truth.status()["gripper_goal"] != before
    sheet.page.evaluate("() => { navigator.getGamepads = () => [] }")


def test_stopped_arm_takes_no_step(sheet: ViserPage, truth: Truth) -> None:
    choose(sheet, "step", "10")
    start = tool(truth)
    sheet.page.keyboard.press("Space")
    truth.wait(mood="stopped")
    sheet.page.get_by_role("button", name="z minus 10 mm").click()
    sheet.page.wait_for_selector("#toast.shown")
    assert np.allclose(tool(truth), start, atol=EXACT)
    clear_stop(sheet, truth)
    # The refused step is not carried out afterwards.
    sheet.page.wait_for_timeout(300)
    assert np.allclose(tool(truth), start, atol=EXACT)


@pytest.mark.long
@pytest.mark.parametrize("size", PHONES)
def test_steps_fit_a_finger_on_a_phone(
    server: AppServer, open_page: OpenPage, size: tuple[int, int], artefacts: Path
) -> None:
    truth = Truth(server)
    page = open_page(
        server.url,
        nodes=("/arm",),
        window=size,
        own_camera=True,
        has_touch=True,
        is_mobile=True,
    )
    take(page)
    page.page.tap("#jog-button")
    page.page.wait_for_selector("#jog [name=step]", state="attached")
    page.keep(artefacts / f"jog-hold-{size[0]}.png")
    page.page.locator("#jog [name=step][value='10'] + span").tap()
    start = tool(truth)
    page.page.get_by_role("button", name="z minus 10 mm").tap()
    wait_for(page, truth, start - (0.0, 0.0, 0.01))
    page.page.get_by_role("button", name="z plus 10 mm").tap()
    wait_for(page, truth, start)
    page.keep(artefacts / f"jog-steps-{size[0]}.png")
    for button in page.page.locator("#jog button, #jog .choice span").all():
        box = button.bounding_box() if button.is_visible() else None
        if box is not None:
            assert min(box["width"], box["height"]) >= LEAST_FINGER - 4.0, button.inner_text()
    for key in page.page.locator("#jog kbd").all():
        assert not key.is_visible()
    assert page.page.evaluate("() => document.documentElement.scrollWidth <= innerWidth")
    sheet = page.page.locator("#jog")
    assert sheet.evaluate("(each) => each.scrollWidth <= each.clientWidth")


def test_yaw_that_the_arm_does_not_have_is_not_sent(page: ViserPage, truth: Truth) -> None:
    page.page.click("#jog-button")
    page.page.evaluate(
        """() => {
          window.said = [];
          const post = Worker.prototype.postMessage;
          Worker.prototype.postMessage = function (...all) {
            said.push(JSON.stringify(all));
            return post.apply(this, all);
          };
        }"""
    )

    def jogs(key: str) -> int:
        page.page.evaluate("() => { said.length = 0 }")
        page.page.keyboard.down(key)
        page.page.wait_for_timeout(300)
        page.page.keyboard.up(key)
        truth.wait(moving=False)
        return int(page.page.evaluate("() => said.filter((each) => each.includes('jog')).length"))

    assert jogs("KeyQ") == 0
    assert jogs("KeyA") > 0
