"""The preview of programs: the path, the arm, the objects and the water at a time; and steps."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import replace
from typing import cast

import numpy as np
import pytest
import viser

from katana450.arm.control.session.session import Session
from katana450.arm.control.state.modes import JointTarget, Positioning
from katana450.arm.control.state.state import State
from katana450.arm.robot.robot import Robot
from katana450.assembly.robot_session import describe_robot
from katana450.extensions.programs.building.plan_state import PlanContext
from katana450.extensions.programs.run import simulation
from katana450.extensions.programs.run.program import Program, compiled
from katana450.extensions.programs.script.script import parse
from katana450.extensions.programs.server.page_state import (
    marks,
    planned_steps,
    steps_of,
)
from katana450.extensions.programs.server.preview import PreviewNodes, ProgramPreview
from katana450.extensions.programs.server.program_runner import ProgramRunner
from katana450.extensions.water import WORTH_SHOWING
from katana450.resources import URDF_PATH
from katana450.server.api.answers import ProgramStep, Progress
from katana450.settings import Settings
from tests.viser_bridge.internals import nodes


class Runner:
    """The part of a program runner that a preview follows."""

    def __init__(self) -> None:
        self.drawn: Program | None = None
        self.begun = self.running = False
        self.look_time = 0.0
        self.show_preview: Callable[[], object] = lambda: None


@pytest.mark.parametrize(
    ("status", "words"),
    [
        ("ready", ["", "", "shown", "", ""]),
        ("running", ["done", "skipped", "now", "next", ""]),
        ("paused", ["done", "skipped", "now", "next", ""]),
        ("stopped", ["done", "skipped", "ended here", "", ""]),
        ("failed", ["done", "skipped", "ended here", "", ""]),
        ("done", ["done", "skipped", "done", "done", "done"]),
    ],
)
def test_list_marks_what_is_done_current_and_next(status: str, words: list[str]) -> None:
    steps = tuple(ProgramStep(name=name, seconds=1.0) for name in "abcde")
    progress = Progress(name="x", by="me", status=status, step=3, steps=5, skipped=(2,))
    assert list(marks(steps, progress, 2.5)) == words
    assert set(marks(steps, progress, 0.0)) <= {*words, ""}


def test_step_that_is_not_expected_is_not_next() -> None:
    then = ProgramStep(name="then: a", seconds=1.0, predicted=False)
    steps = (ProgramStep(name="if", seconds=0.0), then, ProgramStep(name="b", seconds=1.0))
    at_if = Progress(name="x", by="me", status="running", step=1, steps=3)
    assert marks(steps, at_if, 0.0) == ("now", "", "next")


class Stage:
    """The preview of an arm at rest, on a viser server, that follows a runner."""

    def __init__(self, server: viser.ViserServer, robot: Robot, session: Session) -> None:
        self.session, self.state = session, session.begin(session.ready, 0.0, 0.0)
        self.runner = Runner()
        self.preview = PreviewNodes(server, robot, lambda: session)
        runner = cast(ProgramRunner, self.runner)
        self.shown = ProgramPreview(runner, self.preview, lambda: self.state)
        self._T_base_shoulder = robot.require_arm().T_base_shoulder

    def compiled(self, text: str) -> Program:
        """Return the program of the script ``text`` for the arm at rest."""
        context = PlanContext(self.session, self._T_base_shoulder)
        return compiled(parse(text), context, self.state)

    def follow(
        self, program: Program | None, *, has_begun: bool = False, running: bool = False
    ) -> None:
        self.runner.drawn = program
        self.runner.begun, self.runner.running = has_begun, running
        self.shown.follow()

    def shows_path(self) -> bool:
        return bool(self.preview._path_line.visible)

    def shows_ghost(self) -> bool:
        return self.preview._ghost is not None and self.preview._ghost.root.visible


@pytest.fixture
def stage(server: viser.ViserServer, robot: Robot, session: Session) -> Stage:
    return Stage(server, robot, session)


def test_path_is_shown_until_the_arm_is_driven_after_the_run(stage: Stage) -> None:
    path = stage.preview._path_line
    stage.follow(None)
    assert not stage.shows_path()
    program = stage.compiled("tool: tcp\nsteps:\n  - line: {by: {z: 40}}\n")
    stage.follow(program)
    points = np.asarray(path.points).reshape(-1, 3)
    assert np.abs(points[-1] - points[0] - (0.0, 0.0, 0.04)).max() < 1e-6
    assert np.abs(points[:, :2] - points[0, :2]).max() < 1e-6
    stage.follow(program, has_begun=True, running=True)
    stage.follow(program, has_begun=True)
    assert stage.shows_path()
    stage.state = replace(stage.state, mode=Positioning(JointTarget(stage.state.goal)))
    stage.follow(program, has_begun=True)
    assert not stage.shows_path()
    # The same plan is asked for again.
    stage.follow(program)
    assert stage.shows_path()


def simulated() -> None:
    """Wait until the simulation of a preview has ended."""
    for thread in [running for running in threading.enumerate() if running.name == "preview"]:
        thread.join(60.0)


def test_preview_shows_the_arm_along_the_path_until_the_program_runs(stage: Stage) -> None:
    text = "tool: tcp\nsteps:\n  - joints: [40, -60, 80, 10, 0]\n  - line: {by: {z: 40}}\n"
    program = stage.compiled(text)
    setting, first, second = steps_of(program)
    assert [setting.name, first.name, second.name] == ["tool tcp", "joints", "line"]
    assert setting.seconds == 0.0
    assert first.seconds + second.seconds == pytest.approx(program.preview_time)
    assert program.preview_time == program.duration
    planned = planned_steps(
        steps_of(program), Progress(name="x", by="me", status="ready"), first.seconds + 0.01
    )
    assert [step.mark for step in planned] == ["", "", "shown"]

    stage.follow(program)
    # The times are shown in a thread, which shows the newest.
    stage.runner.look_time = 1.0
    stage.runner.show_preview()
    stage.shown._painter.submit(lambda: None).result(30.0)
    simulated()
    assert stage.shows_ghost()
    stage.preview.look(0.0)
    assert not stage.shows_ghost()
    stage.preview.look(1.0)
    assert stage.shows_ghost()
    stage.follow(program, has_begun=True, running=True)
    assert not stage.shows_ghost()
    stage.preview.look(1.0)
    assert not stage.shows_ghost()


POUR = """\
frame: base
steps:
- fill: 200
- grasp: {object: cup, pitch: 30}
- line: {by: {z: 140}}
- pour: {into: basin, shake: 0}
"""


@pytest.mark.long
def test_preview_shows_cup_and_water_at_the_time(
    server: viser.ViserServer, robot: Robot, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(simulation, "TICK", 0.05)
    session = describe_robot(Settings(), URDF_PATH, None).session
    stage = Stage(server, robot, session)
    program = stage.compiled(POUR)
    stage.follow(program)
    stage.preview.look(0.1)
    simulated()
    stage.preview.look(0.0)

    def look(t: float) -> State:
        stage.preview.look(t)
        shown = stage.preview._shown
        assert shown is not None
        moment = shown.at(t)
        assert moment is not None
        return moment

    def ghosts() -> tuple[bool, bool]:
        """Return whether ghosts of the cup and of the water are shown."""
        ghost_nodes = nodes(server)
        shown = [ghost_nodes.get(f"/path/{name}") for name in ("objects/0", "water")]
        cup, water = (node is not None and node.visible for node in shown)
        return cup, water

    assert ghosts() == (False, False)
    carried, emptied = 0.35 * program.duration, 0.97 * program.duration
    look(2.0)
    # Filled, but still in its place.
    assert ghosts() == (False, True)

    def filled() -> tuple[bool, ...]:
        """Return whether water is shown in the cup and in the basin."""
        parts = [nodes(server).get(f"/path/water/{part}") for part in ("vessel0", "basin")]
        return tuple(part is not None and part.visible for part in parts)

    for t in (carried, emptied):
        shown_state = look(t)
        assert ghosts() == (True, True)
        (cup,) = (scene_object for scene_object in shown_state.objects if scene_object.held)
        T = session.environment.pose(cup, shown_state.x)
        assert nodes(server)["/path/objects/0"].position == pytest.approx(T[:3, 3])
        assert shown_state.poured is not None
        water = shown_state.poured.water
        assert filled() == (water.cup.volume >= WORTH_SHOWING, water.basin >= WORTH_SHOWING)
    assert filled() == (False, True)
    look(carried)
    assert filled() == (True, False)
    stage.preview.look(0.0)
    assert ghosts() == (False, False)
    look(carried)
    stage.follow(program, has_begun=True, running=True)
    assert ghosts() == (False, False)
