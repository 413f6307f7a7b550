"""The sheet of programs: poses are recorded and run; their text is edited, run and saved."""

from __future__ import annotations

import base64
import re
from collections.abc import Callable
from pathlib import Path

import imageio.v3 as imageio
import numpy as np
import pytest

from katana450.extensions.programs.script.script import parse
from katana450.extensions.programs.script.teach import taught
from tests.browser.instruments import dial, show
from tests.browser.page import ViserPage
from tests.browser.session import Truth, bar, clear_stop, go_home
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


@pytest.fixture
def sheet(new_page: ViserPage) -> ViserPage:
    """Return a new window of the driver with the sheet of programs open."""
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
    for picture in pictures:
        head, _, data = picture.partition(",")
        assert head == "data:image/jpeg;base64"
        assert np.std(imageio.imread(base64.b64decode(data), extension=".jpg")) > 10.0
    assert len(set(pictures)) == 3
    sheet.keep(artefacts / "teach-three.png")
    drag(sheet, 2, 0)
    assert turns(sheet) == [45, 20, -25]
    go_home(sheet, truth)
    done = play(sheet, truth)
    # The arm passes the poses in their order, each while it is marked.
    reached = [
        next(i for i, (turn, number) in enumerate(done) if abs(turn - value) < 3.0 and number == k)
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
    program = taught(parse(path.read_text(encoding="utf-8")))
    assert program is not None
    assert [pose.joints for pose in program.poses] == [
        tuple(pose["joints"]) for pose in before["poses"]
    ]
    assert [pose.gripper for pose in program.poses] == [pose["gripper"] for pose in before["poses"]]
    # The file can be opened again.
    press(sheet, "Remove pose 1")
    sheet.page.set_input_files("#teach input[type=file]", path)
    sheet.wait_until(lambda: turns(sheet) == [45, 20, -25], "the poses of the file")


@pytest.mark.long
def test_step_and_go_move_to_one_place_and_never_past_a_stop(
    sheet: ViserPage, truth: Truth
) -> None:
    teach(sheet, truth, (20.0, -25.0))

    def at(turn: float) -> Callable[[], bool]:
        return lambda: abs(np.degrees(truth.status()["q"][0]) - turn) < 0.01

    press(sheet, "Steps")
    press(sheet, "Step")
    sheet.wait_until(at(20.0), "pose 1", seconds=PLAYED)
    sheet.wait_until(lambda: bar(sheet, "headline").startswith("Paused"), "the pause")
    # The steps of a pose and of its gripper.
    press(sheet, "Run")
    sheet.wait_until(lambda: says(sheet) == "Done.", "the end", seconds=PLAYED)
    assert at(-25.0)()
    press(sheet, "Poses")
    press(sheet, "Go to pose 1: the arm moves there, the gripper stays")
    sheet.wait_until(at(20.0), "pose 1")
    press(sheet, "Go to pose 2: the arm moves there, the gripper stays")
    sheet.wait_until(at(-25.0), "pose 2")
    sheet.page.keyboard.press("Space")
    truth.wait(mood="stopped")
    press(sheet, "Go to pose 1: the arm moves there, the gripper stays")
    sheet.wait_until(lambda: "stopped" in says(sheet), "the refusal")
    press(sheet, "Run")
    sheet.wait_until(lambda: "stop" in says(sheet).lower(), "the refusal", seconds=PLAYED)
    clear_stop(sheet, truth)
    sheet.page.wait_for_timeout(200)
    assert at(-25.0)()


@pytest.mark.long
def test_run_from_before_a_stop_is_refused(sheet: ViserPage, truth: Truth) -> None:
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
    for button in ("Run", "Go to pose 1: the arm moves there, the gripper stays"):
        press(sheet, button)
        sheet.wait_until(lambda: "Do it again" in says(sheet), "the refusal")
        press(sheet, "Undo in Programs")
        press(sheet, "Redo in Programs")
    sheet.page.wait_for_timeout(200)
    assert truth.status()["q"] == q


@pytest.mark.long
def test_text_is_edited_checked_and_run(sheet: ViserPage, truth: Truth, artefacts: Path) -> None:
    teach(sheet, truth, (20.0, -25.0))
    page = sheet.page
    press(sheet, "Text")
    area = page.locator("#teach-text")
    assert taught(parse(area.input_value())) is not None
    area.press("Control+End")
    area.type("  - wiat: 1\n")
    assert area.input_value().endswith("\n  - wiat: 1\n")
    assert truth.status()["stopped"] is None
    problem = page.locator("#teach-problems button")
    problem.wait_for()
    line = area.input_value().count("\n")
    assert re.match(rf"Step 5, line {line}: wiat 1\n.*did you mean 'wait'", problem.inner_text())
    sheet.keep(artefacts / "teach-text-problem.png")
    press(sheet, "Run")
    sheet.wait_until(lambda: "not run" in says(sheet), "the refusal")
    problem.click()
    selected = "(each) => each.value.slice(each.selectionStart, each.selectionEnd)"
    assert area.evaluate(selected) == "  - wiat: 1"
    page.keyboard.type("  - joints: [5, -68, 85, 8, 0]")
    page.wait_for_selector("#teach-problems button", state="detached")
    sheet = reload(sheet)
    assert area.input_value().endswith("[5, -68, 85, 8, 0]\n")
    press(sheet, "Run")
    sheet.wait_until(lambda: says(sheet) == "Done.", "the end", seconds=PLAYED)
    assert np.degrees(truth.status()["q"][0]) == pytest.approx(5.0, abs=0.01)
    press(sheet, "Poses")
    sheet.wait_until(lambda: turns(sheet) == [20, -25, 5], "the poses")
    # A place that cannot be reached is found in planning, and named by its line.
    press(sheet, "Text")
    area.fill("name: Far\nsteps:\n  - home\n  - move: {x: 1900, y: 0, z: 0}\n")
    press(sheet, "Run")
    sheet.wait_until(lambda: page.locator("#teach-problems li").count() == 1, "it", seconds=PLAYED)
    assert page.inner_text("#teach-problems").startswith("Step 2, line 4: move ")
    press(sheet, "Poses")
    sheet.wait_until(lambda: "no poses" in says(sheet), "the refusal")
    assert area.is_visible()


@pytest.mark.long
def test_space_stops_the_arm_from_everything_but_a_text(sheet: ViserPage, truth: Truth) -> None:
    page = sheet.page

    def stops(what: str, key: str = "Space") -> None:
        """Press ``key``, which must stop the arm, and clear the stop."""
        page.keyboard.press(key)
        truth.wait(mood="stopped")
        clear_stop(sheet, truth)
        assert truth.status()["stopped"] is None, what

    press(sheet, "Text")
    area = page.locator("#teach-text")
    area.click()
    # The button says which key stops now.
    key = "getComputedStyle(document.getElementById('stop'), '::after').content"
    assert "Esc" in page.evaluate(key)
    stops("the text", "Escape")
    area.click()
    # A press in the scene is the end of typing.
    page.mouse.click(500.0, 250.0)
    before = area.input_value()
    stops("the scene")
    assert area.input_value() == before
    page.locator("#teach").get_by_label("Program", exact=True).focus()
    stops("a list of the page")
    sheet.number_box("1 base turn").click()
    stops("a number of the panel")
    sheet.choose("Priority", sheet.chosen("Priority"))
    stops("a list of the panel, which keeps the focus after a choice")
    page.focus("#speed input")
    stops("a slider")
    page.focus("#jog-button")
    stops("a button")
    show(sheet, True)
    dial(sheet, "axis-1").focus()
    stops("a knob")
    show(sheet, False)
    assert not page.locator("#jog").is_visible()
    name = page.locator("#teach").get_by_label("Name", exact=True)
    name.fill("")
    name.type("Two words")
    page.click("#more-button")
    own = page.get_by_label("Your name")
    own.fill("")
    own.type("Anna B")
    assert (name.input_value(), own.input_value()) == ("Two words", "Anna B")
    assert truth.status()["stopped"] is None


@pytest.mark.long
def test_script_is_saved_in_the_folder_and_listed(
    sheet: ViserPage, truth: Truth, scripts: Path
) -> None:
    press(sheet, "Save")
    sheet.wait_until(lambda: "no pose yet" in says(sheet), "the refusal")
    teach(sheet, truth, (20.0,))
    name = sheet.page.get_by_label("Name", exact=True)
    name.fill("")
    name.type("Two words")
    name.press("Enter")
    press(sheet, "Save")
    sheet.wait_until(lambda: "Saved as Two words" in says(sheet), "the answer")
    press(sheet, "Save")
    sheet.wait_until(lambda: "Press Save again" in says(sheet), "the question")
    press(sheet, "Save")
    sheet.wait_until(lambda: "Saved as Two words" in says(sheet), "the answer")
    assert taught(parse((scripts / "Two words.yaml").read_text(encoding="utf-8"))) is not None
    assert "Two words" in sheet.page.locator("#teach > select").inner_text()
    # A script of the library has other steps than poses.
    sheet.page.locator("#teach").get_by_label("Program", exact=True).select_option("Square")
    sheet.wait_until(lambda: says(sheet) == "Square is opened.", "the script")
    assert "repeat:" in sheet.page.locator("#teach-text").input_value()
