"""The page of arms outside the five-axis family: a UR5e with gizmo, jog and branches; a Panda."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from katana450.maths.geometry import so3
from tests.browser.conftest import OpenPage
from tests.browser.instruments import show
from tests.browser.page import ViserPage
from tests.browser.server import APP, AppServer
from tests.general_arms.chain_urdf import chain_urdf
from tests.general_arms.links_of_arms import ur5e
from tests.general_arms.published_arms import PANDA

pytestmark = pytest.mark.long

TURN_WORTH_SEEING = 0.05
"""[rad]"""


@pytest.fixture(scope="module")
def other(tmp_path_factory: pytest.TempPathFactory) -> Iterator[AppServer]:
    path = tmp_path_factory.mktemp("ur5e") / "ur5e.urdf"
    path.write_text(ur5e(), encoding="utf-8")
    with AppServer((*APP, "--urdf", str(path))) as server:
        yield server


@pytest.fixture
def six(other: AppServer, open_page: OpenPage) -> ViserPage:
    return open_page(other.url)


def link(page: ViserPage, name: str) -> Any:
    """Return the pose (4, 4) at which a link is drawn."""
    names = page.frame.evaluate("() => Object.keys(__viserMutable.nodeRefFromName)")
    return page.node_pose(next(node for node in names if node.endswith(f"/{name}")))


def tool(page: ViserPage) -> Any:
    return link(page, "tool0")


def test_a_held_key_turns_the_tool_about_the_vertical(six: ViserPage) -> None:
    six.page.click("#jog-button")
    six.page.wait_for_selector("[data-hold=KeyQ]", state="visible")
    start = tool(six)
    six.page.keyboard.down("KeyQ")
    six.wait_until(
        lambda: so3.angle(tool(six)[:3, :3], start[:3, :3]) > TURN_WORTH_SEEING, "the tool to turn"
    )
    six.page.keyboard.up("KeyQ")
    end = six.settled(lambda: tool(six), "the tool")
    turn = so3.log(end[:3, :3] @ start[:3, :3].T)
    np.testing.assert_allclose(turn[:2], 0.0, atol=0.02)
    assert turn[2] > TURN_WORTH_SEEING
    np.testing.assert_allclose(end[:3, 3], start[:3, 3], atol=0.003)
    assert not six.errors


def test_instruments_steps_gizmo_and_branches_are_those_of_the_arm(six: ViserPage) -> None:
    show(six, True)
    titles = [
        card.get_attribute("aria-label") for card in six.page.locator("#instruments .card").all()
    ]
    assert titles[:6] == [
        "1 shoulder pan",
        "2 shoulder lift",
        "3 elbow",
        "4 wrist 1",
        "5 wrist 2",
        "6 wrist 3",
    ]
    # It has no hand.
    cards = six.page.locator("#instruments .card")
    for name in ("touch", "grip-forces", "gripper"):
        assert not cards.and_(six.page.locator(f"[data-id={name}]")).count()
    # Steps of joints are in rows, whatever their names.
    six.page.click("#jog-button")
    six.page.get_by_text("Joints", exact=True).click()
    buttons = six.page.locator("#steps button")
    buttons.nth(11).wait_for(state="visible")
    boxes = [button.bounding_box() for button in buttons.all()]
    places = [(round(box["y"]), round(box["height"])) for box in boxes if box is not None]
    rows = [places[column : column + 2] for column in range(0, 12, 2)]
    assert rows == [rows[0]] * 3 + [rows[3]] * 3
    names = six.frame.evaluate("() => Object.keys(__viserMutable.nodeRefFromName)")
    assert "/target/move" in names
    assert "/target/move/turn" in names
    assert "/target/move/roll" not in names
    # The panel has its place beside the scene again.
    show(six, False)
    six.page.click("#jog-button")
    six.frame.get_by_text("Branches", exact=True).click()
    branches = six.frame.locator("tr[data-branch]")
    branches.first.wait_for()
    assert branches.count() == 8
    assert "left-up-noflip" in {branches.nth(k).get_attribute("data-branch") for k in range(8)}
    assert not six.errors


def test_ring_at_the_elbow_moves_it_while_the_tool_rests(
    tmp_path: Path, open_page: OpenPage
) -> None:
    path = tmp_path / "panda.urdf"
    path.write_text(chain_urdf("panda", PANDA), encoding="utf-8")
    with AppServer((*APP, "--urdf", str(path))) as server:
        page = open_page(server.url, nodes=("/target/elbow",), own_camera=True)
        start, elbow = tool(page), link(page, "link4")
        page.drag_ring("/target/elbow", "x", 0.4)
        page.wait_until(
            lambda: np.linalg.norm((link(page, "link4") - elbow)[:3, 3]) > 0.05, "the elbow"
        )
        page.settled(lambda: link(page, "link4").tolist(), "the elbow")
        np.testing.assert_allclose(tool(page), start, atol=2e-6)
        assert not page.errors
