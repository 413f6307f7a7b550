"""The app in a real browser: actions with the mouse, and the messages that the browser gets."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from katana450.arm.control.state.state import Status
from katana450.arm.robot.loader import load
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.forward import forward
from katana450.server.view.view import GHOST_COLOURS
from tests.browser.page import ViserPage
from tests.browser.session import AXES, Truth, go_home

MOVE = "/target/move"

# A dragged handle is within a pixel of its target: 1 mm at this distance.
PIXEL = 2e-3

FINGERTIP = 80.0
"""Maximum distance [px] of the tip of a finger from the tool point."""


class Robot:
    """The arm as a page shows it and as the messages describe it.

    Attributes:
        since: only messages from this time on count, because another server may have sent before.
    """

    def __init__(self, page: ViserPage) -> None:
        self.page = page
        self.since = 0.0
        described = load()
        self._arm = described.require_arm()
        self.path: dict[str, str] = {}
        for link in described.links:
            above = "/arm" if link.parent is None else self.path[link.parent]
            self.path[link.name] = f"{above}/{link.name}"

    @property
    def q(self) -> FloatArray:
        """Joint angles [rad] that the sliders show."""
        shown = self.page.slider_values()
        return np.radians([shown[label] for label in AXES])

    def reported(self, tool: str = "tcp") -> FloatArray:
        """Return the tool's pose in the base frame, computed from the sliders."""
        return self._arm.T_base_shoulder @ forward(self._arm.chain_to(tool), self.q)

    def sent(self, link: str = "tcp") -> FloatArray:
        """Return the link's pose in the base frame, composed of the poses in messages."""
        parts = self.path[link].split("/")
        T = np.eye(4)
        for end in range(3, len(parts) + 1):
            T = T @ self.page.last_pose("/".join(parts[:end]), since=self.since)
        return T

    def drawn(self, link: str = "tcp") -> FloatArray:
        """Return the link's pose in the base frame as drawn by three.js."""
        return np.array(self.page.node_pose(self.path[link]))

    def gizmo(self) -> FloatArray:
        """Return the drawn position (3,) [m] of the gizmo in the base frame."""
        return np.array(self.page.node_pose(MOVE)[:3, 3])

    def settle(self) -> None:
        """Wait until the arm has the angles of the sliders, and check that all poses agree."""

        def arrived() -> bool:
            return np.allclose(self.sent(), self.reported(), atol=1e-6)

        def rests() -> bool:
            if "Moving" in self.text() or not arrived():
                return False
            # The last action of the mouse may still be in transit to the arm.
            before = self.q
            return np.array_equal(before, self.page.settled(lambda: self.q, "it")) and arrived()

        self.page.wait_until(rests, "the arm to arrive at the angles of the sliders", seconds=30.0)
        self.page.wait_drawn()
        assert np.allclose(self.drawn(), self.reported(), atol=1e-5)
        assert np.allclose(self.gizmo(), self.reported()[:3, 3], atol=1e-5)

    def text(self) -> str:
        """Return the status and its sentence."""
        return self.page.page.inner_text("#mode")


@pytest.fixture
def robot(page: ViserPage) -> Robot:
    """Return a window of the running app, with the arm in the ready posture."""
    return Robot(page)


def pitch_of(T: FloatArray) -> float:
    return math.asin(-T[2, 0])


def test_arm_follows_the_dragged_arrow(robot: Robot, artefacts: Path) -> None:
    start = robot.drawn()
    robot.page.drag_arrow(MOVE, "z", 0.06)
    robot.settle()
    end = robot.drawn()
    assert end[:3, 3] - start[:3, 3] == pytest.approx([0.0, 0.0, 0.06], abs=PIXEL)
    assert pitch_of(end) == pytest.approx(pitch_of(start), abs=1e-6)
    assert "On target" in robot.text()
    robot.page.keep(artefacts / "app-arrow.png")


@pytest.mark.long
def test_target_out_of_reach_is_shown_by_ghost_colour_and_sentence(
    robot: Robot, truth: Truth, artefacts: Path
) -> None:
    page = robot.page
    with page.grip_arrow(MOVE, "x") as grip:
        grip.sweep(0.4, 8)

        def explained() -> bool:
            gap = float(np.linalg.norm(robot.gizmo() - robot.drawn()[:3, 3]))
            return f"{1e3 * gap:.0f} mm out of reach" in robot.text()

        page.wait_until(explained, "the distance of the arm from the handle")
        page.keep(artefacts / "app-out-of-reach.png")
    # After the release the handle returns to the tool, and the reason remains.
    page.wait_until(
        lambda: np.allclose(robot.gizmo(), robot.drawn()[:3, 3], atol=1e-5), "the handle to return"
    )
    assert "out of reach" in robot.text()
    colours = [
        tuple(m.body["updates"]["color"])
        for m in page.messages("SceneNodeUpdateMessage")
        if m.body["name"].startswith("/ghost") and "color" in m.body["updates"]
    ]
    assert GHOST_COLOURS[Status.LIMITED] in colours
    assert ghost_is_shown(robot)
    # At the goal the reason and the ghost disappear.
    go_home(page, truth)
    page.wait_until(lambda: not ghost_is_shown(robot), "the ghost to go")
    page.wait_until(lambda: "On target" in robot.text(), "the reason to go")


def ghost_is_shown(robot: Robot) -> bool:
    (last,) = robot.page.messages("SetSceneNodeVisibilityMessage", node="/ghost", last=1)
    return bool(last.body["visible"])


@pytest.mark.long
def test_arm_stops_before_the_table_with_reason_and_distance(
    robot: Robot, truth: Truth, artefacts: Path
) -> None:
    page = robot.page
    length = page.page.locator("#clearance-label")
    assert not length.is_visible()
    page.drag_slider("2 shoulder", 5.0)
    page.wait_until(lambda: "mm apart" in robot.text(), "the reason", seconds=20.0)
    assert "finger and table" in robot.text()
    truth.wait(20.0, moving=False)
    distance = 1e3 * truth.status()["margins"]["clearance"]
    page.wait_until(lambda: length.inner_text() == f"{distance:.1f} mm", f"{distance:.1f} mm")
    tool = page.project(robot.drawn()[:3, 3])
    boxes = [point.bounding_box() for point in page.page.locator("#clearance circle").all()]
    (x, y), (x_table, y_table) = (
        (box["x"] + box["width"] / 2, box["y"] + box["height"] / 2) for box in boxes if box
    )
    assert math.dist((x, y), tool) < FINGERTIP
    # The nearest point of the table is straight below that of the finger.
    assert x_table == pytest.approx(x, abs=2.0)
    assert 2.0 < y_table - y < 20.0
    page.keep(artefacts / "app-contact.png")
    go_home(page, truth)
    page.wait_until(lambda: "On target" in robot.text(), "the reason to go")
    page.wait_until(lambda: not length.is_visible(), "the line to go")


@pytest.mark.long
def test_typed_pose_reports_the_impossible_yaw(robot: Robot) -> None:
    page = robot.page
    for label, values in (("x, y, z", (350.0, 0.0, 0.0)), ("r, p, y", (0.0, 30.0, 23.0))):
        for index, value in enumerate(values):
            page.type_number(label, value, index=index)
    page.click_button("Go to pose")
    page.wait_until(lambda: "yaw is fixed by position" in robot.text(), "the reason")
    robot.settle()
    assert robot.drawn()[:3, 3] == pytest.approx([0.35, 0.0, 0.2745], abs=1e-6)
    # The tool's x axis leaves the arm's plane by asin(cos 30 sin 23).
    off = math.degrees(math.asin(math.cos(math.radians(30.0)) * math.sin(math.radians(23.0))))
    assert f"{off:.0f}° off" in robot.text()
