"""The two demos on the page: chosen in the panel, previewed, run, stopped and taken over."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from katana450.arm.robot.mounted_arm import MountedArm
from katana450.client import Client, connect
from katana450.maths.geometry.arrays import FloatArray
from katana450.server.api import answers
from tests.browser.conftest import OpenPage, Windows
from tests.browser.page import ViserPage
from tests.browser.server import AppServer

pytestmark = pytest.mark.long

MOVE = "/target/move"
CIRCLE, POUR = "Circle with gripper", "Pour"
WATER = 200.0
"""Initial amount of water in the cup [ml]."""

LINE = """(name) => {
    let starts = null;
    window.__viserMutable.nodeRefFromName[name].traverse((each) => {
        starts = each.geometry?.attributes?.instanceStart ?? starts;
    });
    return Array.from({length: starts?.count ?? 0}, (_, i) =>
        [starts.getX(i), starts.getY(i), starts.getZ(i)]);
}"""


class Stage:
    """A page with the panel of programs open, and the state of its server."""

    def __init__(self, page: ViserPage, arm: Client) -> None:
        self.page = page
        self.arm = arm
        page.open_tab("Programs")

    def run(self, script: str) -> None:
        self.page.choose("Script", script)
        self.page.click_button("Run")

    def wait(self, until: Callable[[answers.State], bool], seconds: float = 60.0) -> answers.State:
        due = time.monotonic() + seconds
        while not until(state := self.arm.query(answers.State)):
            assert time.monotonic() < due, (state.program, state.water, state.stopped)
            time.sleep(0.01)
        return state

    def wait_for(self, status: str) -> answers.State:
        """Wait until the program has this progress."""
        return self.wait(lambda state: program(state).status == status)

    def shown(self, node: str) -> bool:
        """Return whether the server has made the node visible."""
        sent = self.page.messages("SetSceneNodeVisibilityMessage", node=node, last=1)
        return bool(sent) and bool(sent[0].body["visible"])

    def line(self, node: str) -> FloatArray:
        """Return the first points (N, 3) [m] of the drawn pieces of a line."""
        self.page.wait_drawn()
        return np.array(self.page.frame.evaluate(LINE, node)).reshape(-1, 3)


def program(state: answers.State) -> answers.Progress:
    return state.program or answers.Progress(name="", by="", status="")


def at_rest(stage: Stage) -> FloatArray:
    """Return the joint angles after a check that the arm rests for some time."""
    before = stage.wait(lambda state: not state.moving and max(map(abs, state.qd)) == 0.0)
    time.sleep(0.3)
    after = stage.arm.query(answers.State)
    assert after.q == before.q
    return np.array(after.q)


@pytest.fixture(scope="module")
def stage(windows: Windows) -> Iterator[Stage]:
    with (
        AppServer() as server,
        windows.open(server.url, nodes=("/arm", MOVE)) as page,
        connect(server.url, "Test") as arm,
    ):
        yield Stage(page, arm)
        assert page.errors == []


def test_circle_is_previewed_run_and_traced(stage: Stage, arm: MountedArm, artefacts: Path) -> None:
    page = stage.page
    page.choose("Script", CIRCLE)
    page.click_button("Preview")
    stage.wait_for("ready")
    page.wait_until(lambda: stage.shown("/path/sweep"), "the ghosts")
    q = stage.arm.query(answers.State).q
    page.drag_slider("Look at", 2.0)
    page.wait_until(lambda: stage.shown("/path/ghost"), "the one to be looked at")
    page.screenshot(artefacts / "demo-preview.png")
    assert stage.arm.query(answers.State).q == q

    stage.run(CIRCLE)
    stage.wait_for("running")
    page.wait_until(lambda: stage.shown("/path/traced"), "the traced path", seconds=30.0)
    assert not stage.shown("/path/sweep")
    assert not stage.shown("/path/ghost")
    assert program(stage.wait_for("done")).why == ""
    page.wait_until(lambda: "done" in page.text_of(".k450.program"), "the panel to say so")
    page.screenshot(artefacts / "demo-circle.png")
    centre = arm.T_base_shoulder @ (0.15, 0.0, -0.11, 1.0)
    away = stage.line("/path/traced") - centre[:3]
    assert np.abs(np.linalg.norm(away, axis=1) - 0.1).max() < 1e-5
    assert np.abs(away[:, 0]).max() < 1e-5
    # The whole circle, even if a busy machine draws few frames.
    quarters = np.floor(2.0 / np.pi * np.arctan2(away[:, 2], away[:, 1]))
    assert len(np.unique(quarters)) == 4


def test_the_arm_is_taken_from_a_program(stage: Stage) -> None:
    stage.run(CIRCLE)
    stage.wait(lambda state: program(state).task == "circle" and program(state).fraction > 0.1)
    stage.page.press_in_bar("Take over")
    state = stage.wait_for("stopped")
    assert "taken" in program(state).why
    at_rest(stage)
    assert stage.arm.query(answers.State).holder != program(state).name


def test_water_is_kept_after_a_stop_during_a_pour(stage: Stage, artefacts: Path) -> None:
    def water() -> answers.Water:
        found = stage.arm.query(answers.State).water
        assert found is not None
        parts = found.cup_ml + found.film_ml + found.basin_ml + found.air_ml
        parts += found.spilled_ml
        assert parts == pytest.approx(WATER, abs=1e-9)
        return found

    page = stage.page
    stage.run(POUR)
    stage.wait_for("running")
    stage.wait(
        lambda state: (
            program(state).task == "pour" and state.water is not None and state.water.basin_ml > 2.0
        )
    )
    flowing = water()
    page.press_in_bar("STOP")
    state = stage.wait_for("stopped")
    assert "STOP" in program(state).why
    assert state.stopped is not None
    stopped = at_rest(stage)
    # Water that the tilted cup cannot hold still runs out and lands.
    stage.wait(lambda state: state.water is not None and state.water.air_ml == 0.0)
    time.sleep(0.3)
    after = water()
    assert 2.0 < flowing.basin_ml <= after.basin_ml
    assert 0.0 < after.cup_ml < flowing.cup_ml + 1e-9
    assert after.spilled_ml == 0.0
    page.screenshot(artefacts / "demo-stopped.png")

    page.press_in_bar("Clear stop")
    stage.wait(lambda state: state.stopped is None)
    assert np.array_equal(at_rest(stage), stopped)
    assert water().cup_ml == pytest.approx(after.cup_ml, abs=0.5)
    assert program(stage.arm.query(answers.State)).status == "stopped"


def test_the_whole_pour(open_page: OpenPage, artefacts: Path) -> None:
    with AppServer() as server, connect(server.url, "Test") as arm:
        stage = Stage(open_page(server.url, nodes=("/arm", MOVE)), arm)
        stage.run(POUR)
        stage.wait_for("running")
        least = np.inf
        while program(state := arm.query(answers.State)).status == "running":
            if state.water is not None and state.water.basin_ml + state.water.air_ml == 0.0:
                least = min(least, state.water.margin_to_rim)
            time.sleep(0.02)
        assert (program(state).status, program(state).why) == ("done", "")
        assert state.water is not None
        assert state.water.basin_ml >= 0.99 * WATER
        assert state.water.spilled_ml == 0.0
        # Before the intended pour, the surface reaches the lip from below.
        assert least >= 0.0
        assert state.holder is None
        stage.page.screenshot(artefacts / "demo-poured.png")
        assert stage.page.errors == []
