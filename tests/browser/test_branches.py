"""Branches on the page."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from katana450.arm.robot.robot import Robot
from katana450.client import Client
from katana450.server.api import answers
from tests.browser.page import ViserPage
from tests.browser.session import bar

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
def page(page: ViserPage) -> Iterator[ViserPage]:
    """Return a window with the open folder of the branches."""
    page.page.set_viewport_size({"width": 1440, "height": 1000})
    page.page.wait_for_selector("#cube", state="attached")
    folder = page.frame.get_by_text("Branches", exact=True)
    folder.click()
    row(page, "front-down").scroll_into_view_if_needed()
    yield page
    folder.click()


def row(page: ViserPage, branch: str) -> Any:
    return page.frame.locator(f"tr[data-branch={branch}]")


def wait_names(page: ViserPage, *wanted: str) -> None:
    """Wait until ghosts with these names are shown."""
    names = page.page.locator("#branch-label:visible")
    page.wait_until(lambda: names.all_inner_texts() == list(wanted), f"the names {wanted}")


@pytest.mark.long
def test_row_under_the_mouse_shows_its_branch(
    page: ViserPage, reader: Client, robot: Robot, artefacts: Path
) -> None:
    choices = reader.query(answers.Branches).choices
    path = reader.query(answers.Arm).links[-1].path
    gripper = reader.query(answers.State).gripper
    options = {f"{choice.shoulder}-{choice.elbow}": choice for choice in choices}
    sent = len(page.sent("GuiUpdateMessage"))
    for branch, words in (("front-down", "elbow down"), ("back-up", "shoulder back")):
        row(page, branch).hover()
        wait_names(page, f"{words}, {options[branch].time:.1f} s")
        matrix = page.frame.evaluate(GHOST, f"/arm/{'/'.join(path)}")
        frames = robot.frames(robot.joint_values(np.array(options[branch].q), gripper))
        assert np.allclose(np.reshape(matrix, (4, 4)).T, frames[path[-1]], atol=1e-4)
        page.keep(artefacts / f"branch-{branch}.png")
    # It asks the arm for nothing, and the arm's own branch has no ghost.
    assert len(page.sent("GuiUpdateMessage")) == sent
    row(page, "front-up").hover()
    wait_names(page)
    assert page.frame.evaluate(GHOST, f"/arm/{'/'.join(path)}") is None
    assert bar(page, "headline") == "On target"
