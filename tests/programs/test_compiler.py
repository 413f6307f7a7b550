"""Tests of planning across steps: arrangements of objects, and the pitch of a grasp."""

from __future__ import annotations

import time

import pytest

from katana450.errors import CancelledError, InputError
from katana450.extensions.programs.building.plan_state import PlanState, UntimedPath
from katana450.extensions.programs.language.source import ScriptError
from katana450.extensions.programs.run.compiler import FINDING, TIMING, Compiler, PlanningStage
from katana450.extensions.programs.script.script import parse
from katana450.maths.planning.checkpoint import checked_by
from tests.programs.conftest import Stage, pour_text

NEAR = (180.0, 315.0)
"""[mm] A place so near the arm that the basin can only be reached at a steep pitch."""


def puts(*spots: tuple[str, tuple[float, float]]) -> str:
    steps = (f"  - put: {{object: {name}, x: {x:g}, y: {y:g}}}" for name, (x, y) in spots)
    return "steps:\n" + "\n".join(steps)


def stood(stage: Stage, name: str) -> tuple[float, float]:
    """Return the initial place of an object [mm]."""
    (scene_object,) = (candidate for candidate in stage.begin().objects if candidate.name == name)
    x, y, _ = (1e3 * scene_object.T[:3, 3]).tolist()
    return x, y


def test_an_object_that_would_overlap_another_is_refused(stage: Stage) -> None:
    text = puts(("cup", stood(stage, "basin")))
    with pytest.raises(ScriptError, match="cup would stand in basin"):
        stage.planned(text)


@pytest.mark.parametrize("name", ["cup", "basin"])
@pytest.mark.parametrize("spot", [(1500.0, 0.0), (300.0, -720.0), (-260.0, 300.0)])
def test_an_object_beyond_the_table_is_refused_before_anything_moves(
    stage: Stage, name: str, spot: tuple[float, float]
) -> None:
    text = puts((name, spot)).replace("steps:\n", "steps:\n  - home\n")
    x, y = spot
    said = rf"line 3.*{name} would be in the air at x {x:.1f}, y {y:.1f} mm: nothing carries it"
    with pytest.raises(ScriptError, match=said) as refused:
        stage.planned(text)
    assert "from x -250 to 750 and from y -700 to 700 mm" in str(refused.value)


def test_an_object_at_the_edge_of_the_table_is_carried(stage: Stage) -> None:
    program = stage.planned(puts(("cup", (740.0, 690.0))))
    _, states = stage.play(program, stage.begin())
    places = {scene_object.name: 1e3 * scene_object.T[:2, 3] for scene_object in states[-1].objects}
    assert places["cup"] == pytest.approx((740.0, 690.0))


def test_a_repeated_step_is_planned_again_after_objects_have_moved(stage: Stage) -> None:
    """The second time, the basin stands on the arm's first path."""
    once = (
        "frame: base\ntool: tcp\nsteps:\n  - repeat:\n      times: 1\n      steps:\n"
        "        - move: {x: 360, y: 0, z: 60, pitch: 60}\n        - home\n"
        "        - put: {object: cup, x: 0, y: -400}\n"
        "        - put: {object: basin, x: 420, y: 0}\n"
    )
    assert stage.planned(once).steps == 5
    with pytest.raises(ScriptError, match=r"line 7.* and basin would overlap by .* are required"):
        stage.planned(once.replace("times: 1", "times: 2"))


LINES = "tool: tcp\nsteps:\n  - line: {by: {z: 20}}\n  - line: {by: {y: 20}}\n  - home\n"


def test_planning_reports_each_step_of_both_phases(stage: Stage) -> None:
    stages: list[PlanningStage] = []
    stage.planned(LINES, report=stages.append)
    phases = [(phase, step) for phase in (FINDING, TIMING) for step in range(1, 5)]
    assert [(stage_report.phase, stage_report.step) for stage_report in stages] == phases
    fractions = [stage_report.fraction for stage_report in stages]
    assert fractions[0] == pytest.approx(0.0)
    assert fractions == sorted(fractions)
    assert fractions[-1] < 1.0


def test_planning_ends_at_the_next_checkpoint(stage: Stage) -> None:
    """Each phase is cancelled in its middle; the longest gap between checkpoints is short."""
    for phase in (FINDING, TIMING):
        reached: list[PlanningStage] = []

        def check() -> None:
            if any(progress == (phase, 3, 4) for progress in reached):  # noqa: B023
                raise CancelledError("enough")

        with pytest.raises(CancelledError, match="enough"), checked_by(check):
            stage.planned(LINES, report=reached.append)
        assert reached[-1] == (phase, 3, 4)
    gaps: list[float] = []
    start = time.thread_time()

    def measure() -> None:
        nonlocal start
        now = time.thread_time()
        gaps.append(now - start)
        start = now

    with checked_by(measure):
        stage.planned(pour_text())
    assert len(gaps) > 1000
    assert max(gaps) < 0.25


def test_a_refused_attempt_leaves_no_trace_in_the_plan(stage: Stage) -> None:
    begin = PlanState(stage.plan_context, stage.begin())
    turned = begin.q + 0.1

    def attempt(plan: PlanState, option: str) -> PlanState:
        after = plan.move_to(turned, option)
        if option == "refused":
            raise InputError("not this way")
        assert plan.is_brief
        return after

    plan = begin.first(("refused", "taken"), attempt)
    assert [name for name, _ in plan.actions] == ["taken"]
    assert plan.q == pytest.approx(turned)
    assert not plan.is_brief
    assert begin.actions == ()
    with pytest.raises(InputError, match="not this way"):
        begin.first(("refused", "refused"), attempt)


@pytest.fixture
def untimed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Replace the timing of paths, whose duration does not matter here."""
    monkeypatch.setattr(UntimedPath, "timed", lambda self: self)


def layout(stage: Stage, text: str) -> Compiler:
    return Compiler(parse(text), PlanState(stage.plan_context, stage.begin()))


@pytest.mark.usefixtures("untimed")
def test_the_next_pitch_is_tried_if_the_first_does_not_reach_the_basin(stage: Stage) -> None:
    names = [task.name for task in layout(stage, pour_text(basin=NEAR)).tasks()]
    # Failed attempts leave no actions behind.
    assert names.count("grasp cup: close") == 1
    assert names.count("pour") == 1


@pytest.mark.usefixtures("untimed")
def test_the_pitch_that_a_script_gives_is_kept(stage: Stage) -> None:
    text = pour_text(basin=NEAR).replace("grasp: cup", "grasp: {object: cup, pitch: 30}")
    with pytest.raises(InputError, match="cannot be emptied into basin"):
        layout(stage, text).tasks()
