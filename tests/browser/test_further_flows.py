"""Further flows of the page at four sizes in both themes, beside those of ``test_flows``.

By mouse and keys at a desk, by real touches on a phone.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from katana450.client import Client
from katana450.server.api import answers
from tests.browser.page import Pixel
from tests.browser.person import Person, still
from tests.browser.server import AppServer
from tests.browser.session import AXES, bar
from tests.browser.shared_server import SharedServer
from tests.browser.sizes import SIZES, in_sizes_and_schemes

pytestmark = pytest.mark.long

PLANNED = 120.0
"""Timeout [s] of a plan on a busy machine."""

LONG = "Long way"
"""A script that is planned for longer than a busy page takes to show it."""


@pytest.fixture
def server(shared_server: SharedServer) -> AppServer:
    """Return the server in the state of a new one for each walk."""
    return shared_server.as_new()


@pytest.fixture(autouse=True)
def long_script(scripts: Path) -> Iterator[None]:
    """Keep a script of 400 lines in the folder of the server."""
    file = scripts / f"{LONG}.yaml"
    there_and_back = "{line: {by: {y: 60}}}, {line: {by: {y: -60}}}"
    file.write_text(f"steps: [{{repeat: {{times: 200, steps: [{there_and_back}]}}}}]", "utf-8")
    yield
    file.unlink()


@in_sizes_and_schemes(SIZES)
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
    page.wait_until(lambda: "Step" in says.inner_text(), "the run", seconds=PLANNED)
    person.truth.wait(20.0, moving=True)
    person.keep("pour")
    person.stop()
    page.wait_until(lambda: "did not pour" in says.inner_text(), "the end")
    person.button("Close for good")


def planning(person: Person) -> None:
    page, truth = person.page, person.truth
    person.open_panel("Programs")
    page.choose("Script", LONG)
    person.press(page.frame.get_by_role("button", name="Preview", exact=True))
    page.wait_until(lambda: bar(page, "headline").startswith("Planning"), "the planning")
    person.button("Cancel", inside="#orders")
    page.wait_until(lambda: "Planning" not in bar(page, "headline"), "the end", seconds=20.0)
    person.assert_stop_is_free()
    person.keep("planning-cancelled")
    assert truth.status()["moving"] is False
    person.fold_panel()


def taught_poses(person: Person) -> None:
    page, truth = person.page, person.truth
    rows = page.page.locator("#teach li[data-id]")
    for number, angle in enumerate((25.0, -15.0), 1):
        person.open_panel("Drive")
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
    person.button("Play", inside="#teach")
    says = page.page.locator("#teach-says")
    page.wait_until(lambda: truth.status()["q"][0] > np.radians(20.0), "pose 1", seconds=PLANNED)
    page.wait_until(lambda: says.inner_text() == "Done.", "the end", seconds=PLANNED)
    assert truth.status()["q"][0] == pytest.approx(np.radians(-15.0), abs=1e-3)
    person.assert_stop_is_free()
    person.press(page.page.locator("#teach-button"))


def link(person: Person, reader: Client) -> None:
    page, truth = person.page, person.truth
    links = ["/arm/" + "/".join(each.path) for each in reader.query(answers.Arm).links]

    def middle() -> Pixel:
        """Return the pixel in the middle of the upper arm."""
        shoulder, elbow = (page.node_pose(each)[:3, 3] for each in links[1:3])
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
    person.open_panel("Drive")
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
