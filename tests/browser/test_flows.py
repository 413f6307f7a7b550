"""The flows of the page from the first visit on, at four sizes in both themes.

By mouse and keys at a desk, by real touches on a phone. The details of each flow have tests of
their own, which CONTRIBUTING.md lists.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from katana450.client import Client
from katana450.server.api import answers
from tests.browser.page import Pixel
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
    page.page.locator("#speed input").fill("10")
    truth.wait(speed=0.1)
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


LONG = "Long way"
"""A script that is planned for longer than a busy page takes to show it."""


@pytest.fixture
def long_script(scripts: Path) -> Iterator[None]:
    """Keep a script of 400 lines in the folder of the server."""
    file = scripts / f"{LONG}.yaml"
    there_and_back = "{line: {by: {y: 60}}}, {line: {by: {y: -60}}}"
    file.write_text(f"steps: [{{repeat: {{times: 200, steps: [{there_and_back}]}}}}]", "utf-8")
    yield
    file.unlink()


@in_sizes_and_schemes(SIZES)
@pytest.mark.usefixtures("long_script")
def test_further_flows_of_the_page(person: Person, reader: Client) -> None:
    pour(person)
    planning(person)
    taught_poses(person)
    link(person, reader)
    branch(person)


def pour(person: Person) -> None:
    page = person.page
    page.page.wait_for_selector("#welcome:not([hidden])")
    person.press(page.page.locator("#welcome button", has_text="Watch it pour"))
    says = page.page.locator("#welcome [role=status]")
    page.wait_until(lambda: bar(page, "headline").startswith("Pour:"), "the run", seconds=PLANNED)
    person.truth.wait(20.0, moving=True)
    person.keep("pour")
    person.stop()
    page.wait_until(lambda: "did not pour" in says.inner_text(), "the end")
    person.button("Close for good")


def planning(person: Person) -> None:
    page, truth = person.page, person.truth
    person.press(page.page.locator("#teach-button"))
    page.page.locator("#teach > select").select_option(LONG)
    person.button("Preview", inside="#teach")
    page.wait_until(lambda: bar(page, "headline").startswith("Planning"), "the planning")
    person.button("Cancel", inside="#orders")
    page.wait_until(lambda: "Planning" not in bar(page, "headline"), "the end", seconds=20.0)
    person.assert_stop_is_free()
    person.keep("planning-cancelled")
    assert truth.status()["moving"] is False
    page.page.locator("#teach > select").select_option("New poses")
    person.press(page.page.locator("#teach-button"))


def taught_poses(person: Person) -> None:
    page, truth = person.page, person.truth
    rows = page.page.locator("#teach li[data-id]")
    for number, angle in enumerate((25.0, -15.0), 1):
        person.open_panel()
        box = page.number_box(AXES[0])
        box.fill(str(angle))
        box.press("Enter")
        goal = np.radians(angle)
        page.wait_until(lambda goal=goal: abs(truth.status()["q"][0] - goal) < 1e-3, "axis 1")  # type: ignore[misc]
        truth.wait(10.0, moving=False)
        person.fold_panel()
        person.press(page.page.locator("#teach-button"))
        page.page.wait_for_selector("#teach:not([hidden])")
        person.button("Add pose", inside="#teach")
        page.wait_until(lambda number=number: rows.count() == number, "the pose")  # type: ignore[misc]
        if number == 1:
            person.press(page.page.locator("#teach-button"))
    person.keep("taught")
    person.button("Run", inside="#teach")
    says = page.page.locator("#teach-says")
    page.wait_until(lambda: truth.status()["q"][0] > np.radians(20.0), "pose 1", seconds=PLANNED)
    page.wait_until(lambda: says.inner_text() == "Done.", "the end", seconds=PLANNED)
    assert truth.status()["q"][0] == pytest.approx(np.radians(-15.0), abs=1e-3)
    person.assert_stop_is_free()
    person.press(page.page.locator("#teach-button"))


def link(person: Person, reader: Client) -> None:
    page, truth = person.page, person.truth
    links = ["/arm/" + "/".join(link.path) for link in reader.query(answers.Arm).links]

    def middle() -> Pixel:
        """Return the pixel in the middle of the upper arm."""
        shoulder, elbow = (page.node_pose(link)[:3, 3] for link in links[1:3])
        return page.project(0.5 * (shoulder + elbow))

    person.point(still(page, middle))
    chosen = page.page.get_by_role("group", name="Selected joint")
    page.wait_until(chosen.is_visible, "the bar of the joint")
    assert chosen.locator("b").inner_text() == "2 shoulder"
    before = truth.status()["goal"]
    person.press(page.page.get_by_role("button", name="2 shoulder plus 1°"))
    wanted = before[1] + np.radians(1.0)
    page.wait_until(lambda: abs(truth.status()["q"][1] - wanted) < 1e-4, "one degree more")
    person.keep("link")
    person.assert_stop_is_free()
    person.press(chosen.get_by_role("button", name="Deselect"))
    assert not chosen.is_visible()


def branch(person: Person) -> None:
    page, truth = person.page, person.truth
    person.open_panel()
    person.press(page.frame.get_by_role("button", name="Home", exact=True))
    truth.wait(10.0, moving=False)
    person.press(page.frame.get_by_text("Branches", exact=True))
    below = page.frame.get_by_role("button", name="front-down", exact=True)
    below.scroll_into_view_if_needed()
    person.keep("branches")
    elbow = truth.status()["q"][2]
    person.press(below)
    page.wait_until(lambda: truth.status()["q"][2] * elbow < 0.0, "the elbow below", seconds=40.0)
    truth.wait(20.0, moving=False)
    person.press(page.frame.get_by_text("Branches", exact=True))
    person.fold_panel()
