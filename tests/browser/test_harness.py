"""The harness itself, tested with a minimal viser app."""

from __future__ import annotations

import math
import re
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import viser.transforms as vtf
from playwright.sync_api import Browser
from playwright.sync_api import Error as PlaywrightError

from tests.browser.conftest import OpenPage, Windows
from tests.browser.page import Axis, Matrix, ViserPage
from tests.browser.server import BARE_APP, AppServer

MOVE, PITCH, ROLL = "/target/move", "/target/move/pitch", "/target/move/roll"
BOX, DIAL = "/arm/box", "/arm/dial"
NODES = (MOVE, PITCH, ROLL, BOX, DIAL)
START = (0.25, 0.0, 0.25)
# One pixel of the slider is several degrees.
SLIDER_PIXEL_DEGREES = 340.0 / 100.0


@pytest.fixture(scope="module")
def server() -> Iterator[AppServer]:
    """Run the minimal app."""
    with AppServer(BARE_APP) as server:
        yield server


@pytest.fixture(scope="module")
def window(windows: Windows, server: AppServer) -> Iterator[ViserPage]:
    """Open one window of the minimal app for all tests here."""
    with windows.open(server.url, nodes=NODES) as window:
        yield window


@pytest.fixture
def page(window: ViserPage) -> Iterator[ViserPage]:
    """Return the window, with the box at its start and no error on the console."""
    page = window
    page.click_button("Reset")
    page.wait_until(
        lambda: np.allclose(page.node_pose(BOX), _at(START), atol=1e-9), "the box at its start"
    )
    yield page
    assert page.errors == []


def _at(position: tuple[float, float, float]) -> Matrix:
    return vtf.SE3.from_translation(np.array(position)).as_matrix()


def _rotation_vector(T: Matrix) -> Matrix:
    return vtf.SO3.from_matrix(T[:3, :3]).log()


@pytest.mark.cases(1)
@pytest.mark.parametrize(("axis", "metres"), [("x", -0.06), ("y", 0.05), ("z", 0.07)])
def test_an_arrow_moves_the_box_along_its_axis(page: ViserPage, axis: Axis, metres: float) -> None:
    page.drag_arrow(MOVE, axis, metres)
    along = "xyz".index(axis)

    def moved() -> Matrix:
        return page.node_pose(BOX)[:3, 3] - START

    page.wait_until(lambda: moved()[along] == pytest.approx(metres, abs=1e-5), "the box")
    assert np.delete(moved(), along) == pytest.approx([0.0, 0.0], abs=1e-6)


@pytest.mark.cases(1)
@pytest.mark.parametrize(
    ("node", "axis", "radians"), [(PITCH, "y", 0.5), (PITCH, "y", -0.7), (ROLL, "x", 0.6)]
)
def test_a_ring_turns_the_box_about_its_axis(
    page: ViserPage, node: str, axis: Axis, radians: float
) -> None:
    page.drag_ring(node, axis, radians)
    vector = radians * np.eye(3)["xyz".index(axis)]
    page.wait_until(
        lambda: _rotation_vector(page.node_pose(BOX)) == pytest.approx(vector, abs=1e-4), "the box"
    )
    assert page.node_pose(BOX)[:3, 3] == pytest.approx(START, abs=1e-6)


@pytest.mark.long
def test_a_slider_is_dragged_by_mouse(page: ViserPage) -> None:
    for degrees in (75.0, -120.0):
        shown = page.drag_slider("Axis 1", degrees)
        assert shown == pytest.approx(degrees, abs=SLIDER_PIXEL_DEGREES)
        page.wait_until(
            lambda shown=shown: np.allclose(  # type: ignore[misc]
                _rotation_vector(page.node_pose(DIAL)), [0.0, 0.0, math.radians(shown)], atol=1e-9
            ),
            f"the dial at {shown} degrees",
        )
    assert "Axis 1" in page.panel_text()


def test_a_number_is_typed_beside_a_slider(page: ViserPage) -> None:
    page.type_number("Axis 1", 33.3)
    assert page.slider_value("Axis 1") == 33.3
    page.wait_until(
        lambda: np.allclose(
            _rotation_vector(page.node_pose(DIAL)), [0.0, 0.0, math.radians(33.3)], atol=1e-9
        ),
        "the dial at 33.3 degrees",
    )


@pytest.mark.long
def test_a_second_window_sees_the_same_pose(
    page: ViserPage, open_page: OpenPage, server: AppServer
) -> None:
    other = open_page(server.url, nodes=NODES)
    page.drag_arrow(MOVE, "z", 0.04)
    page.drag_ring(ROLL, "x", 0.4)
    pose = page.node_pose(BOX)
    assert not np.allclose(pose, _at(START), atol=0.03)
    other.wait_until(
        lambda: np.allclose(other.node_pose(BOX), pose, atol=1e-9), "the box in the second window"
    )
    # Only the window that does not drag receives the gizmo's pose.
    assert other.node_pose(MOVE) == pytest.approx(page.node_pose(MOVE), abs=1e-9)
    assert other.last_pose(MOVE)[2, 3] == pytest.approx(START[2] + 0.04, abs=1e-3)


def test_messages_are_recorded_with_their_time(page: ViserPage) -> None:
    before = time.time()
    page.drag_arrow(MOVE, "x", 0.03)
    page.wait_until(
        lambda: page.last_pose(BOX)[0, 3] == pytest.approx(START[0] + 0.03, abs=1e-3),
        "the box's last pose on the wire",
    )
    assert page.last_pose(BOX) == pytest.approx(page.node_pose(BOX), abs=1e-9)
    [start] = page.sent("TransformControlsDragStartMessage", since=before)
    poses = page.messages("SetPositionMessage", since=before)
    assert start.body["name"] == MOVE
    assert {pose.body["name"] for pose in poses} == {BOX}
    times = [before, start.time, *(pose.time for pose in poses), time.time()]
    assert times == sorted(times)
    with pytest.raises(LookupError, match="/nowhere"):
        page.last_pose("/nowhere")


def test_the_box_is_drawn_where_it_is_projected(page: ViserPage, artefacts: Path) -> None:
    red, _, blue = np.moveaxis(page.picture().astype(int), -1, 0)
    x, y = (round(value) for value in page.project(START))
    assert red[y, x] > blue[y, x] + 50  # orange
    assert abs(red[y + 150, x] - blue[y + 150, x]) < 10  # the background is grey
    assert page.screenshot(artefacts / "bare-app.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.long
def test_page_reconnects_after_a_restart_of_its_server(open_page: OpenPage) -> None:
    with AppServer(BARE_APP) as server:
        page = open_page(server.url, nodes=NODES)
        with page.grip_arrow(MOVE, "z") as grip:
            grip.to(0.05)
            page.wait_until(lambda: page.node_pose(BOX)[2, 3] > START[2], "the box to follow")
            server.kill()
            page.wait_lost()
        assert page.node_pose(BOX)[2, 3] > START[2]  # the last picture stays
        server.restart()
        page.wait_ready(NODES)
        assert page.node_pose(BOX) == pytest.approx(_at(START), abs=1e-9)
        page.drag_arrow(MOVE, "y", -0.05)
        assert page.node_pose(BOX)[1, 3] == pytest.approx(-0.05, abs=1e-3)
        assert page.page.get_by_role("button", name="Reset").count() == 1


def test_missing_parts_are_named(page: ViserPage) -> None:
    with pytest.raises(AssertionError, match="missing: /nowhere"):
        page.wait_ready(["/nowhere"], seconds=0.2)
    with pytest.raises(PlaywrightError, match=r"has no ring z; it has: ring y"):
        page.grip_ring(PITCH, "z")


def test_features_that_playwright_disables_stay_disabled(browser: Browser) -> None:
    session = browser.new_browser_cdp_session()
    command: str = session.send("SystemInfo.getInfo")["commandLine"]
    session.detach()
    lists = [set(each.split(",")) for each in re.findall(r"--disable-features=(\S+)", command)]
    # Chromium takes the last one.
    assert len(lists) >= 2
    assert set().union(*lists) == lists[-1]
