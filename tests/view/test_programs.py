"""The panel of programs: its texts, its drawings and its requests."""

from __future__ import annotations

import re
import threading
from pathlib import Path
from typing import cast

import numpy as np
import pytest
import viser

from katana450.arm.control.actor import Actor
from katana450.arm.control.session.session import Session
from katana450.arm.control.state.state import State
from katana450.arm.robot.mounted_arm import MountedArm
from katana450.arm.robot.robot import Robot
from katana450.assembly.robot_session import describe_robot
from katana450.extensions.programs.building.plan_state import PlanContext
from katana450.extensions.programs.run.program import Program, compiled
from katana450.extensions.programs.run.simulation import Timeline
from katana450.extensions.programs.script.script import parse
from katana450.extensions.programs.script.script_files import Scripts, library_file, script_text
from katana450.extensions.programs.server.panel import PanelAccess, ProgramsPanel, _page
from katana450.extensions.programs.server.step_list import ListedStep, marks, steps_of
from katana450.extensions.programs.server.step_list import page as step_page
from katana450.extensions.water import WORTH_SHOWING
from katana450.maths.kinematics.forward import forward
from katana450.resources import URDF_PATH
from katana450.server.api.answers import Progress
from katana450.server.api.program_requests import ProgramOrder
from katana450.settings import Settings
from tests.view.gestures import ANNA, RecordedGestures
from tests.viser_bridge.internals import nodes


class ProgramRunner:
    """A program runner that records requests."""

    def __init__(self) -> None:
        self.progress: Progress | None = None
        self.program: Program | None = None
        self.text = ""
        self.requests: list[tuple[str, ProgramOrder | None]] = []

    def plan(self, text: str, then: ProgramOrder | None, _actor: Actor) -> None:
        self.requests.append((text, then))
        self.text = text

    def steer(self, order: ProgramOrder, _actor: Actor) -> None:
        self.requests.append(("", order))


def test_texts_are_escaped_in_markup() -> None:
    page = _page(Progress(name="<b>x", by="me", status="refused", why="line 1: <script>\nline 2"))
    assert "&lt;b&gt;x" in page
    assert "<script>" not in page
    ready = Progress(name="x", by="me", status="ready", steps=3, seconds=2.51)
    assert "3 steps, about 2.6 s" in _page(ready)


@pytest.mark.parametrize("status", ["planning", "running", "paused", "blocked"])
def test_panel_does_not_repeat_what_the_bar_says(status: str) -> None:
    progress = Progress(name="x", by="me", status=status, step=2, steps=3, task="line")
    assert _page(progress) == _page(None) == ""


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
    steps = tuple(ListedStep(name, 1.0) for name in "abcde")
    progress = Progress(name="x", by="me", status=status, step=3, steps=5, skipped=(2,))
    assert list(marks(steps, progress, 2.5)) == words
    assert set(marks(steps, progress, 0.0)) <= {*words, ""}


def test_step_that_is_not_expected_is_not_next() -> None:
    steps = (ListedStep("if", 0.0), ListedStep("then: a", 1.0, False), ListedStep("b", 1.0))
    at_if = Progress(name="x", by="me", status="running", step=1, steps=3)
    assert marks(steps, at_if, 0.0) == ("now", "", "next")


class Stage:
    """The panel of an arm at rest, on a viser server, with a recording runner."""

    def __init__(
        self, server: viser.ViserServer, robot: Robot, session: Session, scripts: Scripts
    ) -> None:
        self.session, self.state = session, session.begin(session.ready, 0.0, 0.0)
        self.runner = ProgramRunner()
        gestures, access = RecordedGestures(), cast(PanelAccess, self.runner)
        state = self.state
        self.panel = ProgramsPanel(
            server, robot, access, scripts, gestures, lambda: state, lambda: session
        )
        self._T_base_shoulder = robot.require_arm().T_base_shoulder

    def compiled(self, text: str) -> Program:
        """Return the program of the script ``text`` for the arm at rest."""
        context = PlanContext(self.session, self._T_base_shoulder)
        return compiled(parse(text), context, self.state)


@pytest.fixture
def scripts(tmp_path: Path) -> Scripts:
    return Scripts(tmp_path)


@pytest.fixture
def stage(server: viser.ViserServer, robot: Robot, session: Session, scripts: Scripts) -> Stage:
    return Stage(server, robot, session, scripts)


def test_panel_previews_and_steers(stage: Stage) -> None:
    panel, program_runner = stage.panel, stage.runner
    # The first choice is for an arm without its gripper.
    assert panel._choice.value == "Circle with gripper"
    panel.follow()
    way = panel._preview._path_line
    assert not way.visible
    program_runner.program = stage.compiled("tool: tcp\nsteps:\n  - line: {by: {z: 40}}\n")
    panel.follow()
    points = np.asarray(way.points).reshape(-1, 3)
    assert np.abs(points[-1] - points[0] - (0.0, 0.0, 0.04)).max() < 1e-6
    assert np.abs(points[:, :2] - points[0, :2]).max() < 1e-6

    panel._orders.value = "Run"  # type: ignore[misc]  # viser declares it read-only
    panel._order(ANNA)
    program_runner.progress = Progress(name="x", by="me", status="running")
    for label in ("Run", "Step"):
        panel._orders.value = label  # type: ignore[misc]  # as above
        panel._order(ANNA)
    assert [order for _, order in program_runner.requests] == [
        ProgramOrder.RUN, ProgramOrder.RUN, ProgramOrder.STEP
    ]  # fmt: skip
    assert parse(program_runner.requests[0][0]).name == "Circle with gripper"


def marked(panel: ProgramsPanel) -> list[str]:
    """Return the names of the steps that the list marks as current."""
    rows = panel._list.content.split("<li")
    current = [row for row in rows if row.startswith(" aria-current=step>")]
    return [re.findall(r"<span>(\w+)</span>", row)[0] for row in current]


def test_names_of_steps_are_escaped_in_markup() -> None:
    text = step_page((ListedStep("<b>", 1.25), ListedStep("wait", 0.0)), ("done", "now"), (2,))
    first, second = text.split("<li")[1:]
    assert "<span>&lt;b&gt;</span><span>done 1.2 s</span>" in first
    assert "aria-label='Pause before step 1'" in first
    assert "aria-pressed=false" in first
    assert second.startswith(" aria-current=step>")
    assert "<span>wait</span><span>now</span>" in second
    assert "aria-pressed=true" in second
    assert "aria-label='Run from step 2'" in second
    assert step_page((), ()) == ""


def test_preview_shows_the_arm_along_the_path_until_the_program_runs(
    stage: Stage, robot: Robot, arm: MountedArm
) -> None:
    panel, program_runner = stage.panel, stage.runner
    text = "tool: tcp\nsteps:\n  - joints: [40, -60, 80, 10, 0]\n  - line: {by: {z: 40}}\n"
    program = stage.compiled(text)
    preview = panel._preview

    def looked_at() -> bool:
        return preview._ghost is not None and preview._ghost.root.visible

    program_runner.program = program
    panel.follow()
    panel._orders.value = "Preview"  # type: ignore[misc]  # viser declares it read-only
    panel._order(ANNA)
    program_runner.program = stage.compiled(text)
    program_runner.progress = Progress(name="x", by="me", status="ready")
    panel.follow()
    timeline = Timeline.of(program)
    q, fingers = timeline.at(timeline.span)
    tool = arm.T_base_shoulder @ forward(arm.chain_to("tcp"), q)
    assert robot.frames(robot.joint_values(q, fingers))["tcp"] == pytest.approx(tool, abs=1e-9)

    assert timeline.span <= panel._look.max < timeline.span + 0.11
    setting, first, second = steps_of(program)
    assert [setting.name, first.name, second.name] == ["tool tcp", "joints", "line"]
    assert setting.seconds == 0.0
    assert first.seconds + second.seconds == pytest.approx(timeline.span)
    assert marked(panel) == []
    panel._look.value = first.seconds + 0.01  # type: ignore[misc]  # as above
    panel.follow()
    assert marked(panel) == ["line"]
    panel._look.value = 1.0  # type: ignore[misc]  # as above
    preview.look(1.0)
    assert looked_at()
    preview.look(0.0)
    assert not looked_at()
    preview.look(1.0)
    program_runner.progress = Progress(name="x", by="me", status="running", step=2)
    panel.follow()
    assert marked(panel) == ["joints"]
    assert not looked_at()
    assert panel._look.disabled
    preview.look(1.0)
    assert not looked_at()


def test_preview_shows_cup_and_water_at_the_time_in_words(
    server: viser.ViserServer, robot: Robot, scripts: Scripts
) -> None:
    session = describe_robot(Settings(), URDF_PATH, None).session
    stage = Stage(server, robot, session, scripts)
    panel, program_runner = stage.panel, stage.runner
    program = stage.compiled(script_text(library_file("pour")))
    program_runner.program = program
    panel.follow()
    panel._preview.look(0.1)
    for thread in [running for running in threading.enumerate() if running.name == "preview"]:
        thread.join(60.0)
    panel._preview.look(0.0)
    assert panel._seek_time.visible
    assert f"0.0 s of {panel._look.max:.1f} s" in panel._seek_time.content

    def look(t: float) -> State:
        panel._look.value = t  # type: ignore[misc]  # viser declares it read-only
        panel._seek()
        shown = panel._preview._shown
        assert shown is not None
        moment = shown.at(t)
        assert moment is not None
        return moment

    def ghosts() -> tuple[bool, bool]:
        """Return whether ghosts of the cup and of the water are shown."""
        ghost_nodes = nodes(server)
        cup, water = ghost_nodes["/path/objects/0"], ghost_nodes.get("/path/water")
        return cup.visible, water is not None and water.visible

    assert ghosts() == (False, False)
    carried, emptied = 0.35 * program.duration, 0.6 * program.duration
    look(2.0)
    # Filled, but still in its place.
    assert ghosts() == (False, True)

    def filled() -> tuple[bool, ...]:
        """Return whether water is shown in the cup and in the basin."""
        parts = [nodes(server).get(f"/path/water/{part}") for part in ("vessel0", "basin")]
        return tuple(part is not None and part.visible for part in parts)

    for t in (carried, emptied):
        shown_state = look(t)
        assert f"{t:.1f} s of" in panel._seek_time.content
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
    panel._preview.look(0.0)
    assert ghosts() == (False, False)
    look(carried)
    program_runner.progress = Progress(name="x", by="me", status="running", step=2)
    panel.follow()
    assert ghosts() == (False, False)
    assert not panel._seek_time.visible


def test_list_and_drop_down_are_one_program(stage: Stage, scripts: Scripts) -> None:
    panel, runner = stage.panel, stage.runner
    own = panel._choice.value
    # Another person sends a script that is in no folder.
    text = "name: Wave\nsteps:\n  - joints: [40, -60, 80, 10, 0]\n"
    runner.text = text
    runner.program = stage.compiled(text)
    runner.progress = Progress(name="Wave", by="Vera", status="running", step=1, steps=1)
    panel.follow()
    assert (panel._choice.value, panel._choice.disabled) == ("Wave of Vera", True)
    assert "joints" in panel._list.content
    assert "Edit as text" not in panel._edit.content
    runner.progress = Progress(name="Wave", by="Vera", status="done", step=1, steps=1)
    panel.follow()
    assert not panel._choice.disabled
    panel._choice.value = own  # type: ignore[misc]  # as above
    panel.follow()
    assert (panel._list.content, panel._status.content) == ("", "")
    panel._choice.value = "Wave of Vera"  # type: ignore[misc]  # as above
    panel.follow()
    assert "joints" in panel._list.content
    panel._orders.value = "Run"  # type: ignore[misc]  # viser declares it read-only
    panel._order(ANNA)
    assert runner.requests == [(text, ProgramOrder.RUN)]
    # A script of the library is shown by its own name.
    runner.text = scripts.text("Pour")
    panel.follow()
    assert panel._choice.value == "Pour"


def test_list_follows_the_folder(stage: Stage, scripts: Scripts) -> None:
    panel = stage.panel
    chosen = panel._choice.value
    scripts.save("Mine", "steps: [home]")
    panel.follow()
    assert panel._choice.options[0] == "Mine"
    assert panel._choice.value == chosen
