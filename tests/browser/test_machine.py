"""A robot that has only joints: its links are turned and slid in the scene, by mouse."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np
import pytest

from katana450.client import connect
from katana450.server.api import answers
from tests.browser.camera import Camera
from tests.browser.conftest import OpenPage
from tests.browser.page import ViserPage
from tests.browser.server import APP, AppServer
from tests.browser.session import Truth, take
from tests.browser.spots import seen_at, spot
from tests.exchange.conftest import GANTRY

pytestmark = pytest.mark.long

SIDE = Camera((0.5, -1.6, 0.9), (0.0, 0.0, 0.3))
FOLLOWS = 2.0
"""Maximum distance [px] between a grabbed point and the mouse."""


@pytest.fixture(scope="module")
def server() -> Iterator[AppServer]:
    with AppServer((*APP, "--urdf", str(GANTRY))) as server:
        yield server


@pytest.fixture(scope="module")
def links(server: AppServer) -> list[str]:
    """Return the node of the link that each joint moves; a name of the last has a slash."""
    with connect(server.url, "Reader") as reader:
        arm = reader.query(answers.Arm)
    assert arm.joints_only
    assert arm.slides == [True, False, False]
    paths = [[quote(name, safe="") for name in link.path] for link in arm.links]
    assert paths[-1][-1] == "left%2Ffinger"
    return ["/arm/" + "/".join(path) for path in paths]


@pytest.fixture
def page(server: AppServer, open_page: OpenPage, links: list[str]) -> Iterator[ViserPage]:
    page = open_page(server.url, nodes=links, camera=SIDE)
    page.page.wait_for_selector("#cube", state="attached")
    take(page)
    yield page
    assert page.errors == []


def q(truth: Truth) -> Any:
    truth.wait(20.0, moving=False)
    return np.array(truth.status()["q"])


@pytest.mark.parametrize(("joint", "by"), [(0, (70.0, -10.0)), (1, (50.0, 0.0)), (2, (0.0, 40.0))])
def test_dragged_link_turns_or_slides_its_joint(
    page: ViserPage, links: list[str], truth: Truth, artefacts: Path, joint: int, by: Any
) -> None:
    before, place = q(truth), spot(page, links, joint)
    x, y = place.pixel
    page.page.mouse.move(x - 2.0, y)
    page.page.mouse.move(x, y)
    name = page.page.locator("#joint-label")
    page.wait_until(name.is_visible, "its name")
    assert name.inner_text() == ("1 rail", "2 turn", "3 grip")[joint]
    page.page.mouse.down()
    page.page.wait_for_timeout(200)
    page.page.mouse.move(x + by[0], y + by[1], steps=10)
    page.page.wait_for_timeout(200)
    assert name.inner_text().endswith("mm" if joint == 0 else "°")
    page.keep(artefacts / f"machine-drag-{joint}.png")
    page.page.mouse.up()
    moved = q(truth) - before
    assert list(np.abs(moved) > 1e-3) == [number == joint for number in range(3)]
    if joint == 0:
        # The grabbed point follows the mouse along the rail.
        along = np.subtract(seen_at(page, links[0], place), place.pixel)
        away = np.asarray(by) - along
        assert abs(away @ along) / np.linalg.norm(along) < FOLLOWS
    page.page.keyboard.press("Control+z")
    page.wait_until(lambda: np.allclose(q(truth), before, atol=1e-6), "the way back")
