"""Tests of the script parser and of its error messages."""

from __future__ import annotations

import math

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from katana450.extensions.programs.language.scope import StepTarget
from katana450.extensions.programs.language.source import MAX_BYTES, MAX_DEPTH, Problem, ScriptError
from katana450.extensions.programs.script.script import MAX_STEPS, parse
from katana450.extensions.programs.steps.moves import Circle, Line, Move
from tests.conftest import LONG

GOOD = """\
name: Try
frame: base
tool: tcp
speed: 0.5
poses:
  up: {x: 300, y: 0, z: 200, pitch: 45}
  same: up
  folded: {joints: [0, -68, 85, 8, 0]}
steps:
  - home
  - move: up
  - repeat:
      times: 3
      steps:
        - line: {by: {z: -50}, pitch: 60}
        - wait: 0.5
  - circle: {centre: [150, 0, -110], normal: -x, radius: 100, pitch: roomiest}
"""


def test_numbers_are_read_in_degrees_and_millimetres() -> None:
    script = parse(GOOD)
    assert (script.name, script.speed, script.bare) == ("Try", 0.5, False)
    assert len(script.steps) == 1 + 2 + 3 * 2 + 1
    move, line, circle = (script.steps[i].step for i in (2, 3, -1))
    assert isinstance(move, Move)
    assert isinstance(move.to, StepTarget)
    assert move.to.position is not None
    assert move.to.position.tolist() == [0.3, 0.0, 0.2]
    assert move.to.angles.pitch == math.radians(45.0)
    assert move.to.in_base
    assert isinstance(line, Line)
    assert line.by is not None
    assert line.by.tolist() == [0.0, 0.0, -0.05]
    assert isinstance(circle, Circle)
    assert circle.axis.tolist() == [-1.0, 0.0, 0.0]
    assert [placed.line for placed in script.steps[1:4]] == [10, 11, 15]


@pytest.mark.parametrize(
    ("wrong", "line", "said"),
    [
        ("steps: []", 1, "list of steps"),
        ("", 1, "empty"),
        ("just words", 1, "mapping of names to values"),
        ("steps:\n  - fly: 3", 2, "no step 'fly'"),
        ("steps:\n  - hme", 2, "did you mean 'home'"),
        ("steps:\n  - home: 3", 2, "takes no value"),
        ("steps:\n  - wait: .nan", 2, "number"),
        ("steps:\n  - wait: nan", 2, "number"),
        ("steps:\n  - wait: -1", 2, "not between"),
        ("steps:\n  - wait: yes", 2, "number"),
        ("steps:\n  - joints: [1, 2]", 2, "list of 3 to 32"),
        ("steps:\n  - joints: [1, 2, 3, 4, x]", 2, "'x'"),
        ("steps:\n  - line: {to: {x: 1, y: 2}}", 2, "needs 'z'"),
        ("steps:\n  - line: {to: [1, 2, 3], by: [1, 2, 3]}", 2, "`to` or `by`, not both"),
        ("steps:\n  - lines: {through: [[1, 2, 3]]}", 2, "list of 2 to 50"),
        ("steps:\n  - trajectory: {}", 2, "`trajectory` needs 'through'"),
        ("steps:\n  - circle:\n      turns: 0\n      radius: x", 3, "`turns` must not be 0"),
        ("steps:\n  - line: {too: 3, to: [1, 2, 3]}", 2, "has no 'too'; did you mean 'to'?"),
        (
            "steps:\n  - lines: {through: [{x: 1, y: 2, z: 3}, {joints: [1, 2, 3, 4, 5]}]}",
            2,
            "`via`",
        ),
        ("steps:\n  - arc:\n      axis: x\n      angle: 20", 3, "needs 'centre'"),
        ("steps:\n  - arc: {centre: [1, 2, 3], axis: [0, 0, 0], angle: 3}", 2, "must not be zero"),
        ("steps:\n  - move: nowhere", 2, "no pose 'nowhere'"),
        ("steps:\n  - {home: , wait: 1}", 2, "one name"),
        ("steps:\n  - repeat: {times: 1001, steps: [home]}", 2, "not between"),
        ("steps:\n  - repeat: {times: 0.5, steps: [home]}", 2, "not between"),
        ("steps: [home]\nsteps: [home]", 2, "given twice"),
        ("steps: [home]\nspeeed: 1", 2, "did you mean 'speed'"),
        ("a: &x 1\nsteps: [home]", 1, "Anchors"),
        ("steps: !!python/object:os.system [home]", 1, "Tags"),
        ("steps: [home", 1, "A comma or ] is missing in a list"),
        ("steps:\n- move: {x: 1, y: 2\n- home\n", 2, "A comma or } is missing in a mapping"),
        ("steps:\n\t- home", 2, "Indent with blanks"),
        ("steps: [home]\n\x07", 2, "character U+0007 is not allowed"),
        ("steps:\n- move: @a", 2, "Put the text in quotes"),
        ("name: a: b\nsteps: [home]", 1, "A colon cannot stand here"),
        ("frame: base\nname\nsteps: [home]", 2, "A colon and a blank are missing"),
        ("steps: - home", 1, "on a line of its own"),
        ("steps:\n  - home\n - home", 3, "indented differently"),
        ("steps: [home]]", 1, "This ] closes nothing"),
        ("steps: [home]\n}", 2, "This } closes nothing"),
        ("name: 'it's'\nsteps: [home]", 1, "behind the end of a value"),
        ('name: "abc\nsteps: [home]\n', 1, "A quote has no end"),
        ('name: "a\\q"\nsteps: [home]', 1, "single quotes"),
        ("steps: [,]", 1, "A value is missing here"),
        ("name: x\n---\nsteps: [home]", 2, "Remove the line `---`"),
        ("steps:\n- joints: [0, 1.57, -0.3, 0.4, 0]", 2, "1.57 looks like radians"),
        ("steps:\n- nudge: {axis: 1, by: -0.7854}", 2, "`-0.7854 rad`, or `-0.7854 deg`"),
        ("steps:\n- move: {x: 1, y: 2, z: 3, pitch: pi / 2}", 2, "`(pi / 2) * 1 rad`"),
        ("steps: [home]\nexpect: {speed: 1}", 2, "no 'speed'"),
    ],
)
def test_error_is_reported_with_its_line(wrong: str, line: int, said: str) -> None:
    with pytest.raises(ScriptError, match="line") as refused:
        parse(wrong)
    assert said in str(refused.value)
    assert any(problem.line == line for problem in refused.value.problems), str(refused.value)


@pytest.mark.parametrize(
    "step",
    [
        "joints: [0, 90, 1.571, 0, 0]",
        "joints: [0, 1.57 rad, 0, 0, 0]",
        "joints: [0.1, 0.52, 0, 0, 0]",
        "nudge: {axis: 1, by: 1.57 deg}",
        "nudge: {axis: 1, by: 1.6}",
        "trajectory: {through: [[0, 1.571, 0, 0], [1, 0, 1.571, 0]]}",
    ],
)
def test_angles_that_are_surely_meant_are_not_asked_about(step: str) -> None:
    assert len(parse(f"steps:\n- {step}\n").steps) == 1


def test_all_errors_are_reported_together() -> None:
    with pytest.raises(ScriptError) as refused:
        parse("speed: 3\nframe: moon\nsteps:\n  - wait: x\n  - line: {too: 1}\n  - home\n  - fly")
    assert [problem.line for problem in refused.value.problems] == [1, 2, 4, 5, 7]


def test_size_depth_and_repetitions_are_bounded() -> None:
    with pytest.raises(ScriptError, match="at most 64 KB"):
        parse("steps: [home]\n#" + "x" * MAX_BYTES)
    with pytest.raises(ScriptError, match="levels deep"):
        parse("steps: " + "[" * 5000)
    nested = "home"
    for _ in range(MAX_DEPTH // 3):
        nested = f"{{repeat: {{times: 99, steps: [{nested}]}}}}"
    with pytest.raises(ScriptError, match=f"at most {MAX_STEPS}|levels deep"):
        parse(f"steps: [{nested}]")
    many = "steps:\n" + "  - home\n" * (MAX_STEPS + 1)
    with pytest.raises(ScriptError, match=f"at most {MAX_STEPS}"):
        parse(many)


def wrong_with(text: str) -> tuple[Problem, ...]:
    """Return the problems of a text, none if it is valid; any other exception fails the test."""
    try:
        script = parse(text)
    except ScriptError as error:
        return error.problems
    # A valid script has at least one step.
    return () if script.steps else (Problem(0, 0, "no steps"),)


@settings(max_examples=80 if LONG else 30)
@given(st.text(max_size=200) | st.text("steps:-[]{},&*!|>'\"# \n\t12xyhome", max_size=80))
@example("steps: *a")
@example("? - [\n")
@example("\ud800")
@example("%YAML 3.0\n---\nsteps: [home]")
@example("steps: [home]\n---\nsteps: [home]")
def test_any_text_is_read_or_refused(text: str) -> None:
    assert all(problem.line >= 1 for problem in wrong_with(text))
