"""The page of arms outside the five-axis family: a UR5e with gizmo, steps and branches."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.browser.conftest import OpenPage
from tests.browser.instruments import show
from tests.browser.page import ViserPage
from tests.browser.server import APP, AppServer
from tests.general_arms.links_of_arms import ur5e

pytestmark = pytest.mark.long


@pytest.fixture
def six(tmp_path: Path, open_page: OpenPage) -> Iterator[ViserPage]:
    path = tmp_path / "ur5e.urdf"
    path.write_text(ur5e(), encoding="utf-8")
    with AppServer((*APP, "--urdf", str(path))) as server:
        yield open_page(server.url)


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
