"""The Teach sheet: poses are recorded, ordered, played and saved, by mouse, keys and touch."""

from __future__ import annotations

import base64
import json
import re
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import imageio.v3 as imageio
import numpy as np
import pytest
from playwright.sync_api import Locator

from katana450.extensions.programs.script import parse
from katana450.extensions.programs.teach import TaughtPose, taught
from tests.browser.conftest import OpenPage
from tests.browser.page import ViserPage
from tests.browser.server import APP, AppServer
from tests.browser.session import MOVE, Truth, bar, clear_stop, go_home, mood

TURNS = (20.0, -25.0, 45.0)
"""Values of axis 1 of the taught poses [deg]."""

LEAST_FINGER = 44.0
"""Minimum height of a control on a phone [px]."""

PLAYED = 60.0
"""Timeout of a script [s], on a busy machine."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("scripts")


@pytest.fixture(scope="module")
def server(folder: Path) -> Iterator[AppServer]:
    with AppServer((*APP, "--programs", str(folder))) as server:
        yield server


@pytest.fixture
def sheet(new_page: ViserPage) -> ViserPage:
    """Return a new window of the driver with the Teach sheet open."""
    open_sheet(new_page)
    return new_page


def open_sheet(page: ViserPage) -> None:
    page.page.click("#teach-button")
    page.page.wait_for_selector("#teach:not([hidden])")


def reload(page: ViserPage) -> ViserPage:
    """Load the page again and open the sheet; return the window with its new documents."""
    page.page.reload()
    page.page.locator("#holder", has_text="drive").wait_for()
    frame = next(each for each in page.page.frames if "/viser/" in each.url)
    again = ViserPage(page.page, frame, page.errors)
    again.wait_ready(("/arm", MOVE))
    open_sheet(again)
    return again


def press(page: ViserPage, name: str) -> None:
    page.page.locator("#teach").get_by_role("button", name=name, exact=True).click()


def says(page: ViserPage) -> str:
    return page.page.inner_text("#teach-says")


def rows(page: ViserPage) -> Locator:
    return page.page.locator("#teach li[data-id]")


def kept(page: ViserPage) -> Any:
    """Return what the browser keeps of the sheet."""
    return json.loads(page.page.evaluate("localStorage.getItem('katana450.teach')") or "null")


def turns(page: ViserPage) -> list[float]:
    """Return axis 1 of all poses [deg], rounded."""
    content = kept(page)
    return [] if content is None else [round(pose["joints"][0]) for pose in content["poses"]]


def teach(page: ViserPage, truth: Truth, values: tuple[float, ...] = TURNS) -> None:
    """Turn axis 1 with the mouse to each of ``values`` [deg], and record the pose there."""
    for number, value in enumerate(values, 1):

        def arrived(value: float = value) -> bool:
            if abs(np.degrees(truth.status()["goal"][0]) - value) < 0.01:
                return True
            # A busy browser may lose a number that is typed.
            page.type_number("1 base turn", value)
            return False

        page.wait_until(arrived, "the goal")
        truth.wait(15.0, moving=False)
        press(page, "Add pose")
        page.wait_until(lambda number=number: rows(page).count() == number, "the pose")  # type: ignore[misc]


def play(page: ViserPage, truth: Truth) -> list[tuple[float, int | None]]:
    """Press Play; return axis 1 [deg] and the number of the marked pose, until the end."""
    press(page, "Play")
    seen: list[tuple[float, int | None]] = []
    deadline = time.monotonic() + PLAYED
    while says(page) != "Done.":
        assert time.monotonic() < deadline, says(page)
        marked = page.page.evaluate(
            "() => document.querySelector('#teach li[aria-current] b')?.textContent"
        )
        number = int(marked) if marked else None
        seen.append((float(np.degrees(truth.status()["q"][0])), number))
        page.page.wait_for_timeout(30)
    return seen


def drag(page: ViserPage, source: int, target: int) -> None:
    """Drag the row ``source`` by its picture over the row ``target`` (indices from 0)."""
    boxes = [rows(page).nth(each).locator(".handle").bounding_box() for each in (source, target)]
    assert boxes[0] is not None
    assert boxes[1] is not None
    page.page.mouse.move(boxes[0]["x"] + 40, boxes[0]["y"] + 40)
    page.page.mouse.down()
    end = boxes[1]["y"] + (2 if target < source else boxes[1]["height"] - 2)
    page.page.mouse.move(boxes[1]["x"] + 40, end, steps=6)
    page.page.mouse.up()


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


def test_two_clicks_open_and_close_one_sheet(new_page: ViserPage) -> None:
    for _ in range(2):
        new_page.page.evaluate("document.getElementById('teach-button').click()")
    new_page.page.wait_for_selector("#teach", state="attached")
    new_page.page.wait_for_timeout(500)
    assert new_page.page.locator("#teach").count() == 1
    assert not new_page.page.locator("#teach").is_visible()


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
    sheet.page.wait_for_timeout(1100)
    clear_stop(sheet, truth)
    sheet.page.wait_for_timeout(500)
    assert at(-25.0)()


def test_play_from_before_a_stop_is_refused(sheet: ViserPage, truth: Truth) -> None:
    """A press that waits on its way while the arm is stopped and cleared moves nothing."""
    teach(sheet, truth, (20.0, -25.0))
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


def test_text_is_edited_checked_and_run(sheet: ViserPage, truth: Truth, artefacts: Path) -> None:
    teach(sheet, truth, (20.0, -25.0))
    page = sheet.page
    press(sheet, "Edit as text")
    area = page.locator("#teach-text")
    assert taught(parse(area.input_value())) is not None
    # Blanks are typed while the arm rests.
    area.press("Control+End")
    area.type("  - wiat: 1\n")
    assert area.input_value().endswith("\n  - wiat: 1\n")
    assert truth.status()["stopped"] is None
    problem = page.locator("#teach-problems button")
    problem.wait_for()
    line = area.input_value().count("\n")
    assert re.match(rf"Line {line} .*did you mean 'wait'", problem.inner_text())
    sheet.keep(artefacts / "teach-text-problem.png")
    press(sheet, "Play")
    sheet.wait_until(lambda: "not run" in says(sheet), "the refusal")
    problem.click()
    selected = "(each) => each.value.slice(each.selectionStart, each.selectionEnd)"
    assert area.evaluate(selected) == "  - wiat: 1"
    page.keyboard.type("  - joints: [5, -68, 85, 8, 0]")
    page.wait_for_selector("#teach-problems button", state="detached")
    sheet = reload(sheet)
    assert area.input_value().endswith("[5, -68, 85, 8, 0]\n")
    press(sheet, "Play")
    sheet.wait_until(lambda: says(sheet) == "Done.", "the end", seconds=PLAYED)
    assert np.degrees(truth.status()["q"][0]) == pytest.approx(5.0, abs=0.01)
    press(sheet, "Edit as poses")
    sheet.wait_until(lambda: turns(sheet) == [20, -25, 5], "the poses")
    # A place that cannot be reached is found in planning, and named by its line.
    press(sheet, "Edit as text")
    area.fill("name: Far\nsteps:\n  - home\n  - move: {x: 1900, y: 0, z: 0}\n")
    press(sheet, "Play")
    sheet.wait_until(lambda: page.locator("#teach-problems li").count() == 1, "it", seconds=PLAYED)
    assert page.inner_text("#teach-problems").startswith("Line 4 ")
    press(sheet, "Edit as poses")
    sheet.wait_until(lambda: "no poses" in says(sheet), "the refusal")
    assert area.is_visible()


def test_space_in_the_text_stops_a_moving_arm(sheet: ViserPage, truth: Truth) -> None:
    press(sheet, "Edit as text")
    area = sheet.page.locator("#teach-text")
    text = "name: Slow\nspeed: 0.05\nsteps:\n  - joints: [60, -68, 85, 8, 0]\n"
    area.fill(text)
    press(sheet, "Play")
    area.focus()
    truth.wait(PLAYED, moving=True)
    sheet.wait_until(lambda: mood(sheet.page) == "program", "the bar")
    sheet.page.keyboard.press("Space")
    truth.wait(mood="stopped")
    assert area.input_value() == text
    sheet.wait_until(lambda: bar(sheet, "headline") == "Stopped", "the bar")
    sheet.page.wait_for_timeout(1200)
    clear_stop(sheet, truth)


@pytest.mark.parametrize(
    "content",
    ["{", "null", '{"format": 1}', '{"format": 1, "name": "x", "times": 1, "poses": [{}]}'],
)
def test_broken_content_of_the_browser_is_refused(
    server: AppServer, open_page: OpenPage, content: str
) -> None:
    page = open_page(
        server.url,
        nodes=("/arm",),
        script=f"localStorage.setItem('katana450.teach', {json.dumps(content)});",
    )
    open_sheet(page)
    assert "cannot be read" in says(page)
    assert rows(page).count() == 0
    press(page, "Add pose")
    page.wait_until(lambda: rows(page).count() == 1, "a pose")
    assert page.errors == []


def test_script_is_saved_in_the_folder_and_listed(
    sheet: ViserPage, truth: Truth, folder: Path
) -> None:
    press(sheet, "Save")
    sheet.wait_until(lambda: "no pose yet" in says(sheet), "the refusal")
    teach(sheet, truth, (20.0,))
    name = sheet.page.get_by_label("Name", exact=True)
    name.fill("")
    # With a blank, which STOP leaves to this box while the arm rests.
    name.type("Two words")
    name.press("Enter")
    press(sheet, "Save")
    sheet.wait_until(lambda: "Saved as Two words" in says(sheet), "the answer")
    assert taught(parse((folder / "Two words.yaml").read_text(encoding="utf-8"))) is not None
    press(sheet, "Save")
    sheet.wait_until(lambda: "exists already" in says(sheet), "the refusal")
    # The browser notes the refusal on its console.
    sheet.errors.clear()
    sheet.open_tab("Programs")
    assert "Teach" not in sheet.panel_text()
    sheet.choose("Script", "Two words")
    # A script of the library has other steps, so it is shown as text.
    sheet.page.locator("#teach").get_by_label("Open a script").select_option("Square")
    sheet.wait_until(lambda: "shown as text" in says(sheet), "the text")
    assert "repeat:" in sheet.page.locator("#teach-text").input_value()


def test_text_of_poses_is_read_back_as_the_same_poses(sheet: ViserPage) -> None:
    """The page writes scripts and the server reads them: nothing is lost on the way."""
    q = [10.0, -68.25, 85.0, 8.125, -0.5]

    def pose(**fields: Any) -> dict[str, Any]:
        plain = {"gripper": None, "grips": False, "wait": 0, "speed": 100, "blend": False}
        return {"joints": q, **plain, **fields}

    cases = {
        "plain": (1, [pose(), pose(joints=[0.0] * 5)]),
        "loop": (7, [pose(speed=30, wait=0.5), pose(gripper=-12.5, grips=True, wait=1)]),
        "speeds": (3, [pose(speed=55), pose(speed=55, grips=True, gripper=3), pose()]),
        "blend": (2, [pose(blend=True), pose(blend=True), pose(), pose(blend=True)]),
        'a "name": # \\': (1, [pose(blend=True, speed=50), pose(speed=20)]),
    }
    for name, (times, poses) in cases.items():
        text = sheet.page.evaluate(
            """async (content) => {
                const { scriptOf } = await import("/static/teach/poses.js");
                return scriptOf(content).text;
            }""",
            {"name": name, "times": times, "poses": poses},
        )
        found = taught(parse(text))
        assert found is not None, text
        assert (found.name, found.times) == (name, times)
        wanted = []
        for number, each in enumerate(poses):
            after = poses[number + 1] if number + 1 < len(poses) else None
            # A pose is passed only on the way to another one at the same speed.
            blend = each["blend"] and after is not None and after["speed"] == each["speed"]
            speed = each["speed"] / 100
            wanted.append(TaughtPose(tuple(q), speed, blend, each["gripper"], each["wait"]))
        shown = [
            TaughtPose(tuple(q), each.speed, each.blend, each.gripper, each.wait)
            for each in found.poses
        ]
        assert shown == wanted, text
        assert [list(each.joints) for each in found.poses] == [each["joints"] for each in poses]


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
    page.page.wait_for_timeout(1200)
    page.page.locator("#clear-stop").tap()
    truth.wait(stopped=None)
    assert page.errors == []
