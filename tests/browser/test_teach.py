"""The Teach sheet: poses are recorded, ordered and played, by mouse, keys and touch."""

from __future__ import annotations

import base64
from collections.abc import Callable
from pathlib import Path

import imageio.v3 as imageio
import numpy as np
import pytest

from katana450.extensions.programs.script.script import parse
from katana450.extensions.programs.script.teach import taught
from tests.browser.page import ViserPage
from tests.browser.session import Truth, clear_stop, go_home
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
    sheet.page.wait_for_timeout(200)
    assert at(-25.0)()


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
    sheet.page.wait_for_timeout(200)
    assert truth.status()["q"] == q
