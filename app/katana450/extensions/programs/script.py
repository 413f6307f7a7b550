"""A script: its name, description, poses and steps, each with its line."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from katana450.arm.control.commands import MIN_SPEED
from katana450.extensions.programs import fields as read
from katana450.extensions.programs.blocks import LocatedStep, StepReader
from katana450.extensions.programs.fields import Fields
from katana450.extensions.programs.measures import MEASURES
from katana450.extensions.programs.places import place
from katana450.extensions.programs.plan_builder import StepTarget
from katana450.extensions.programs.scope import Scope
from katana450.extensions.programs.script_context import ScriptContext
from katana450.extensions.programs.settings_steps import Tool
from katana450.extensions.programs.source import Problem, ScriptError, YamlValue
from katana450.extensions.programs.source import read as read_text

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
    """

    name: str
    about: str
    bare: bool
    in_base: bool
    speed: float
    steps: tuple[LocatedStep, ...]
    expected: Mapping[str, tuple[float, float]]


def parse(text: str) -> Script:
    """Return ``text`` as a script. Raises ScriptError with all problems, line by line."""
    top = Fields(read_text(text), "a script")
    name = top.take("name", _name, "Script")
    about = top.take("about", read.text, "")
    fitted = top.take("gripper", read.choice("fitted", "none"), "fitted")
    frame = top.take("frame", read.choice("shoulder", "base"), "shoulder")
    speed = top.take("speed", read.number(MIN_SPEED, 1.0), 1.0)
    in_base = frame == "base"
    scope = top.take("let", _let, Scope())
    no_poses: dict[str, StepTarget] = {}
    poses = top.take("poses", lambda value: _poses(scope.bound(value), in_base=in_base), no_poses)
    setting = ScriptContext(in_base, poses)
    tool = top.take("tool", lambda value: LocatedStep(Tool.read(value, setting), *_at(value)), None)
    expected = top.take("expect", _expected, NOTHING)
    reader = StepReader(setting, scope)
    reader = top.take("define", reader.defining, reader)
    steps: tuple[LocatedStep, ...]
    steps = top.need("steps", reader.steps, ())
    top.done()
    if tool is not None:
        steps = (tool, *steps)
    return Script(name, about, fitted == "none", in_base, speed, steps, expected)


def _let(value: YamlValue) -> Scope:
    """Return the named values; each may use those before it."""
    scope = Scope()
    problems: list[Problem] = list(Fields(value, "the values").problems)
    for name, inner in value.fields:
        try:
            scope = scope.having(name, inner)
        except ScriptError as error:
            problems += error.problems
    if problems:
        raise ScriptError(tuple(problems))
    return scope


def _poses(value: YamlValue, *, in_base: bool) -> dict[str, StepTarget]:
    """Return the poses by name; each may refer to those before it."""
    fields = Fields(value, "the poses")
    found: dict[str, StepTarget] = {}
    for name in [str(key.held) for key, _ in value.fields]:
        read_place = fields.take(
            name, lambda each: place(each, ScriptContext(in_base, found)), None
        )
        if read_place is not None:
            found[name] = read_place
    fields.done()
    return found


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
