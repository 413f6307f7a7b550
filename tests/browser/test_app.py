"""The app in a real browser: actions with the mouse, and the messages that the browser gets."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from katana450.arm.control.state import Status
from katana450.arm.robot.loader import load
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.forward import forward
from katana450.server.view.view import GHOST_COLOURS
from katana450.settings import Settings
from tests.browser.conftest import OpenPage, Windows
from tests.browser.page import ViserPage
from tests.browser.server import AppServer
from tests.browser.session import AXES

READY = np.array(Settings().ready)
MOVE, PITCH, ROLL = "/target/move", "/target/move/pitch", "/target/move/roll"

ON_ITS_WAY = 600.0  # ms; more than a loaded machine takes from the mouse to a slider
# A dragged handle is within a pixel of its target: 1 mm at this distance.
PIXEL = 2e-3


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
            self.page.page.wait_for_timeout(ON_ITS_WAY)
            return np.array_equal(before, self.q) and arrived()

        self.page.wait_until(rests, "the arm to arrive at the angles of the sliders", seconds=30.0)
        self.page.wait_drawn()
        assert np.allclose(self.drawn(), self.reported(), atol=1e-5)
        assert np.allclose(self.gizmo(), self.reported()[:3, 3], atol=1e-5)

    def text(self) -> str:
        """Return the status and its sentence."""
        return self.page.page.inner_text("#mode")


@pytest.fixture(scope="module")
def window(server: AppServer, windows: Windows) -> Iterator[Robot]:
    with windows.open(server.url, nodes=("/arm", MOVE)) as page:
        yield Robot(page)


@pytest.fixture
def robot(window: Robot) -> Iterator[Robot]:
    """Return a window of the running app, with the arm in the ready posture."""
    go_home(window)
    yield window
    assert window.page.errors == []


def go_home(robot: Robot) -> None:
    def there() -> bool:
        # On an overloaded machine the arm stops, as it should.
        if robot.page.page.get_attribute("body", "data-mood") == "stopped":
            robot.page.press_in_bar("Clear stop")
            robot.page.page.wait_for_timeout(500)
            robot.page.click_button("Home")
        return np.allclose(robot.q, READY, atol=1e-6)

    robot.page.click_button("Home")
    robot.page.wait_until(there, "the sliders at home", seconds=30.0)
    robot.settle()


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
def test_the_pitch_ring_turns_the_tool_about_its_point(robot: Robot, artefacts: Path) -> None:
    start = robot.drawn()
    robot.page.drag_ring(PITCH, "y", 0.25)
    robot.settle()
    end = robot.drawn()
    assert end[:3, 3] == pytest.approx(start[:3, 3], abs=1e-6)
    assert pitch_of(end) - pitch_of(start) == pytest.approx(0.25, abs=0.01)
    robot.page.keep(artefacts / "app-pitch.png")


@pytest.mark.long
def test_the_roll_ring_turns_the_tool_about_itself(robot: Robot) -> None:
    start = robot.drawn()
    before = robot.q
    robot.page.drag_ring(ROLL, "x", -0.5)
    robot.settle()
    assert robot.drawn()[:3, 3] == pytest.approx(start[:3, 3], abs=1e-6)
    assert robot.drawn()[:3, 0] == pytest.approx(start[:3, 0], abs=1e-6)
    turned = robot.q - before
    assert turned[:4] == pytest.approx(np.zeros(4), abs=1e-6)
    assert turned[4] == pytest.approx(-0.5, abs=0.01)


@pytest.mark.long
def test_the_gripper_slider_moves_both_fingers(robot: Robot) -> None:
    robot.page.drag_slider("Gripper", 0.0)
    closed = [finger_turn(robot, name) for name in ("finger_right_link", "finger_left_link")]
    robot.page.drag_slider("Gripper", 100.0)
    opened = [finger_turn(robot, name) for name in ("finger_right_link", "finger_left_link")]
    assert closed[0] == pytest.approx(-closed[1], abs=1e-6)
    assert opened[0] == pytest.approx(-opened[1], abs=1e-6)
    assert abs(opened[0] - closed[0]) == pytest.approx(0.74, abs=0.03)


def finger_turn(robot: Robot, link: str) -> float:
    """Return the finger's angle about z [rad] as sent last, after it has come to rest."""
    seen: list[float] = []

    def resting() -> bool:
        R = robot.page.last_pose(robot.path[link])[:3, :3]
        seen.append(math.atan2(R[1, 0], R[0, 0]))
        return len(seen) > 10 and seen[-1] == seen[-10]

    robot.page.wait_until(resting, f"{link} to come to rest")
    return seen[-1]


def test_target_out_of_reach_is_shown_by_ghost_colour_and_sentence(
    robot: Robot, artefacts: Path
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
    go_home(robot)
    page.wait_until(lambda: not ghost_is_shown(robot), "the ghost to go")
    assert "On target" in robot.text()


def ghost_is_shown(robot: Robot) -> bool:
    (last,) = robot.page.messages("SetSceneNodeVisibilityMessage", node="/ghost", last=1)
    return bool(last.body["visible"])


def test_arm_stops_before_the_table_with_reason_and_warning_colour(
    robot: Robot, artefacts: Path
) -> None:
    robot.page.drag_slider("2 shoulder", 5.0)
    robot.page.wait_until(lambda: "mm apart" in robot.text(), "the reason", seconds=20.0)
    reason = robot.text()
    assert "finger and table" in reason
    coats = [f"{robot.path[f'finger_{side}_link']}/contact0" for side in ("left", "right")]

    def shown() -> list[str]:
        return [
            each
            for each in coats
            if not robot.page.frame.evaluate("(name) => harness.missing([name])", each)
        ]

    seen: list[str] = []

    def appeared() -> bool:
        seen.extend(shown())
        return bool(seen)

    # Which finger is nearer can change again at once.
    robot.page.wait_until(appeared, "the warning colour")
    coat = seen[0]
    robot.page.wait_drawn()
    robot.page.keep(artefacts / "app-contact.png")
    go_home(robot)
    robot.page.wait_until(lambda: "On target" in robot.text(), "the reason to go")
    (last,) = robot.page.messages("SetSceneNodeVisibilityMessage", node=coat, last=1)
    assert not last.body["visible"]


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


@pytest.mark.long
def test_browsers_show_the_same_arm_and_drive_it_in_turn(
    robot: Robot, server: AppServer, open_page: OpenPage
) -> None:
    other = Robot(open_page(server.url, nodes=("/arm", MOVE)))
    robot.page.drag_slider("1 base turn", -50.0)
    robot.settle()
    other.settle()
    assert np.allclose(other.drawn(), robot.drawn(), atol=1e-9)
    # A person without the lease moves nothing, and the handle returns.
    other.page.drag_arrow(MOVE, "z", 0.05)
    other.page.wait_until(
        lambda: np.allclose(other.gizmo(), robot.gizmo(), atol=1e-5), "the handle to come back"
    )
    other.settle()
    robot.page.press_in_bar("Release")
    other.page.drag_arrow(MOVE, "z", 0.05)
    other.settle()
    robot.settle()
    other.page.press_in_bar("Release")
    assert np.allclose(other.drawn(), robot.drawn(), atol=1e-9)
    assert other.page.errors == []


def come_back(robot: Robot, server: AppServer) -> None:
    """Restart the server, wait for the page, and check that the old motion has ended."""
    robot.page.wait_lost()
    robot.since = time.time()
    server.restart()
    robot.page.wait_until(lambda: robot.page.connected, "the page to come back", seconds=20.0)
    robot.page.wait_ready(("/arm", MOVE))
    robot.page.wait_until(lambda: np.allclose(robot.q, READY, atol=1e-6), "the sliders at home")
    robot.settle()


@pytest.mark.long
def test_app_killed_during_a_drag_restarts_at_rest(open_page: OpenPage) -> None:
    with AppServer() as server:
        robot = Robot(open_page(server.url, nodes=("/arm", MOVE)))
        robot.page.drag_slider("1 base turn", 70.0)
        robot.settle()
        with robot.page.grip_arrow(MOVE, "z") as grip:
            grip.sweep(0.05, 4)
            server.kill()
            robot.page.wait_lost()
        come_back(robot, server)
        assert robot.page.frame.get_by_role("slider").count() == len(AXES) + 1
        robot.page.drag_arrow(MOVE, "z", 0.05)
        robot.settle()
