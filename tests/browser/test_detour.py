"""The sentence of the bar: it names a joint at its limit, and offers a detour."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from katana450.client import connect
from katana450.server.api import requests
from tests.browser.conftest import Windows
from tests.browser.page import ViserPage
from tests.browser.server import AppServer

MOVE = "/target/move"


@pytest.fixture
def page(server: AppServer, windows: Windows) -> Iterator[ViserPage]:
    with windows.open(server.url, nodes=("/arm", MOVE)) as page:
        yield page


def why(page: ViserPage) -> str:
    return page.page.locator("#why").inner_text()


def mood(page: ViserPage) -> str | None:
    return page.page.locator("body").get_attribute("data-mood")


def rests(page: ViserPage) -> bool:
    """Return whether the handle keeps its place; it follows the arm once it is released."""
    before = page.node_pose(MOVE)
    page.page.wait_for_timeout(300)
    return np.array_equal(before, page.node_pose(MOVE))


def drag_to_the_gap(page: ViserPage) -> None:
    """Lift the tool by 20 cm and pull it back over the shoulder, where limits hold it."""
    page.drag_arrow(MOVE, "z", 0.2)
    page.wait_until(lambda: mood(page) == "limited" and rests(page), "rest")
    page.drag_arrow(MOVE, "x", -0.45)
    page.wait_until(lambda: page.page.locator("#go").is_visible(), "the offer", seconds=20.0)


@pytest.mark.long
def test_detour_is_offered_in_the_sentence_and_taken_by_enter_or_go(
    page: ViserPage, artefacts: Path
) -> None:
    for taken_by in ("Enter", "Go"):
        drag_to_the_gap(page)
        assert "s detour" in why(page)
        assert "press Enter or Go" in why(page)
        page.screenshot(artefacts / f"detour-{taken_by}.png")
        if taken_by == "Enter":
            page.page.keyboard.press("Enter")
        else:
            page.page.locator("#go").click()
        page.wait_until(lambda: page.page.locator("#go").is_hidden(), "the detour")
        page.wait_until(
            lambda: mood(page) in ("ok", "limited"),
            "the arrival",
            seconds=20.0,
        )
        assert "would have to leap" not in why(page)
        page.click_button("Home")
        page.wait_until(
            lambda: page.page.locator("#headline").inner_text() == "On target",
            "the ready posture",
            seconds=20.0,
        )


@pytest.mark.long
def test_reason_names_the_joint(page: ViserPage, server: AppServer, artefacts: Path) -> None:
    with connect(server.url, "Driver") as driver:
        driver.ask(requests.Joint(axis=5, value=30.0))
        reason = "xis 5 (wrist roll) at its limit of 171.50°"
        page.wait_until(lambda: reason in page.page.inner_text("#why"), "the reason")
        page.keep(artefacts / "reason-names-the-joint.png")
        driver.ask(requests.Home())
        driver.ask(requests.ReleaseLease())
