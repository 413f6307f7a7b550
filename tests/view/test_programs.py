"""The panel of programs: its texts, its drawings and its requests."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import viser

from katana450.arm.control.actor import Actor
from katana450.arm.control.session import Session
from katana450.arm.robot.mounted_arm import MountedArm
from katana450.arm.robot.robot import Robot
from katana450.extensions.programs.plan_builder import PlanContext
from katana450.extensions.programs.program import Program, compiled
from katana450.extensions.programs.requests import ProgramOrder
from katana450.extensions.programs.script import parse
from katana450.extensions.programs.script_files import Scripts
from katana450.extensions.programs.server.panel import ProgramsPanel, _page
from katana450.extensions.programs.server.preview import GHOSTS
from katana450.extensions.programs.server.step_list import ListedStep, steps_of
from katana450.extensions.programs.server.step_list import page as step_page
from katana450.extensions.programs.timeline import Timeline
from katana450.maths.kinematics.forward import forward
from katana450.server.api.answers import Progress
from tests.browser.server import free_port
from tests.view.gestures import ANNA, RecordedGestures


class ProgramRunner:
    """A program runner that records requests."""

    def __init__(self) -> None:
        self.progress: Progress | None = None
        self.program: Program | None = None
        self.requests: list[tuple[str, ProgramOrder | None]] = []

    def plan(self, text: str, then: ProgramOrder | None, _actor: Actor) -> None:
        self.requests.append((text, then))

    def steer(self, order: ProgramOrder, _actor: Actor) -> None:
        self.requests.append(("", order))


@pytest.fixture
def server() -> Iterator[viser.ViserServer]:
    server = viser.ViserServer(port=free_port(), verbose=False)
    yield server
    server.stop()


def test_texts_are_escaped_in_markup() -> None:
    page = _page(
        Progress(name="<b>x", by="me", status="refused", why="line 1: <script>\nline 2"), 2
    )
    assert "&lt;b&gt;x" in page
    assert "<script>" not in page
    assert "2 poses" in page
    assert "a while" in _page(Progress(name="", by="me", status="planning"), 0)
    progress = Progress(
        name="x", by="me", status="paused", step=2, steps=3, line=7, task="line", fraction=0.5
    )
    assert "Step 2 of 3, line 7: line, 50%" in _page(progress, 0)
    assert _page(None, 0) == ""


def test_panel_previews_steers_and_teaches(
    server: viser.ViserServer, robot: Robot, arm: MountedArm, session: Session, tmp_path: Path
) -> None:
    program_runner = ProgramRunner()
    state = session.begin(session.ready, 0.0, 0.0)
    panel = ProgramsPanel(
        server, robot, program_runner, Scripts(tmp_path), RecordedGestures(), lambda: state
    )
    # The first choice is for an arm without its gripper.
    assert panel._choice.value == "Circle with gripper"
    panel.follow()
    way = panel._preview._path_line
    assert not way.visible
    plan_context = PlanContext(session, arm.T_base_shoulder)
    text = "tool: tcp\nsteps:\n  - line: {by: {z: 40}}\n"
    program_runner.program = compiled(parse(text), plan_context, state)
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

    for label in ("Add pose", "Add pose", "Save"):
        panel._teach.value = label  # type: ignore[misc]  # as above
        panel._on_teach(ANNA)
    assert len(parse((tmp_path / "My script.yaml").read_text(encoding="utf-8")).steps) == 2
    assert panel._choice.value == "My script"


def marked(panel: ProgramsPanel) -> list[str]:
    """Return the names of the steps that the list marks as current."""
    return re.findall(r"<li aria-current=step><span>(\w+)</span>", panel._list.content)


def test_names_of_steps_are_escaped_in_markup() -> None:
    text = step_page((ListedStep("<b>", 1.25), ListedStep("wait", 0.0)), 1)
    assert "<li><span>&lt;b&gt;</span><span>1.2 s</span></li>" in text
    assert "<li aria-current=step><span>wait</span><span></span></li>" in text
    assert step_page((), None) == ""


def test_preview_shows_the_arm_along_the_path_until_the_program_runs(
    server: viser.ViserServer, robot: Robot, arm: MountedArm, session: Session, tmp_path: Path
) -> None:
    program_runner = ProgramRunner()
    state = session.begin(session.ready, 0.0, 0.0)
    panel = ProgramsPanel(
        server, robot, program_runner, Scripts(tmp_path), RecordedGestures(), lambda: state
    )
    plan_context = PlanContext(session, arm.T_base_shoulder)
    text = "tool: tcp\nsteps:\n  - joints: [40, -60, 80, 10, 0]\n  - line: {by: {z: 40}}\n"
    program = compiled(parse(text), plan_context, state)
    preview = panel._preview

    def ghosts() -> bool:
        return preview._sweep is not None and preview._sweep._root.visible

    def looked_at() -> bool:
        return preview._ghost is not None and preview._ghost.root.visible

    program_runner.program = program
    panel.follow()
    # No preview was requested.
    assert not ghosts()
    panel._orders.value = "Preview"  # type: ignore[misc]  # viser declares it read-only
    panel._order(ANNA)
    program_runner.program = compiled(parse(text), plan_context, state)
    program_runner.progress = Progress(name="x", by="me", status="ready")
    panel.follow()
    assert ghosts()
    assert preview._sweep is not None
    timeline = Timeline.of(program)
    for name, node in preview._sweep._nodes:
        for number, (q, fingers) in enumerate(timeline.postures(GHOSTS)):
            linkage = robot.frames(robot.joint_values(q, fingers))[name]
            assert node.batched_positions[number] == pytest.approx(linkage[:3, 3], abs=1e-6)
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
    assert not ghosts()
    assert not looked_at()
    assert panel._look.disabled
    preview.look(1.0)
    assert not looked_at()
