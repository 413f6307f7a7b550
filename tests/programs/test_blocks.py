"""Test the names and loops of scripts, and their error messages."""

from __future__ import annotations

import pytest

from katana450.extensions.programs.language.scope import StepTarget
from katana450.extensions.programs.language.source import ScriptError
from katana450.extensions.programs.script.script import MAX_STEPS, Script, parse
from katana450.extensions.programs.steps.moves import Line, Move
from katana450.extensions.programs.steps.place import Pick
from katana450.extensions.programs.steps.settings_steps import TimedPause

HEAD = """\
let:
  side: 4 cm
  half: side / 2
  corner: {x: 300, y: half, z: 0.2 m}
poses:
  start: {x: corner.x, y: -corner.y, z: corner.z + side, pitch: 0.5 rad}
"""


def waits(script: Script) -> list[float]:
    """Return the durations of the waits of ``script`` [s]."""
    return [parsed.step.seconds for parsed in script.steps if isinstance(parsed.step, TimedPause)]


def test_names_and_units_stand_wherever_a_number_stands() -> None:
    script = parse(f"{HEAD}steps:\n  - move: start\n  - line: {{by: [0, half, -1 cm]}}\n")
    move, line = (parsed.step for parsed in script.steps)
    assert isinstance(move, Move)
    assert isinstance(move.to, StepTarget)
    assert move.to.position is not None
    assert move.to.position.tolist() == pytest.approx([0.3, -0.02, 0.24])
    assert move.to.angles.pitch == pytest.approx(0.5)
    assert isinstance(line, Line)
    assert line.by is not None
    assert line.by.tolist() == pytest.approx([0.0, 0.02, -0.01])


def test_name_of_a_point_stands_wherever_a_point_stands() -> None:
    script = parse(f"{HEAD}steps:\n  - move: corner\n  - line: {{to: corner}}\n")
    move, line = (parsed.step for parsed in script.steps)
    assert isinstance(move, Move)
    assert isinstance(line, Line)
    assert isinstance(move.to, StepTarget)
    assert move.to.position is not None
    assert line.to is not None
    assert line.to.position is not None
    assert move.to.position.tolist() == line.to.position.tolist()


def test_index_counts_from_0_in_nested_loops() -> None:
    script = parse("""\
steps:
  - repeat:
      times: 2
      index: row
      steps:
        - repeat:
            times: 3
            index: column
            steps:
              - wait: (row * 10 + column + 1) * 1 s
""")
    assert waits(script) == [1.0, 2.0, 3.0, 11.0, 12.0, 13.0]


def test_each_value_of_a_list_is_used() -> None:
    script = parse("""\
let: {times: [1, 2 s, 0.1 min]}
steps:
  - for_each: {name: t, in: times, steps: [{wait: t}]}
  - for_each: {name: p, in: [{a: 1}, {a: 2}], steps: [{wait: p.a * 2}]}
""")
    assert waits(script) == [1.0, 2.0, 6.0, 2.0, 4.0]


def test_item_of_a_list_is_a_name() -> None:
    script = parse("let: {parts: [cup, basin]}\nsteps:\n  - pick: parts[1]\n")
    assert [parsed.step for parsed in script.steps] == [Pick("basin")]


@pytest.mark.parametrize(
    ("text", "line", "said"),
    [
        ("let: {x: 3}\nsteps: [home]", 1, "meaning of its own"),
        ("let: {sin: 3}\nsteps: [home]", 1, "meaning of its own"),
        ("let: {a b: 3}\nsteps: [home]", 1, "letters, digits"),
        ("let: [3]\nsteps: [home]", 1, "mapping of names"),
        ("let: {a: 1, a: 2}\nsteps: [home]", 1, "given twice"),
        ("steps:\n  - wait: a * 2", 2, "no value 'a'"),
        ("let: {a: 3 mm}\nsteps:\n  - wait: a", 3, "not a length"),
        ("let: {a: 3 mm}\nsteps:\n  - speed: a", 3, "not a length"),
        ("steps:\n  - wait: 3 deg", 2, "not an angle"),
        ("let: {a: 1 mm + 1 s}\nsteps:\n  - wait: a", 3, "a length and a time cannot be added"),
        ("steps:\n  - move: {x: 1 s, y: 0, z: 0}", 2, "not a time"),
        ("steps:\n  - repeat: {times: 2.5, index: i, steps: [home]}", 2, "whole number"),
        ("steps:\n  - repeat: {times: 2, index: 3, steps: [home]}", 2, "letters, digits"),
        ("steps:\n  - repeat: {times: 2, index: i, steps: [{wait: -1 - i}]}", 2, "not between"),
        ("steps:\n  - for_each: {name: p, in: 3, steps: [home]}", 2, "Expected a list"),
        ("steps:\n  - for_each: {name: p, in: [], steps: [home]}", 2, "list of 1 to"),
        ("steps:\n  - for_each: {in: [1], steps: [home]}", 2, "needs 'name'"),
    ],
)
def test_mistake_is_refused_at_its_place(text: str, line: int, said: str) -> None:
    with pytest.raises(ScriptError) as caught:
        parse(text)
    problems = caught.value.problems
    assert any(problem.line == line and said in problem.text for problem in problems), problems


def test_repeated_mistake_is_reported_once() -> None:
    with pytest.raises(ScriptError) as caught:
        parse("steps:\n  - repeat: {times: 9, index: i, steps: [{wait: b}]}")
    assert len(caught.value.problems) == 1


@pytest.mark.parametrize(
    "loop",
    [
        "repeat: {times: 1000, index: i, steps: [home, home]}",
        "repeat: {times: 1000, steps: [home, home]}",
        f"for_each: {{name: a, in: [{', '.join('1' for _ in range(600))}], steps: [home, home]}}",
        "repeat: {times: 40, index: i, steps: [{repeat: {times: 40, index: k, steps: [home]}}]}",
    ],
)
def test_number_of_steps_is_bounded(loop: str) -> None:
    with pytest.raises(ScriptError, match=f"maximum is {MAX_STEPS}|at most {MAX_STEPS}"):
        parse(f"steps:\n  - {loop}")
