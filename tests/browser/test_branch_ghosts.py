"""Ghosts of the branches: the arm on the branch under the pointer, and the names of the ghosts."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from katana450.arm.robot.robot import Robot
from katana450.client import connect
from katana450.server.api import answers
from tests.browser.conftest import OpenPage
from tests.browser.page import ViserPage
from tests.browser.server import AppServer
from tests.browser.session import MOVE, READY, Truth, bar, prepare, set_speed

GHOST = """(path) => {
    const ghost = katanaScene.viewer().scene.getObjectByName("branch");
    if (!ghost) return null;
    const link = katanaScene.node(path);
    let shape = null;
    link.traverse((each) => (shape ??= each.isMesh ? each : null));
    let copy = null;
    ghost.traverse((each) => (copy ??= each.geometry === shape.geometry ? each : null));
    for (const each of [link, shape, copy]) each.updateWorldMatrix(true, false);
    // The place of the shape in its link is the same in the arm and in its ghost.
    const inLink = link.matrixWorld.clone().invert().multiply(shape.matrixWorld);
    const world = katanaScene.node("").matrixWorld.clone().invert();
    return world.multiply(copy.matrixWorld).multiply(inLink.invert()).toArray();
}"""
"""Returns the pose of a link (column-major) of the ghost under the pointer; null without one."""


@pytest.fixture
def page(server: AppServer, open_page: OpenPage, truth: Truth) -> ViserPage:
    """Return a new window with the table of the branches open, whose person drives."""
    page = open_page(server.url, nodes=("/arm", MOVE), window=(1440, 1000))
    prepare(page, truth)
    page.page.wait_for_selector("#cube", state="attached")
    page.frame.get_by_text("Branches", exact=True).click()
    row(page, "front-down").scroll_into_view_if_needed()
    return page


def row(page: ViserPage, branch: str) -> Any:
    return page.frame.locator(f"tr[data-branch={branch}]")


def names(page: ViserPage) -> list[str]:
    return page.page.locator("#branch-labels p").all_inner_texts()


def wait_names(page: ViserPage, *wanted: str) -> None:
    page.wait_until(lambda: names(page) == list(wanted), f"the names {wanted}")


@pytest.mark.long
def test_row_under_the_mouse_shows_its_branch_here_alone(
    page: ViserPage, server: AppServer, robot: Robot, artefacts: Path
) -> None:
    with connect(server.url, "Reader") as reader:
        choices = reader.query(answers.Branches).choices
        path = reader.query(answers.Arm).links[-1].path
        gripper = reader.query(answers.State).gripper
    options = {f"{each.shoulder}-{each.elbow}": each for each in choices}
    sent = len(page.sent("GuiUpdateMessage"))
    for branch, words in (("front-down", "elbow down"), ("back-up", "shoulder back")):
        row(page, branch).hover()
        wait_names(page, f"{words}, {options[branch].time:.1f} s")
        matrix = page.frame.evaluate(GHOST, f"/arm/{'/'.join(path)}")
        frames = robot.frames(robot.joint_values(np.array(options[branch].q), gripper))
        assert np.allclose(np.reshape(matrix, (4, 4)).T, frames[path[-1]], atol=1e-4)
        page.keep(artefacts / f"branch-{branch}.png")
    # The name is above the elbow.
    elbow = page.project(frames[path[-3]][:3, 3])
    box = page.page.locator("#branch-labels p").bounding_box()
    assert box is not None
    assert abs(box["x"] + box["width"] / 2 - elbow[0]) < 3.0
    assert 0.0 < elbow[1] - box["y"] < 60.0
    # It asks the arm for nothing, and the arm's own branch has no ghost.
    assert len(page.sent("GuiUpdateMessage")) == sent
    assert page.frame.evaluate("Boolean(katanaScene.node('/branch/back-up'))") is False
    row(page, "front-up").hover()
    wait_names(page)
    assert page.frame.evaluate(GHOST, f"/arm/{'/'.join(path)}") is None
    assert bar(page, "headline") == "On target"
    assert page.errors == []


@pytest.mark.long
def test_time_is_that_at_the_present_speed(page: ViserPage, truth: Truth) -> None:
    row(page, "front-down").hover()
    page.wait_until(lambda: names(page), "the name")
    (fast,) = names(page)
    set_speed(page, 50)
    truth.wait(speed=0.5)
    row(page, "front-up").hover()
    wait_names(page)
    row(page, "front-down").hover()
    page.wait_until(lambda: names(page), "the name")
    (slow,) = names(page)
    ratio = float(slow.split(", ")[1][:-2]) / float(fast.split(", ")[1][:-2])
    assert ratio == pytest.approx(2.0, abs=0.1)
    set_speed(page, 100)
    truth.wait(speed=1.0)


@pytest.mark.long
def test_ghost_of_the_list_has_a_name_too(page: ViserPage, truth: Truth, artefacts: Path) -> None:
    page.choose("Ghosts", "front-down")
    page.page.mouse.move(400, 700)
    # A name that shows while the mouse leaves the panel goes before that of the list comes.
    page.wait_until(
        lambda: [each.startswith("elbow down, ") for each in names(page)] == [True], "the name"
    )
    page.keep(artefacts / "branch-list.png")
    page.choose("Ghosts", "None")
    wait_names(page)
    assert np.allclose(truth.status()["q"], READY, atol=1e-6)


@pytest.mark.long
def test_finger_shows_a_branch_by_a_tap(
    server: AppServer, open_page: OpenPage, artefacts: Path
) -> None:
    page = open_page(
        server.url,
        nodes=("/arm", MOVE),
        window=(390, 844),
        own_camera=True,
        has_touch=True,
        is_mobile=True,
    )
    page.page.wait_for_selector("#cube", state="attached")
    page.frame.locator("#k450-sheet").tap()
    page.frame.get_by_text("Branches", exact=True).tap()
    row(page, "front-down").scroll_into_view_if_needed()
    row(page, "front-down").tap()
    page.wait_until(lambda: len(names(page)) == 1, "the name")
    assert names(page)[0].startswith("elbow down, ")
    page.keep(artefacts / "branch-390.png")
    row(page, "front-up").tap()
    wait_names(page)
    assert page.errors == []
