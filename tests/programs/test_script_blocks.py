"""The blocks of a script: the lines of its steps, for an editor that moves them."""

from __future__ import annotations

import pytest

from katana450.extensions.programs.language.source import read
from katana450.extensions.programs.run.simulation import plan_script
from katana450.extensions.programs.script.blocks import TextBlock, blocks_of
from katana450.extensions.programs.script.script import KNOWN_STEPS, examples, parse
from katana450.resources import URDF_PATH
from tests.programs.test_script_schema import SCRIPTS

TEXT = """\
tool: tcp
steps:
  # a note on the list

  # to the middle
  - move: {x: 320, y: 0, z: 150, pitch: 50}   # level
  - repeat:
      times: 2
      steps:
        - line:
            by: {z: 20}
          # down again
        - line: {by: {z: -20}}
        # - wait: 1
  - if:
      held: cup
      then: [home, {wait: 1}]
      else:
      - fill: 100
expect: {}
"""


def blocks(text: str) -> tuple[TextBlock, ...]:
    return blocks_of(read(text), text, {"axes": ("base", "arm", "wrist")})


def test_blocks_have_their_lines_and_the_comments_above_them() -> None:
    shown = [(b.first, b.line, b.last, b.depth, b.indent, b.title) for b in blocks(TEXT)]
    assert shown == [
        (1, 1, 1, 0, None, "tool tcp"),
        (5, 6, 6, 0, 2, "move x 320, y 0, z 150, pitch 50"),
        (7, 7, 14, 0, 2, "repeat times 2"),
        (10, 10, 12, 1, 8, "line by z 20"),
        (13, 13, 13, 1, 8, "line by z -20"),
        (14, 14, 14, 1, 8, "wait 1"),
        (15, 15, 19, 0, 2, "if held cup"),
        (17, 17, 17, 1, None, "then: home"),
        (17, 17, 17, 1, None, "then: wait 1"),
        (19, 19, 19, 1, 6, "else: fill 100"),
    ]
    assert [b.enabled for b in blocks(TEXT)].count(False) == 1
    assert len({b.group for b in blocks(TEXT)}) == 5


def test_step_of_several_lines_is_commented_out() -> None:
    text = (
        "steps:\n- home\n# - repeat:\n#     times: 2\n#\n#     steps: [home]   # here\n# words\n"
        "#- home\n"
    )
    home, repeat = blocks(text)
    assert (home.enabled, repeat.enabled) == (True, False)
    assert (repeat.first, repeat.last, repeat.title) == (3, 6, "repeat times 2")


def test_values_of_a_step_are_where_the_text_has_them() -> None:
    text = TEXT.replace("tool: tcp", "tool: tcp\nlet: {r: 4 cm}").replace(
        "held: cup", 'held: "cup"'
    )
    known = {"objects": ["glass"], "tools": ["tcp", "flange"]}
    shown = [
        (value.name, value.text, value.unit, value.step, value.options)
        for block in blocks_of(read(text), text, known)
        for value in block.values
        if not value.before
        and text.split("\n")[value.line - 1][value.column - 1 : value.end - 1].strip('"')
        == value.text
    ]
    assert shown == [
        ("tool", "tcp", "", 0.0, ("tcp", "flange")),
        ("r", "4 cm", "", 0.0, ()),
        ("x", "320", "mm", 1.0, ()),
        ("y", "0", "mm", 1.0, ()),
        ("z", "150", "mm", 1.0, ()),
        ("pitch", "50", "deg", 1.0, ()),
        ("times", "2", "", 1.0, ()),
        ("by z", "20", "mm", 1.0, ()),
        ("by z", "-20", "mm", 1.0, ()),
        ("wait", "1", "s", 1.0, ()),
        ("held", "cup", "", 0.0, ("cup", "glass")),
        ("wait", "1", "s", 1.0, ()),
        ("fill", "100", "ml", 1.0, ()),
    ]


@pytest.mark.parametrize(
    ("step", "names"),
    [
        ("line: {to: [1, 2, 3]}", ["to x", "to y", "to z", "pitch", "roll", "yaw", "feed"]),
        ("grasp: cup", ["grasp", "side", "pitch", "height"]),
        ("joints: [1.25, 2, 3]", ["base", "arm", "wrist"]),
        ("move: up", ["move"]),
        ("home:", []),
        ("fly: {at: 3}", ["at"]),
    ],
)
def test_values_have_the_names_of_the_schema(step: str, names: list[str]) -> None:
    poses, block = blocks(f"poses: {{up: {{joints: [1]}}}}\nsteps: [{step}]\n")
    assert [value.name for value in poses.values] == ["up joints 1"]
    assert [value.name for value in block.values] == names
    assert {value.options for value in block.values if value.name == "move"} <= {("up",)}


def test_values_have_one_order_without_those_that_the_arm_cannot_have() -> None:
    text = "steps: [{line: {feed: 3, to: up}}]"
    (block,) = blocks_of(read(text), text, {"unsuited": ("yaw",)})
    assert [value.name for value in block.values] == ["to", "pitch", "roll", "feed"]


def test_comments_that_are_no_steps_change_nothing() -> None:
    text = "steps:\n  - home\n  # - homes\n  # - wait: [1\n  # a list: - home\n"
    assert [block.title for block in blocks(text)] == ["home"]


def test_mistakes_leave_the_blocks() -> None:
    text = "steps:\n  - fly: 3\n  - {home: , wait: 1}\n  - line: {by: far}\n  - 3\n"
    titles = [block.title for block in blocks(text)]
    assert titles == ["fly 3", "home, wait 1", "line by far", "3"]


@pytest.mark.parametrize("text", ["3", "[home]", "steps:", "steps: []", "steps: {home: 1}", "a: 1"])
def test_text_without_steps_has_no_blocks(text: str) -> None:
    assert blocks(text) == ()


@pytest.mark.parametrize("name", SCRIPTS)
def test_blocks_of_every_script_of_the_project_cover_its_steps(name: str) -> None:
    text = SCRIPTS[name]
    places = {(block.line, block.column) for block in blocks(text)}
    assert {(step.line, step.column) for step in parse(text).steps} <= places
    for block in blocks(text):
        first = text.split("\n")[block.line - 1]
        assert block.indent is None or first[block.indent : block.indent + 2] == "- "


def test_examples_are_valid_and_most_can_be_planned_alone() -> None:
    texts = {
        name: f"  - {step}\n".replace("\n", "\n  ") for name, step in examples(fingers=True).items()
    }
    assert set(texts) <= set(KNOWN_STEPS)
    assert {"home", "gripper", "pick", "repeat", "if"} <= set(texts)
    assert not {"gripper", "pick", "pour"} & set(examples(fingers=False))
    for text in texts.values():
        parse(f"frame: base\nsteps:\n{text}")
    alone = set(texts) - {"grasp", "place", "set_down", "release", "pick", "pour", "if", "fill"}
    together = "".join(texts[name].rstrip() + "\n  - home\n" for name in sorted(alone))
    plan_script(parse(f"frame: base\nsteps:\n{together}"), URDF_PATH)
