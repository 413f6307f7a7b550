"""The timeline: what was recorded is shown in one window, and the arm does not move."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from katana450.client import connect
from katana450.extensions.recording.places import recordings_in
from katana450.extensions.recording.playback.run import PlaybackRun
from katana450.maths.geometry.arrays import FloatArray
from katana450.server.api import answers, requests
from tests.browser.conftest import OpenPage
from tests.browser.page import ViserPage
from tests.browser.server import RECORDING_APP, AppServer
from tests.browser.session import Truth

GHOST = "/playback/0/arm"
LINK = "/arm/base_link/arm_base_link/pan_link"
TURNS = (0.5, -0.4)
"""[rad] Angles of axis 1 to which the arm turns, one after the other."""

NOW = "Moment that is shown"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("ring")


@pytest.fixture(scope="module")
def server(folder: Path) -> Iterator[AppServer]:
    """Return a server whose arm has turned twice, and was stopped by Ada in between."""
    with AppServer((*RECORDING_APP, "--record", str(folder))) as server:
        with connect(server.url, "Ada") as arm:
            for angle in TURNS:
                arm.ask(requests.Joints(q=[angle, -1.0, 1.4, 0.3, 0.0]))
                rest(arm)
                if angle is TURNS[0]:
                    arm.stop()
                    time.sleep(1.2)
                    arm.clear_stop()
        yield server


def rest(arm: Any) -> None:
    """Wait until the arm is at rest."""
    deadline = time.monotonic() + 20.0
    time.sleep(0.2)
    while arm.query(answers.State).moving:
        assert time.monotonic() < deadline
        time.sleep(0.05)


def opened(page: ViserPage) -> None:
    """Show the timeline of ``page`` with something on it."""
    page.page.click("#more-button")
    page.press_in_bar("Timeline")
    page.page.wait_for_function("() => Number(document.querySelector('#timeline .now')?.max) > 2")


def shown_turn(page: ViserPage, root: str = GHOST) -> float:
    """Return the angle of axis 1 [rad] of the arm that ``page`` draws below ``root``."""
    T = page.node_pose(f"{root}/base_link/arm_base_link/pan_link")
    zero = page.node_pose(f"{root}/base_link/arm_base_link")
    R: FloatArray = np.linalg.inv(zero[:3, :3]) @ T[:3, :3]
    return float(np.arctan2(R[1, 0], R[0, 0]))


def visible(page: ViserPage, node: str) -> bool:
    """Return whether ``page`` draws ``node``."""
    return bool(
        page.frame.evaluate(
            """(name) => {
                const seen = (each) => each.visible && (!each.parent || seen(each.parent));
                const node = katanaScene.node(name);
                return Boolean(node) && seen(node);
            }""",
            node,
        )
    )


def place(page: ViserPage, value: float) -> None:
    """Move the slider of ``page`` to ``value`` [s], as a person's drag does."""
    page.page.get_by_label(NOW).evaluate(
        "(each, value) => { each.value = value; each.dispatchEvent(new Event('input')); }", value
    )


def test_past_is_shown_in_one_window_until_stop(
    server: AppServer, folder: Path, open_page: OpenPage, artefacts: Path
) -> None:
    page, other = (open_page(server.url, nodes=("/arm",)) for _ in range(2))
    truth = Truth(server)
    before = truth.status()["q"]
    opened(page)
    run = PlaybackRun(lambda: recordings_in(folder))
    run.update()
    slider = page.page.get_by_label(NOW)
    length = float(slider.get_attribute("max") or 0.0)
    assert length == pytest.approx(sum(each.length for each in run.spans), abs=1e-3)
    begin = run.at(run.spans[0].start)
    assert begin is not None

    place(page, 0.0)
    page.wait_until(lambda: visible(page, GHOST), "the recorded arm")
    page.wait_until(lambda: not visible(page, LINK), "the present arm to be hidden")
    page.wait_until(
        lambda: abs(shown_turn(page) - begin.row.q[0]) < 1e-6, "the first recorded posture"
    )
    assert not visible(page, "/target/move"), "the gizmo of the present can be dragged"
    page.page.get_by_text("arm is elsewhere").wait_for()
    assert "Live" not in (slider.get_attribute("aria-valuetext") or "Live")
    page.keep(artefacts / "timeline.png")

    # The arrow keys step by 0.1 s, and Home and End are the ends.
    slider.focus()
    page.page.keyboard.press("Home")
    page.page.keyboard.press("Shift+ArrowRight")
    assert float(slider.input_value()) == pytest.approx(1.0, abs=0.01)
    moment = run.at(run.spans[0].start + 1.0)
    assert moment is not None
    page.wait_until(lambda: abs(shown_turn(page) - moment.row.q[0]) < 1e-6, "the posture 1 s later")
    titles = page.page.locator("#timeline .marks i").evaluate_all(
        "(all) => all.map((e) => e.title)"
    )
    assert any("Ada pressed STOP" in each for each in titles), titles
    assert any("Ada drives" in each for each in titles), titles

    # Nothing of this concerns the arm, or another window.
    assert truth.status()["q"] == before
    assert visible(other, LINK)
    assert not other.frame.evaluate("() => Boolean(katanaScene.node('/playback/0/arm'))")

    # Esc stops the arm, and shows it.
    page.page.keyboard.press("Escape")
    page.wait_until(lambda: visible(page, LINK) and not visible(page, GHOST), "the present")
    assert truth.status()["stopped"] is not None
    assert slider.get_attribute("aria-valuetext") == "Live"
    assert page.errors == []
