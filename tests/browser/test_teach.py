"""The Teach sheet: poses are recorded, ordered and played, by mouse, keys and touch."""

from __future__ import annotations

import base64
from collections.abc import Callable
from pathlib import Path

import imageio.v3 as imageio
import numpy as np
import pytest

from katana450.extensions.programs.script import parse
from katana450.extensions.programs.teach import taught
from tests.browser.conftest import OpenPage
from tests.browser.page import ViserPage
from tests.browser.server import AppServer
from tests.browser.session import MOVE, Truth, bar, clear_stop, go_home
from tests.browser.teach_sheet import (
    PLAYED,
    drag,
    kept,
    open_sheet,
    play,
    press,
    reload,
    rows,
    says,
    teach,
    turns,
)

LEAST_FINGER = 44.0
"""Minimum height of a control on a phone [px]."""


@pytest.fixture
def sheet(new_page: ViserPage) -> ViserPage:
    """Return a new window of the driver with the Teach sheet open."""
    open_sheet(new_page)
    return new_page


@pytest.mark.long
def test_poses_are_taught_reordered_played_and_kept(
    sheet: ViserPage, truth: Truth, artefacts: Path, tmp_path: Path
) -> None:
    sheet.keep(artefacts / "teach-empty.png")
    # The harness draws only pictures otherwise.
    sheet.frame.evaluate("() => harness.draw(true)")
    teach(sheet, truth)
    sheet.frame.evaluate("() => harness.draw(false)")
    pictures = [pose["picture"] for pose in kept(sheet)["poses"]]
    for each in pictures:
        head, _, data = each.partition(",")
        assert head == "data:image/jpeg;base64"
        assert np.std(imageio.imread(base64.b64decode(data), extension=".jpg")) > 10.0
    assert len(set(pictures)) == 3
    sheet.keep(artefacts / "teach-three.png")
    drag(sheet, 2, 0)
    assert turns(sheet) == [45, 20, -25]
    go_home(sheet, truth)
    seen = play(sheet, truth)
    # The arm passes the poses in their order, each while it is marked.
    reached = [
        next(i for i, (turn, number) in enumerate(seen) if abs(turn - value) < 3.0 and number == k)
        for k, value in enumerate((45.0, 20.0, -25.0), 1)
    ]
    assert reached == sorted(reached)
    assert np.degrees(truth.status()["q"][0]) == pytest.approx(-25.0, abs=0.01)

    before = kept(sheet)
    sheet = reload(sheet)
    assert rows(sheet).count() == 3
    assert sheet.page.locator("#teach li img").nth(0).get_attribute("src") == pictures[2]
    with sheet.page.expect_download() as downloading:
        press(sheet, "Download")
    assert downloading.value.suggested_filename == "My script.yaml"
    path = tmp_path / "My script.yaml"
    downloading.value.save_as(path)
    found = taught(parse(path.read_text(encoding="utf-8")))
    assert found is not None
    assert [pose.joints for pose in found.poses] == [
        tuple(pose["joints"]) for pose in before["poses"]
    ]
    assert [pose.gripper for pose in found.poses] == [pose["gripper"] for pose in before["poses"]]
    # The file can be opened again.
    press(sheet, "Remove pose 1")
    sheet.page.set_input_files("#teach input[type=file]", path)
    sheet.wait_until(lambda: turns(sheet) == [45, 20, -25], "the poses of the file")


@pytest.mark.long
def test_two_clicks_open_and_close_one_sheet(new_page: ViserPage) -> None:
    for _ in range(2):
        new_page.page.evaluate("document.getElementById('teach-button').click()")
    new_page.page.wait_for_selector("#teach", state="attached")
    new_page.page.wait_for_timeout(500)
    assert new_page.page.locator("#teach").count() == 1
    assert not new_page.page.locator("#teach").is_visible()


@pytest.mark.long
def test_poses_are_edited_by_keys_and_changes_are_undone(sheet: ViserPage, truth: Truth) -> None:
    teach(sheet, truth, (20.0, -25.0))
    q = truth.status()["q"]
    page = sheet.page
    box = page.get_by_role("spinbutton", name="Wait after pose 1")
    box.fill("1.5")
    box.press("Enter")
    page.get_by_role("spinbutton", name="Speed to pose 2").fill("300")
    # A button takes the focus, and with it the value of the box.
    press(sheet, "The gripper moves at pose 2")
    poses = kept(sheet)["poses"]
    assert (poses[0]["wait"], poses[1]["speed"], poses[1]["grips"]) == (1.5, 100, False)
    down = page.get_by_role("button", name="Move pose 1 down", exact=True)
    down.focus()
    page.keyboard.press("Enter")
    assert turns(sheet) == [-25, 20]
    # The focus stays on the button of the pose.
    assert page.evaluate("document.activeElement.ariaLabel") == "Move pose 2 down"
    page.keyboard.press("Control+z")
    assert turns(sheet) == [20, -25]
    page.keyboard.press("Control+y")
    assert turns(sheet) == [-25, 20]
    page.get_by_role("button", name="Remove pose 1", exact=True).focus()
    page.keyboard.press("Enter")
    assert turns(sheet) == [20]
    page.keyboard.press("Control+z")
    assert turns(sheet) == [-25, 20]
    press(sheet, "Undo in Teach")
    assert turns(sheet) == [20, -25]
    # None of this was an undo of the arm.
    page.wait_for_timeout(300)
    assert truth.status()["q"] == q
    assert truth.status()["stopped"] is None


@pytest.mark.long
def test_step_and_go_move_to_one_pose_and_never_past_a_stop(sheet: ViserPage, truth: Truth) -> None:
    teach(sheet, truth, (20.0, -25.0))

    def at(turn: float) -> Callable[[], bool]:
        return lambda: abs(np.degrees(truth.status()["q"][0]) - turn) < 0.01

    for number, turn in enumerate((20.0, -25.0, 20.0), 1):
        press(sheet, "Step")
        sheet.wait_until(at(turn), f"pose {number}", seconds=PLAYED)
        sheet.wait_until(lambda: "is at pose" in says(sheet), "the end", seconds=PLAYED)
    press(sheet, "Go to pose 2: the arm moves there, the gripper stays")
    sheet.wait_until(at(-25.0), "pose 2")
    sheet.page.keyboard.press("Space")
    truth.wait(mood="stopped")
    press(sheet, "Go to pose 1: the arm moves there, the gripper stays")
    sheet.wait_until(lambda: "stopped" in says(sheet), "the refusal")
    press(sheet, "Play")
    sheet.wait_until(lambda: "stop" in says(sheet).lower(), "the refusal", seconds=PLAYED)
    clear_stop(sheet, truth)
    sheet.page.wait_for_timeout(500)
    assert at(-25.0)()


@pytest.mark.long
def test_loop_passes_the_poses_again_and_stop_ends_it(sheet: ViserPage, truth: Truth) -> None:
    teach(sheet, truth, (20.0, -25.0))
    box = sheet.page.get_by_role("spinbutton", name="Loop")
    box.fill("2")
    box.press("Enter")
    go_home(sheet, truth)
    assert _passed(play(sheet, truth)) == [20, -25, 20, -25]
    box.fill("50")
    box.press("Enter")
    press(sheet, "Play")

    def near(turn: float) -> Callable[[], bool]:
        return lambda: abs(np.degrees(truth.status()["q"][0]) - turn) < 3.0

    for turn in (20.0, -25.0, 20.0):
        sheet.wait_until(near(turn), f"{turn} degrees", seconds=PLAYED)
    sheet.page.keyboard.press("Space")
    truth.wait(mood="stopped")
    clear_stop(sheet, truth)
    q = truth.status()["q"]
    sheet.page.wait_for_timeout(1500)
    assert truth.status()["q"] == q


def _passed(seen: list[tuple[float, int | None]]) -> list[int]:
    """Return the poses that the arm was at, 20 and -25 degrees, in order."""
    passed: list[int] = []
    for turn, _ in seen:
        for value in (20, -25):
            if abs(turn - value) < 3.0 and passed[-1:] != [value]:
                passed.append(value)
    return passed


@pytest.mark.long
def test_play_from_before_a_stop_is_refused(sheet: ViserPage, truth: Truth) -> None:
    """A press that waits on its way while the arm is stopped and cleared moves nothing."""
    teach(sheet, truth, (20.0, -25.0))
    sheet.page.click("#stop")
    truth.wait(mood="stopped")
    clear_stop(sheet, truth)
    q = truth.status()["q"]
    sheet.page.evaluate(
        """() => {
            const say = Worker.prototype.postMessage;
            Worker.prototype.postMessage = function (data, ...rest) {
                if (data.say?.revocations !== undefined) data.say.revocations -= 1;
                say.call(this, data, ...rest);
            };
        }"""
    )
    for button in ("Play", "Go to pose 1: the arm moves there, the gripper stays"):
        press(sheet, button)
        sheet.wait_until(lambda: "Do it again" in says(sheet), "the refusal")
        press(sheet, "Undo in Teach")
        press(sheet, "Redo in Teach")
    sheet.page.wait_for_timeout(500)
    assert truth.status()["q"] == q


@pytest.mark.long
def test_sheet_works_with_fingers_on_a_phone(
    server: AppServer, open_page: OpenPage, truth: Truth, artefacts: Path
) -> None:
    page = open_page(
        server.url,
        nodes=("/arm", MOVE),
        window=(390, 844),
        own_camera=True,
        has_touch=True,
        is_mobile=True,
    )
    page.page.evaluate(
        """() => [...document.querySelectorAll("#acts button")]
          .find((each) => /^Take/.test(each.textContent))?.click()"""
    )
    page.wait_until(lambda: bar(page, "holder") == "You drive", "the arm")
    page.page.tap("#teach-button")
    page.page.wait_for_selector("#teach:not([hidden])")
    for number in (1, 2, 3):
        page.page.get_by_role("button", name="Add pose").tap()
        page.wait_until(lambda number=number: rows(page).count() == number, "the pose")  # type: ignore[misc]
    for control in page.page.locator("#teach :is(button, input, select)").all():
        box = control.bounding_box() if control.is_visible() else None
        if box is not None:
            assert box["height"] >= LEAST_FINGER - 0.5, control.get_attribute("aria-label")
            assert box["width"] >= LEAST_FINGER - 4.0, control.get_attribute("aria-label")
    assert page.page.evaluate("() => document.documentElement.scrollWidth <= innerWidth")
    teach_sheet = page.page.locator("#teach")
    assert teach_sheet.evaluate("(each) => each.scrollWidth <= each.clientWidth")
    page.keep(artefacts / "teach-phone.png")
    ids = page.page.evaluate(
        "() => [...document.querySelectorAll('#teach li[data-id]')].map((each) => each.dataset.id)"
    )
    # A finger drags the second pose above the first.
    boxes = []
    for number in (1, 0):
        rows(page).nth(number).scroll_into_view_if_needed()
        boxes.append(rows(page).nth(number).locator(".handle").bounding_box())
    start = rows(page).nth(1).locator(".handle").bounding_box()
    target = boxes[1]
    assert start is not None
    assert target is not None
    touch = page.page.context.new_cdp_session(page.page)
    x, y = start["x"] + 40, start["y"] + 30
    touch.send(
        "Input.dispatchTouchEvent", {"type": "touchStart", "touchPoints": [{"x": x, "y": y}]}
    )
    for fraction in (0.3, 0.6, 0.9, 1.0):
        point = {"x": x, "y": y + fraction * (target["y"] + 5 - y)}
        touch.send("Input.dispatchTouchEvent", {"type": "touchMove", "touchPoints": [point]})
    touch.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
    moved = page.page.evaluate(
        "() => [...document.querySelectorAll('#teach li[data-id]')].map((each) => each.dataset.id)"
    )
    assert moved == [ids[1], ids[0], ids[2]]
    # STOP stays free.
    page.page.tap("#stop")
    truth.wait(mood="stopped")
    page.page.locator("#clear-stop").tap()
    truth.wait(stopped=None)
    assert page.errors == []
