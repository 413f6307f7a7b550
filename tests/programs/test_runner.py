"""Tests of programs on the real session: planned, followed, paused, stepped and stopped."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.state.scene_objects import SceneObject, Shape
from katana450.extensions.programs.building.actions import ACTION_TIMEOUT, FollowPlan
from katana450.extensions.programs.language.source import ScriptError
from katana450.extensions.programs.run import runner
from katana450.extensions.programs.run.program import Program, compiled
from katana450.extensions.programs.run.runner import Phase, Run
from katana450.extensions.programs.script.script import parse
from katana450.extensions.programs.server.page_state import steps_of
from katana450.maths.kinematics.tool import ToolTarget
from tests.programs.conftest import Stage

SHORT = """\
tool: tcp
frame: base
poses:
  here: {x: 320, y: -40, z: 150, pitch: 50, roll: 0}
steps:
  - move: here
  - line: {by: {y: 60}}
  - gripper: open
  - wait: 0.2
  - arc: {centre: {x: 320, y: 20, z: 130}, axis: y, angle: 40, pitch: 60}
  - arc: {centre: {x: 300, y: 0, z: 150}, axis: z, angle: 10, climb: 20}
  - via: {through: [{joints: [10, -60, 80, 10, 0]}, here]}
"""


@pytest.fixture(scope="module")
def program(stage: Stage) -> Program:
    return stage.planned(SHORT)


def test_the_run_follows_the_script(stage: Stage, program: Program) -> None:
    run, states = stage.play(program, stage.begin())
    assert (run.phase, run.why) == (Phase.DONE, "")
    rests = stage.rests(states)
    assert np.allclose(rests[1], [320, -40, 150], atol=1e-6)
    assert np.allclose(rests[2], [320, 20, 150], atol=1e-6)
    # 40 deg about y, seen from its centre: x = 20 sin 40, z = 20 cos 40.
    turned = [320 + 20 * np.sin(np.radians(40)), 20, 130 + 20 * np.cos(np.radians(40))]
    assert np.allclose(rests[3], turned, atol=1e-6)
    a = np.radians(10.0)
    R = np.array([[np.cos(a), -np.sin(a), 0], [np.sin(a), np.cos(a), 0], [0, 0, 1]])
    centre = np.array([300.0, 0.0, 150.0])
    assert np.allclose(rests[4], centre + R @ (rests[3] - centre) + [0, 0, 20], atol=1e-6)
    assert np.allclose(stage.point(states[-1]), [320, -40, 150], atol=1e-6)
    assert states[-1].gripper == stage.plan_context.arm.gripper.upper


def test_lines_have_rounded_corners_and_end_at_rest(stage: Stage) -> None:
    text = (
        "tool: tcp\nframe: base\nsteps:\n  - move: {x: 320, y: -40, z: 150, pitch: 50, roll: 0}\n"
        "  - lines: {through: [{x: 320, y: 40, z: 150}, {x: 360, y: 40, z: 150, pitch: 60}, "
        "{x: 360, y: 40, z: 190}], blend: 0.4}"
    )
    run, states = stage.play(stage.planned(text), stage.begin())
    assert (run.phase, run.why) == (Phase.DONE, "")
    rests = stage.rests(states)
    assert len(rests) == 2
    assert np.allclose(stage.point(states[-1]), [360, 40, 190], atol=1e-6)
    way = [stage.point(state) for state in states]
    for corner, near in (([320, 40, 150], 8.0), ([360, 40, 150], 8.0)):
        assert 0.5 < min(np.linalg.norm(p - corner) for p in way) < near
    target = ToolTarget.at(stage.plan_context.arm.chain_to("tcp"), states[-1].q)
    assert np.degrees(target.pitch) == pytest.approx(60.0, abs=1e-9)
    assert stage.loads(states).max() <= 1.0 + 1e-6


def test_a_pause_stays_on_the_path_and_does_not_count_as_waiting(
    stage: Stage, program: Program
) -> None:
    whole = stage.play(program, stage.begin())[1]
    state, run = stage.begin(), Run(0.0)
    for _ in range(100):
        run, state = stage.tick(program, run, state)
    state = stage.session.step(state, [cmd.Pause()], state.t + 0.01)
    for _ in range(200):
        run, state = stage.tick(program, run, state)
    assert runner.progress(program, run, state).status == "paused"
    assert state.motion.at_rest
    state = stage.session.step(state, [cmd.Resume()], state.t + 0.01)
    while run.phase is Phase.RUNNING:
        run, state = stage.tick(program, run, state)
    assert run.phase is Phase.DONE
    assert np.array_equal(state.q, whole[-1].q)


@pytest.mark.parametrize("cleared", [pytest.param(False, marks=pytest.mark.long), True])
def test_the_timeout_begins_when_the_path_is_blocked(
    stage: Stage, monkeypatch: pytest.MonkeyPatch, cleared: bool
) -> None:
    timeout = 0.1 * ACTION_TIMEOUT
    monkeypatch.setattr(runner, "ACTION_TIMEOUT", timeout)
    script = parse("steps:\n  - joints: [60, -68, 85, 8, 0]")
    program = compiled(script, stage.plan_context, stage.begin(), speed=0.15)
    T = np.eye(4)
    T[:2, 3] = 0.5 * np.array((np.cos(0.8), np.sin(0.8)))
    wall = SceneObject("wall", Shape.BOX, (0.1, 0.1, 0.5), T)
    state = stage.session.step(stage.begin(), [cmd.PlaceObject(wall)], 0.01)
    run, stood = Run(state.t), 0.0
    while stood < 0.9 * timeout:
        run, state = stage.tick(program, run, state)
        assert run.phase is Phase.RUNNING
        stood += 0.01 * (state.blocked and state.motion.at_rest)
    assert run.waited > 2.0 * timeout
    assert runner.progress(program, run, state).status == "blocked"
    if cleared:
        state = stage.session.step(state, [cmd.Remove("wall")], state.t + 0.01)
    while run.phase is Phase.RUNNING:
        run, state = stage.tick(program, run, state)
    assert run.phase is (Phase.DONE if cleared else Phase.FAILED)
    assert ("and wall would collide" in run.why) is not cleared


def test_steps_are_taken_one_at_a_time(stage: Stage, program: Program) -> None:
    state, run, rests = stage.begin(), Run(0.0, single=True), []
    for _ in range(4000):
        run, state = stage.tick(program, run, state)
        if state.paused and state.motion.at_rest:
            rests.append(program.tasks[run.number].line)
            run = replace(run, single=True)
            state = stage.session.step(state, [cmd.Resume()], state.t + 0.01)
        if run.phase is not Phase.RUNNING:
            break
    assert run.phase is Phase.DONE
    assert rests == [6, 7, 8, 9, 10, 11, 12]


def test_time_left_never_rises_while_a_command_is_on_its_way(
    stage: Stage, program: Program
) -> None:
    state, run = stage.begin(), Run(0.0)
    left = [runner.seconds_left(program, run, state)]
    while run.phase is Phase.RUNNING:
        before = state
        run, state = stage.tick(program, run, state)
        # The state is of before the command, as at a server.
        left.append(runner.seconds_left(program, run, before))
    assert max(b - a for a, b in pairwise(left)) < 1e-6
    # One clock for preview, list and bar. Each task begins a tick after the one before.
    listed = sum(step.seconds for step in steps_of(program))
    assert left[0] == pytest.approx(program.duration) == listed
    assert left[0] == pytest.approx(state.t, abs=0.03 * len(program.tasks))


def test_stop_and_a_person_end_the_run(stage: Stage, program: Program) -> None:
    for end in ("stop", "halt", "elsewhere"):
        state, run = stage.begin(), Run(0.0)
        for _ in range(60):
            run, state = stage.tick(program, run, state)
        assert state.moving
        if end == "stop":
            state = stage.session.step(state, [cmd.Stop()], state.t + 0.01)
        elif end == "elsewhere":
            state = stage.session.step(state, [cmd.GoToZero()], state.t + 0.01)
        else:
            run, commands = runner.stopped(run, "Enough.")
            state = stage.session.step(state, commands, state.t + 0.01)
        for _ in range(300):
            run, state = stage.tick(program, run, state)
        assert run.phase is (Phase.FAILED if end == "elsewhere" else Phase.STOPPED)
        assert run.why
        assert state.motion.at_rest
        assert not (state.q == program.start).all()


def test_an_arm_away_from_the_start_does_not_begin(stage: Stage, program: Program) -> None:
    state = stage.session.begin(stage.session.ready + 0.01, 0.0, 0.0)
    run, states = stage.play(program, state)
    assert run.phase is Phase.FAILED
    assert "start" in run.why
    assert (states[-1].q == state.q).all()


def test_speed_is_a_fraction_of_the_scripts_own(stage: Stage) -> None:
    script = parse("speed: 0.5\nsteps:\n  - joints: [20, -60, 85, 8, 0]")
    fast, slow = (
        compiled(script, stage.plan_context, stage.begin(), speed) for speed in (1.0, 0.5)
    )
    assert (fast.speed, slow.speed) == (0.5, 0.25)
    ticks = [len(stage.play(program, stage.begin())[1]) for program in (fast, slow)]
    assert 1.5 < ticks[1] / ticks[0] < 2.0


@pytest.mark.parametrize(
    ("steps", "line", "said"),
    [
        (
            "  - wait: 1\n  - joints: [0, 0, 0, 0, 500]",
            3,
            r"Axis 5 would be at 500\.0 deg, beyond its limit: its range is -164.5 to 171.5",
        ),
        (
            "  - via: {through: [{joints: [0, 0, 0, 0, 0]}, {joints: [0, 200, 0, 0, 0]}]}",
            2,
            "^.*: Axis 2",
        ),
        ("  - move: {x: 900, y: 0, z: 0}", 2, "cannot be at"),
        ("  - line: {by: {x: 500}}", 2, "reach"),
        ("  - home\n  - line: {by: {z: -285}}", 3, "table"),
        ("  - gripper: 90", 2, "range of the fingers"),
        ("  - tool: hammer", 2, "no tool"),
        ("  - home\n  - line: {by: {y: 0}}", 3, "`line` moves nothing"),
        ("  - arc: {centre: [400, 0, 200], axis: x, angle: 0}", 2, "`arc` moves nothing"),
        ("  - circle: {centre: [900, 0, 0], normal: x, radius: 50}", 2, "reach"),
    ],
)
def test_an_impossible_step_is_refused_with_its_line(
    stage: Stage, steps: str, line: int, said: str
) -> None:
    with pytest.raises(ScriptError, match=said) as refused:
        stage.planned("steps:\n" + steps)
    assert refused.value.problems[0].line == line


def test_repetitions_are_planned_once(stage: Stage) -> None:
    text = (
        "steps:\n  - repeat: {times: 3, steps: [{joints: [20, -60, 85, 8, 0]}, home, "
        "{gripper: open}, {gripper: closed}]}"
    )
    program = stage.planned(text)
    plans = {id(task.action.plan) for task in program.tasks if isinstance(task.action, FollowPlan)}
    # The fingers are neither open nor closed at first, so the first repetition differs.
    assert len(plans) == 4
    assert program.steps == 12
