"""The flows of the page from the first visit on, at four sizes in both themes.

By mouse and keys at a desk, by real touches on a phone. The details of each flow have tests of
their own, which CONTRIBUTING.md lists.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from playwright.sync_api import Locator

from katana450.client import Client
from katana450.server.api import answers
from tests.browser.conftest import OpenPage
from tests.browser.finger import fingers, middle
from tests.browser.page import FIRST_VISIT, Pixel, ViserPage
from tests.browser.server import AppServer
from tests.browser.session import AXES, MOVE, Truth, bar, clear_stop
from tests.browser.shared_server import SharedServer
from tests.browser.sizes import LANDSCAPE, PHONE, PORTRAIT, SIZES, in_sizes_and_schemes

pytestmark = pytest.mark.long

PHONES = (PORTRAIT, LANDSCAPE)
PLANNED = 60.0
"""Timeout [s] of a plan on a busy machine."""

DOUBLE = 700
"""Time [ms] after which a second press of Pause is one of its own."""

Keep = Callable[[str], None]


class Person:
    """A person who presses by mouse at a desk and by finger on a phone."""

    def __init__(self, page: ViserPage, truth: Truth, keep: Keep, *, touches: bool) -> None:
        self.page, self.truth, self.keep, self.touches = page, truth, keep, touches

    def press(self, element: Locator) -> None:
        if self.touches:
            element.tap()
        else:
            element.click()

    def button(self, name: str, *, inside: str = "body") -> None:
        self.press(self.page.page.locator(inside).get_by_role("button", name=name, exact=True))

    def drag_arrow(self, metres: float) -> None:
        if not self.touches:
            self.page.drag_arrow(MOVE, "z", metres)
            return
        start, end = self.page.grip_arrow(MOVE, "z").pixels(metres)
        with fingers(self.page.page) as hand:
            hand.put(start)
            hand.move(end)
            hand.lift()

    def open_panel(self, tab: str) -> None:
        sheet = self.page.frame.locator("#k450-sheet")
        while self.touches and sheet.is_visible():
            if sheet.get_attribute("aria-label") == "Controls, full height":
                break
            sheet.tap()
            self.page.page.wait_for_timeout(400)
        if self.touches and sheet.is_visible():
            self.assert_above(self.page.page.get_by_role("group", name="Camera"), sheet)
        self.press(self.page.frame.get_by_role("tab", name=tab, exact=True))

    def pause(self, status: Callable[[], Any]) -> None:
        """Pause by the bar; a second press that follows at once would be the same one."""
        self.press(self.page.page.locator("#pause"))
        self.page.wait_until(lambda: status() == "paused", "the pause")
        self.page.page.wait_for_timeout(DOUBLE)

    def assert_above(self, group: Locator, sheet: Locator) -> None:
        """Check that the buttons of ``group`` lie above the ``sheet``, not over its controls."""
        top = sheet.bounding_box()
        assert top is not None
        for button in group.locator("button, select").all():
            box = button.bounding_box() if button.is_visible() else None
            assert box is None or box["y"] + box["height"] <= top["y"] + 1.0

    def fold_panel(self) -> None:
        sheet = self.page.frame.locator("#k450-sheet")
        if self.touches and sheet.is_visible():
            sheet.tap()
            self.page.page.wait_for_timeout(400)

    def stop(self) -> None:
        """Stop by the key or the button, and clear the stop."""
        self.assert_stop_is_free()
        if self.touches:
            self.page.page.locator("#stop").tap()
        else:
            self.page.page.keyboard.press("Escape")
        self.truth.wait(mood="stopped")
        self.page.wait_until(lambda: bar(self.page, "headline") == "Stopped", "the stop")
        clear_stop(self.page, self.truth)

    def assert_stop_is_free(self) -> None:
        """Check that nothing lies over STOP and that the page does not scroll sideways."""
        place = middle(self.page.page.locator("#stop"))
        found = self.page.page.evaluate("(at) => document.elementFromPoint(...at).id", place)
        assert found == "stop"
        assert self.page.page.evaluate("() => document.documentElement.scrollWidth <= innerWidth")


@pytest.fixture
def server(shared_server: SharedServer) -> AppServer:
    """Return the server in the state of a new one for each walk, which leaves an object."""
    return shared_server.as_new()


@pytest.fixture
def person(
    server: AppServer, open_page: OpenPage, size: str, scheme: str, truth: Truth, artefacts: Path
) -> Iterator[Person]:
    touches = SIZES[size] in PHONES
    page = open_page(
        server.url,
        nodes=("/arm", MOVE),
        window=SIZES[size],
        color_scheme=scheme,
        own_camera=True,
        script=FIRST_VISIT,
        **(PHONE if touches else {}),
    )
    if truth.status()["stopped"] is not None:
        clear_stop(page, truth)

    def keep(name: str) -> None:
        page.keep(artefacts / f"flow-{name}-{size}-{scheme}.png")

    yield Person(page, truth, keep, touches=touches)
    assert page.errors == []


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
    person.open_panel("Drive")
    person.keep("drive")
    person.press(page.frame.get_by_role("button", name="Home", exact=True))
    person.fold_panel()
    truth.wait(moving=True)
    person.pause(lambda: truth.status()["status"])
    page.wait_until(lambda: bar(page, "headline").startswith("Paused by you"), "the pause")
    person.keep("paused")
    person.press(page.page.locator("#pause"))
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
    person.open_panel("Drive")
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
    person.open_panel("Programs")
    page.choose("Script", "Circle with gripper")
    person.press(page.frame.get_by_role("button", name="Preview", exact=True))

    def status() -> Any:
        return truth.status().get("program", {}).get("status")

    page.wait_until(lambda: status() == "ready", "the plan", seconds=PLANNED)
    person.keep("previewed")
    person.press(page.frame.get_by_role("button", name="Run", exact=True))
    page.wait_until(lambda: status() == "running", "the run")
    person.fold_panel()
    page.wait_until(lambda: "Step" in bar(page, "mode") or "step" in bar(page, "mode"), "the step")
    person.keep("program")
    person.pause(status)
    person.press(page.page.locator("#pause"))
    page.wait_until(lambda: status() == "running", "the program to continue")
    person.stop()


def objects(person: Person, reader: Client, folder: Path) -> None:
    page = person.page

    def names() -> set[str]:
        return {each.name for each in reader.query(answers.Objects).objects}

    before = names()
    part = folder / "part.stl"
    part.write_bytes(trimesh.creation.box((30.0, 30.0, 30.0)).export(file_type="stl"))
    person.press(page.page.locator("#objects-button"))
    with page.page.expect_file_chooser() as chooser:
        person.press(page.page.locator("#add"))
    chooser.value.set_files(part)
    page.wait_until(lambda: len(names()) == len(before) + 1, "the object")
    person.keep("objects")
    person.assert_stop_is_free()
    person.press(page.page.locator("#objects-button"))
    (added,) = names() - before
    found = next(each for each in reader.query(answers.Objects).objects if each.name == added)
    place: Any = np.array(found.T)
    top = place[:3, 3] + (0.0, 0.0, 0.5 * found.size[-1])
    pixel = still(page, lambda: page.project(top))
    if person.touches:
        page.page.touchscreen.tap(*pixel)
    else:
        page.page.mouse.click(*pixel)
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


def still(page: ViserPage, where: Callable[[], Pixel]) -> Pixel:
    """Return a pixel when it moves no more: the camera follows the size of the picture."""
    pixels = [where()]

    def rests() -> bool:
        page.page.wait_for_timeout(500)
        pixels.append(where())
        return bool(np.allclose(pixels[-1], pixels[-2], atol=0.5))

    page.wait_until(rests, "the camera to rest")
    return pixels[-1]


def teaching(person: Person) -> None:
    page = person.page
    person.press(page.page.locator("#teach-button"))
    page.page.wait_for_selector("#teach:not([hidden])")
    rows = page.page.locator("#teach li[data-id]")
    person.button("Add pose", inside="#teach")
    page.wait_until(lambda: rows.count() == 1, "the pose")
    person.keep("teach")
    person.button("Undo in Teach", inside="#teach")
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
