"""Two windows of one server: a command from before a stop, and the handover of the arm."""

from __future__ import annotations

import pytest

from tests.browser.conftest import OpenPage
from tests.browser.page import ViserPage
from tests.browser.server import AppServer
from tests.browser.session import AXES, MOVE, Truth, bar


def test_command_from_before_a_stop_moves_nothing_after_it(page: ViserPage, truth: Truth) -> None:
    q = [page.slider_value(label) for label in AXES]
    with page.grip_arrow(MOVE, "z") as grip:
        page.page.keyboard.press("Space")
        truth.wait(mood="stopped")
        # By a key, because the mouse is in use.
        page.page.wait_for_selector("#clear-stop:not([hidden]):enabled")
        page.page.focus("#clear-stop")
        page.page.keyboard.press("Enter")
        truth.wait(stopped=None)
        # The drag continues and moves nothing.
        grip.sweep(0.05, 5)
        page.page.wait_for_timeout(200)
        assert [page.slider_value(label) for label in AXES] == q
    page.wait_until(
        lambda: page.node_pose(MOVE)[2, 3] == pytest.approx(0.282, abs=2e-3), "the handle to return"
    )
    page.drag_arrow(MOVE, "z", 0.03)
    page.wait_until(lambda: page.slider_value("2 shoulder") != q[1], "a fresh drag to move it")
    page.click_button("Home")


@pytest.mark.long
def test_arm_is_handed_over(
    page: ViserPage, server: AppServer, truth: Truth, open_page: OpenPage
) -> None:
    other = open_page(server.url, nodes=("/arm", MOVE))
    me, they = (bar(window, "name").partition(",")[0] for window in (page, other))
    other.wait_until(lambda: bar(other, "holder") == f"{me} drives", "who drives")
    grey = "document.documentElement.hasAttribute('data-refused')"
    other.wait_until(lambda: other.frame.evaluate(grey), "the grey panel")
    assert not page.frame.evaluate(grey)
    # A control of a person who does not drive springs back, and the reason is shown.
    before = other.slider_value("1 base turn")
    other.drag_slider("1 base turn", 40.0)
    other.wait_until(lambda: bar(other, "toast") == f"{me} holds the arm: ask for it.", "why not")
    other.wait_until(
        lambda: other.slider_value("1 base turn") == before, "the slider to spring back"
    )
    other.press_in_bar("Request")
    page.wait_until(lambda: f"{they} asks for it" in bar(page, "name"), "the request")
    page.press_in_bar("Give")
    other.wait_until(lambda: bar(other, "holder") == "You drive", "the arm")
    assert truth.status()["holder"] == they
    page.press_in_bar("Take over")
    page.wait_until(lambda: bar(page, "holder") == "You drive", "the arm")
    page.page.select_option("#acts select", label=they)
    other.wait_until(lambda: bar(other, "holder") == "You drive", "the arm")
    other.press_in_bar("Release")
    page.wait_until(lambda: bar(page, "holder") == "Nobody drives", "nobody to drive")
    # The first person who uses a control drives.
    other.drag_slider("1 base turn", 10.0)
    other.wait_until(lambda: bar(other, "holder") == "You drive", "the arm")
    assert other.errors == []
