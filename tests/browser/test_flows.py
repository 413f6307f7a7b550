"""The flows of the page from the first visit on, at four sizes in both themes.

By mouse and keys at a desk, by real touches on a phone. The details of each flow have tests of
their own, which CONTRIBUTING.md lists.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from katana450.client import Client
from katana450.server.api import answers
from tests.browser.person import Person, still
from tests.browser.server import AppServer
from tests.browser.session import AXES, MOVE, bar, clear_stop, resume
from tests.browser.shared_server import SharedServer
from tests.browser.sizes import SIZES, in_sizes_and_schemes

pytestmark = pytest.mark.long

PLANNED = 120.0
"""Timeout [s] of a plan on a busy machine."""


@pytest.fixture
def server(shared_server: SharedServer) -> AppServer:
    """Return the server in the state of a new one for each walk, which leaves an object."""
    return shared_server.as_new()


@in_sizes_and_schemes(SIZES)
def test_flows_of_the_page(person: Person, reader: Client, tmp_path: Path) -> None:
    first_visit(person)
    motion(person)
    steps_and_gripper(person)
    numbers(person)
    program(person)
    objects(person, reader, tmp_path)
    teaching(person)
    views(person)


def first_visit(person: Person) -> None:
    page = person.page
    page.page.wait_for_selector("#welcome:not([hidden])")
    person.keep("first-visit")
    person.assert_stop_is_free()
    person.press(page.page.locator("#welcome button", has_text="Drag the arrows"))
    before = page.node_pose(MOVE)[2, 3]
    person.drag_arrow(-0.06)
    step = page.page.locator("#welcome button", has_text="Drag the arrows")
    page.wait_until(lambda: "done" in step.inner_text(), "the step to be done")
    assert bar(page, "holder") == "You drive"
    person.truth.wait(20.0, moving=False)
    assert page.node_pose(MOVE)[2, 3] < before - 0.02
    person.button("Close for good")
    assert not page.page.locator("#welcome").is_visible()


def motion(person: Person) -> None:
    page, truth = person.page, person.truth
    page.page.locator("#speed input").fill("5")
    truth.wait(speed=0.05)
    person.open_panel()
    person.keep("drive")
    person.press(page.frame.get_by_role("button", name="Home", exact=True))
    person.fold_panel()
    truth.wait(moving=True)
    person.pause(lambda: truth.status()["status"])
    page.wait_until(lambda: bar(page, "headline").startswith("Paused"), "the pause")
    person.keep("paused")
    resume(page)
    truth.wait(moving=True)
    person.stop()
    page.page.locator("#speed input").fill("100")
    truth.wait(speed=1.0)


def steps_and_gripper(person: Person) -> None:
    page, truth = person.page, person.truth
    person.press(page.page.locator("#jog-button"))
    person.press(page.page.locator("#jog [name=step][value='10'] + span"))
    before = np.array(truth.status()["q"])
    person.button("z plus 10 mm", inside="#jog")
    page.wait_until(lambda: np.abs(truth.status()["q"] - before).max() > 1e-3, "the step")
    truth.wait(10.0, moving=False)
    for name in ("Close", "Open"):
        gripper = truth.status()["gripper"]
        person.press(page.page.locator("#gripper button", has_text=name))
        page.wait_until(lambda gripper=gripper: truth.status()["gripper"] != gripper, name)  # type: ignore[misc]
        truth.wait(10.0, moving=False)
    person.keep("jog")
    person.assert_stop_is_free()
    person.press(page.page.locator("#jog-button"))


def numbers(person: Person) -> None:
    page, truth = person.page, person.truth
    person.open_panel()
    box = page.number_box(AXES[0])
    box.fill("500")
    page.wait_until(lambda: box.get_attribute("aria-invalid") == "true", "the mark")
    person.keep("out-of-range")
    box.fill("20")
    box.press("Enter")
    page.wait_until(lambda: abs(np.degrees(truth.status()["q"][0]) - 20.0) < 0.1, "axis 1")
    person.fold_panel()


def program(person: Person) -> None:
    page, truth = person.page, person.truth
    person.press(page.page.locator("#teach-button"))
    page.page.locator("#teach > select").select_option("Circle with gripper")
    person.button("Preview", inside="#teach")

    def status() -> Any:
        return truth.status().get("program", {}).get("status")

    page.wait_until(lambda: status() == "ready", "the plan", seconds=PLANNED)
    page.page.locator("#teach .steps li").first.wait_for()
    person.keep("previewed")
    person.button("Run", inside="#teach")
    page.wait_until(lambda: status() == "running", "the run")
    page.wait_until(lambda: "Step" in bar(page, "mode") or "step" in bar(page, "mode"), "the step")
    person.keep("program")
    person.pause(status)
    resume(page)
    page.wait_until(lambda: status() == "running", "the program to continue")
    person.stop()
    person.press(page.page.locator("#teach-button"))


def objects(person: Person, reader: Client, folder: Path) -> None:
    page = person.page

    def names() -> set[str]:
        return {prop.name for prop in reader.query(answers.Objects).objects}

    before = names()
    part = folder / "part.stl"
    part.write_bytes(trimesh.creation.box((30.0, 30.0, 30.0)).export(file_type="stl"))
    person.press(page.page.locator("#objects-button"))
    with page.page.expect_file_chooser() as chooser:
        person.press(page.page.locator("#add"))
    chooser.value.set_files(part)
    page.wait_until(lambda: len(names()) == len(before) + 1, "the object")
    # The new object is the chosen one.
    form = page.page.locator("#object")
    page.wait_until(lambda: form.get_by_label("Object").input_value() not in before, "the choice")
    person.keep("objects")
    person.assert_stop_is_free()
    person.press(page.page.locator("#objects-button"))
    (added,) = names() - before
    target = next(prop for prop in reader.query(answers.Objects).objects if prop.name == added)
    place: Any = np.array(target.T)
    top = place[:3, 3] + (0.0, 0.0, 0.5 * target.size[-1])
    pixel = still(page, lambda: page.project(top))
    person.point(pixel)
    page.page.wait_for_selector("#selection:not([hidden])")
    person.keep("selection")
    if person.touches:
        person.press(page.page.locator("#selection button", has_text="Remove"))
    else:
        page.page.keyboard.press("Delete")
    page.wait_until(lambda: names() == before, "the object to go")
    if person.touches:
        person.press(page.page.locator("#help-button"))
        person.keep("help")
        person.press(page.page.locator("#undo"))
        person.button("Close", inside="#help")
    else:
        page.page.keyboard.press("Control+z")
    page.wait_until(lambda: added in names(), "the object to return")


def teaching(person: Person) -> None:
    page = person.page
    person.press(page.page.locator("#teach-button"))
    page.page.wait_for_selector("#teach:not([hidden])")
    page.page.locator("#teach > select").select_option("New poses")
    rows = page.page.locator("#teach li[data-id]")
    person.button("Add pose", inside="#teach")
    page.wait_until(lambda: rows.count() == 1, "the pose")
    person.keep("teach")
    person.button("Undo in Programs", inside="#teach")
    page.wait_until(lambda: rows.count() == 0, "the pose to go")
    person.assert_stop_is_free()
    person.press(page.page.locator("#teach-button"))


def views(person: Person) -> None:
    page = person.page
    person.press(page.page.locator("#instruments-button"))
    page.page.wait_for_selector("#instruments:not([hidden]) canvas")
    person.assert_stop_is_free()
    person.keep("instruments")
    person.press(page.page.locator("#instruments-button"))
    person.press(page.page.locator("#more-button"))
    person.keep("menu")
    person.assert_stop_is_free()
    page.page.keyboard.press("Escape")
    person.truth.wait(mood="stopped")
    clear_stop(page, person.truth)
    since = page.frame.evaluate("() => harness.now()")
    person.press(page.page.get_by_role("group", name="Camera").get_by_role("button", name="Fit"))
    page.wait_until(lambda: page.sent("ViewerCameraMessage", since=since), "the view")
    person.keep("fit")
