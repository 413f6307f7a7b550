"""A script: its name, description, poses and steps, each with its line."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from katana450.arm.control.commands import MIN_SPEED
from katana450.extensions.programs import fields as read
from katana450.extensions.programs.fields import Fields
from katana450.extensions.programs.located_step import LocatedStep
from katana450.extensions.programs.measures import MEASURES
from katana450.extensions.programs.script_scene import ScriptScene
from katana450.extensions.programs.settings_steps import Tool
from katana450.extensions.programs.source import ScriptError, YamlValue
from katana450.extensions.programs.source import read as read_text
from katana450.extensions.programs.vocabulary import FRAMES, Vocabulary

MAX_NAME_LENGTH = 40
"""Maximum number of characters of a name."""

NOTHING: dict[str, tuple[float, float]] = {}
"""The expectations of a script that has none."""


@dataclass(frozen=True)
class Script:
    """A parsed script.

    Attributes:
        name: name, for display.
        about: description, for display.
        bare: whether it needs an arm without its gripper.
        in_base: whether its points are in the base frame, not in {S}.
        speed: fraction of full speed.
        steps: the steps in their order, all repetitions written out.
        expected: minimum and maximum of measures, by name.
        scene: the scene that it needs; None for any.
    """

    name: str
    about: str
    bare: bool
    in_base: bool
    speed: float
    steps: tuple[LocatedStep, ...]
    expected: Mapping[str, tuple[float, float]]
    scene: ScriptScene | None = None


def parse(text: str) -> Script:
    """Return ``text`` as a script. Raises ScriptError with all problems, line by line."""
    top = Fields(read_text(text), "a script")
    name = top.take("name", _name, "Script")
    about = top.take("about", read.text, "")
    fitted = top.take("gripper", read.choice("fitted", "none"), "fitted")
    frame = top.take("frame", read.choice(*FRAMES), "shoulder")
    speed = top.take("speed", read.number(MIN_SPEED, 1.0), 1.0)
    in_base = frame == "base"
    known = Vocabulary(in_base)
    known = top.take("include", known.including, known).extended(top)
    scene = top.take("scene", lambda value: _scene(value, known), None)
    tool = top.take(
        "tool", lambda value: LocatedStep(Tool.read(value, known.setting), *_at(value)), None
    )
    expected = top.take("expect", _expected, NOTHING)
    steps: tuple[LocatedStep, ...]
    steps = top.need("steps", known.reader.steps, ())
    top.done()
    if tool is not None:
        steps = (tool, *steps)
    return Script(name, about, fitted == "none", in_base, speed, steps, expected, scene)


def is_script(text: str) -> bool:
    """Return whether ``text`` is meant as a script, because it has steps."""
    try:
        value = read_text(text)
    except ScriptError:
        return False
    return value.kind == "mapping" and any(name.held == "steps" for name, _ in value.fields)


def _scene(value: YamlValue, known: Vocabulary) -> ScriptScene | None:
    return None if value.kind == "nothing" else ScriptScene.read(value, known.scope)


def _expected(value: YamlValue) -> dict[str, tuple[float, float]]:
    fields = Fields(value, "what is expected")
    found = {name: fields.take(name, _bounds, None) for name in MEASURES}
    fields.done()
    return {name: bounds for name, bounds in found.items() if bounds is not None}


def _bounds(value: YamlValue) -> tuple[float, float]:
    fields = Fields(value, "a bound")
    any_number = read.number(-1e9, 1e9)
    bounds = (
        fields.take("at_least", any_number, float("-inf")),
        fields.take("at_most", any_number, float("inf")),
    )
    fields.done()
    return bounds


def _name(value: YamlValue) -> str:
    name = read.text(value)
    if len(name) > MAX_NAME_LENGTH or not name.isprintable():
        raise value.wrong(f"A name has at most {MAX_NAME_LENGTH} characters, all on one line.")
    return name


def _at(value: YamlValue) -> tuple[int, int]:
    return value.line, value.column
