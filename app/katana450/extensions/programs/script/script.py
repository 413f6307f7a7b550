"""A script: its names, poses and steps, each with its line, and the JSON Schema of scripts.

What repeats steps or chooses between them is written out as it is read.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Annotated

from katana450.arm.control.arm import ArmModel
from katana450.arm.control.commands.commands import MIN_SPEED
from katana450.extensions.programs.building.step import (
    CHOICE,
    Condition,
    Conditional,
    LocatedStep,
    Step,
    count,
)
from katana450.extensions.programs.language.declaration import (
    Declared,
    Fields,
    Kind,
    Schema,
    or_known,
    record,
)
from katana450.extensions.programs.language.kinds import (
    DEFINITIONS,
    PLACE,
    RAW,
    TEXT,
    any_of,
    bound,
    choice,
    known,
    listed,
    mapping,
    number,
    reference,
    whole,
)
from katana450.extensions.programs.language.scope import ScriptContext
from katana450.extensions.programs.language.source import Problem, ScriptError, YamlValue, read
from katana450.extensions.programs.script.measures import MEASURES
from katana450.extensions.programs.script.script_scene import SCENE, SceneDraft
from katana450.extensions.programs.steps.settings_steps import Tool
from katana450.extensions.programs.steps.steps import STEPS

MAX_STEPS = 1000
"""Maximum number of steps, with all repetitions."""

MAX_REPETITIONS = 1000
"""Maximum count of a ``repeat``, and of the values of a ``for_each``."""


def read_steps(value: YamlValue, context: ScriptContext) -> tuple[LocatedStep, ...]:
    """Read a list of steps. Raises ScriptError with all problems."""
    located: list[LocatedStep] = []
    total = 0
    problems: list[Problem] = []
    for item in value.items if value.kind == "list" else ():
        try:
            steps = _read_step(item, context)
            located += steps
            total += count(steps)
        except ScriptError as error:
            problems += error.problems
        if total > MAX_STEPS:
            text = f"A script has at most {MAX_STEPS} steps, repetitions counted."
            problems += item.wrong(text).problems
            break
    if value.kind != "list" or not value.items:
        what = "an empty one" if value.kind == "list" else value
        problems += value.wrong(f"Expected a list of steps, not {what}.").problems
    if problems:
        # A step that is repeated has its problem once.
        raise ScriptError(tuple(dict.fromkeys(problems)))
    return tuple(located)


def _read_step(item: YamlValue, context: ScriptContext) -> tuple[LocatedStep, ...]:
    """Return one step, or those of a block."""
    name, value = item, YamlValue(item.line, item.column, None, "nothing")
    if item.kind == "mapping":
        if len(item.fields) != 1:
            names = ", ".join(str(name.held) for name, _ in item.fields)
            raise item.wrong(f"A step must be one name with its value, not {names or 'none'}.")
        ((name, value),) = item.fields
    word = str(name.held)
    if word in BLOCKS:
        steps = BLOCKS[word].read(value, context).steps_at(name, context)
        if count(steps) > MAX_STEPS:
            raise name.wrong(f"This gives {count(steps)} steps; the maximum is {MAX_STEPS}.")
        return steps
    if name.held not in KNOWN_STEPS:
        raise name.wrong(f"There is no step {name}{or_known(word, KNOWN_STEPS)}")
    value = context.scope.bound(value)
    return _located(name, STEPS[word].read(value, context))


TIMES = whole(1, MAX_REPETITIONS, "How often; with `until`, at most")
VALUES = Kind(
    listed(RAW, 1, MAX_REPETITIONS).read,
    any_of("The values", {"type": "array", "minItems": 1}, TEXT.schema),
)
INNER_STEPS = Kind(read_steps, reference("steps"))
TEXT_OF_STEPS = Kind(RAW.read, reference("steps"))
WORD = Kind(RAW.read, TEXT.schema)

STEP_LIST: Schema = {
    "description": "Steps in their order",
    "type": "array",
    "items": reference("step"),
    "minItems": 1,
    "maxItems": MAX_STEPS,
}


class StepBlock(Declared):
    """Something that stands for several steps."""

    @abstractmethod
    def steps_at(self, name: YamlValue, context: ScriptContext) -> tuple[LocatedStep, ...]:
        """Return the steps of the block ``name``. Raises ScriptError."""


@dataclass(frozen=True)
class Until(Declared):
    """Repeat until this holds after the steps."""

    noun = "`until`"

    condition: Annotated[Condition, CHOICE]


@dataclass(frozen=True)
class Repeat(StepBlock):
    """Repeat steps."""

    noun = "`repeat`"
    example = "\n    times: 2\n    steps:\n      - wait: 1"
    excludes = ("until", "index")

    times: Annotated[int, bound(TIMES)]
    steps: Annotated[YamlValue, TEXT_OF_STEPS]
    until: Annotated[Until | None, record(Until)] = None
    index: Annotated[YamlValue | None, WORD.about("Name of the counter, from 0")] = None

    def steps_at(self, name: YamlValue, context: ScriptContext) -> tuple[LocatedStep, ...]:
        """Return the steps; without an index the same ones again, which are planned only once."""
        index, times = self.index, self.times
        if index is not None:
            numbers = (
                YamlValue(index.line, index.column, str(i), "whole", float(i)) for i in range(times)
            )
            return _each(self.steps, index, numbers, context)
        steps = read_steps(self.steps, context)
        if self.until is None or times * (count(steps) + 1) > MAX_STEPS:
            return steps * min(times, MAX_STEPS + 1)
        repeated = steps
        for _ in range(times - 1):
            until = Conditional(self.until.condition, (), repeated)
            repeated = (*steps, *_located(name, until))
        return repeated


@dataclass(frozen=True)
class ForEach(StepBlock):
    """Do steps once for each value of a list."""

    noun = "`for_each`"
    example = "\n    name: up\n    in: [20, -20]\n    steps:\n      - line: {by: {z: up}}"

    name: Annotated[YamlValue, WORD.about("Name of the value in the steps")]
    values: Annotated[tuple[YamlValue, ...], bound(VALUES).named("in")]
    steps: Annotated[YamlValue, TEXT_OF_STEPS]

    def steps_at(self, name: YamlValue, context: ScriptContext) -> tuple[LocatedStep, ...]:  # noqa: ARG002
        """Return the steps for each value."""
        return _each(self.steps, self.name, self.values, context)


def _each(
    steps: YamlValue, name: YamlValue, values: Iterable[YamlValue], context: ScriptContext
) -> tuple[LocatedStep, ...]:
    """Return ``steps`` once for each value of ``name``; not all of them if they are too many."""
    located: list[LocatedStep] = []
    total = 0
    for value in values:
        inner = read_steps(steps, replace(context, scope=context.scope.having(name, value)))
        located += inner
        total += count(inner)
        if total > MAX_STEPS:
            break
    return tuple(located)


@dataclass(frozen=True)
class If(StepBlock):
    """Steps that depend on one condition, which is measured when the step is reached."""

    noun = "`if`"
    example = "\n    held: cup\n    then:\n      - wait: 1\n    else:\n      - home"

    condition: Annotated[Condition, CHOICE]
    then: Annotated[tuple[LocatedStep, ...], INNER_STEPS.about("Steps if the condition holds")]
    otherwise: Annotated[
        tuple[LocatedStep, ...], INNER_STEPS.about("Steps if it does not hold").named("else")
    ] = ()

    def steps_at(self, name: YamlValue, context: ScriptContext) -> tuple[LocatedStep, ...]:  # noqa: ARG002
        """Return the choice."""
        return _located(name, Conditional(self.condition, self.then, self.otherwise))


BLOCKS: dict[str, type[StepBlock]] = {"repeat": Repeat, "for_each": ForEach, "if": If}
"""Class of each block, which stands for several steps, by its name in a script."""

KNOWN_STEPS: dict[str, type[Declared]] = {**STEPS, **BLOCKS}
"""Class of everything that a list of steps may hold, by its name."""


BY_FINGERS = tuple(name for name, step in STEPS.items() if step.by_fingers)
"""Steps for which an arm needs fingers that move."""


def examples(*, fingers: bool) -> dict[str, str]:
    """Return a valid example of each step that the page offers to insert, by the step's name.

    ``fingers``: whether the arm has fingers that move.
    """
    steps = {name: KNOWN_STEPS[name] for name in KNOWN_STEPS if fingers or name not in BY_FINGERS}
    values = {name: step.example for name, step in steps.items() if step.example is not None}
    return {name: f"{name}: {value}".removesuffix(": ") for name, value in values.items()}


def _located(place: YamlValue, *steps: Step | Conditional) -> tuple[LocatedStep, ...]:
    """Return ``steps`` with the place of ``place``."""
    return tuple(LocatedStep(step, place.line, place.column) for step in steps)


FRAME = choice("shoulder", "base")
"""The frame of points."""


def context_of(fields: Fields) -> ScriptContext:
    """Return the names of a script with these fields, which collect all problems."""
    context = ScriptContext(fields.take("frame", FRAME, "shoulder") == "base")
    for name, extend in (("let", _with_values), ("poses", _with_poses)):
        context = fields.take(name, partial(extend, context=context), context)
    return context


def _with_values(value: YamlValue, context: ScriptContext) -> ScriptContext:
    """Return ``context`` with named values; each may use those before it."""
    scope = context.scope
    problems: list[Problem] = list(Fields(value, "the values").problems)
    for name, inner in value.fields:
        try:
            scope = scope.having(name, inner)
        except ScriptError as error:
            problems += error.problems
    if problems:
        raise ScriptError(tuple(problems))
    return replace(context, scope=scope)


def _with_poses(value: YamlValue, context: ScriptContext) -> ScriptContext:
    """Return ``context`` with named places; each may refer to those before it."""
    fields = Fields(context.scope.bound(value), "the poses")
    for name in [str(key.held) for key, _ in value.fields]:
        place = fields.take(name, PLACE.within(context), None)
        if place is not None:
            context = replace(context, poses={**context.poses, name: place})
    fields.done()
    return context


MAX_NAME_LENGTH = 40
"""Maximum number of characters of a name."""


def _name(value: YamlValue, _context: ScriptContext) -> str:
    name = TEXT(value)
    if len(name) > MAX_NAME_LENGTH or not name.isprintable():
        raise value.wrong(f"A name has at most {MAX_NAME_LENGTH} characters, all on one line.")
    return name


def _tool(value: YamlValue, context: ScriptContext) -> LocatedStep:
    return LocatedStep(Tool.read(value, context), value.line, value.column)


ANY_NUMBER = number(-1e9, 1e9, about="Number")


@dataclass(frozen=True)
class Expectation(Declared):
    """Bounds of a measure, both included."""

    noun = "a bound"

    at_least: Annotated[float, ANY_NUMBER] = -math.inf
    at_most: Annotated[float, ANY_NUMBER] = math.inf


BOUNDS = record(Expectation)


def _expected(value: YamlValue, _context: ScriptContext) -> dict[str, tuple[float, float]]:
    """Read the bounds of measures, by their names."""
    fields = Fields(value, "what is expected")
    bounds = {name: fields.take(name, BOUNDS, None) for name in MEASURES}
    fields.done()
    return {name: (b.at_least, b.at_most) for name, b in bounds.items() if b is not None}


def _names(about: str, kind: Kind[object] | None = None) -> Kind[YamlValue]:
    """Return the kind of a mapping of names, which ``context_of`` has read already."""
    values = {} if kind is None else {"additionalProperties": kind.schema}
    return Kind(RAW.read, {"type": "object", "description": about, **values})


@dataclass(frozen=True)
class Script(Declared):
    """Lengths are in mm, angles in deg, times in s.

    Attributes:
        name: name, for display.
        about: description, for display.
        gripper: ``none`` if it needs an arm without its gripper.
        frame: frame of its points, ``shoulder`` or ``base``.
        tool: the step that selects the tool frame of its points; None to keep it.
        speed: fraction of full speed.
        scene: the scene that it needs; None for any.
        own_steps: the steps in their order, all repetitions written out.
        expected: minimum and maximum of measures, by name.

    The steps know its other names already.
    """

    noun = "a script"

    own_steps: Annotated[tuple[LocatedStep, ...], INNER_STEPS.named("steps")]
    name: Annotated[
        str,
        Kind(_name, {**TEXT.schema, "maxLength": MAX_NAME_LENGTH}).about("Name of the script"),
    ] = "Script"
    about: Annotated[str, TEXT.about("Description for people")] = ""
    gripper: Annotated[
        str, choice("fitted", "none").about("none: for an arm without its gripper")
    ] = "fitted"
    frame: Annotated[
        str,
        FRAME.about("Frame of all points: shoulder, the {S} of the paper, or base, on the table"),
    ] = "shoulder"
    tool: Annotated[
        LocatedStep | None,
        Kind(_tool, known("tools").schema).about("Tool frame of all points: tcp, grasp or flange"),
    ] = None
    speed: Annotated[float, number(MIN_SPEED, 1.0, about="Fraction of full speed")] = 1.0
    scene: Annotated[SceneDraft | None, SCENE] = None
    let: Annotated[YamlValue | None, _names("Named values; later ones may use earlier ones")] = None
    poses: Annotated[
        YamlValue | None,
        _names("Named places; later ones may use the names of earlier ones", PLACE),
    ] = None
    expected: Annotated[
        Mapping[str, tuple[float, float]],
        Kind(
            _expected,
            mapping(
                "Bounds on measures; a simulation that misses one ends with status 1",
                "",
                {name: BOUNDS.about(about).schema for name, about in MEASURES.items()},
            ),
        ).named("expect"),
    ] = field(default_factory=dict)

    @property
    def bare(self) -> bool:
        """True if it needs an arm without its gripper."""
        return self.gripper == "none"

    def suits(self, arm: ArmModel) -> bool:
        """Return whether ``arm`` has the gripper and the tool frame of the script."""
        tool = None if self.tool is None else self.tool.step
        is_there = not isinstance(tool, Tool) or tool.name in arm.tools
        return is_there and not (self.bare and arm.gripper.moves)

    @property
    def in_base(self) -> bool:
        """True if its points are in the base frame, not in {S}."""
        return self.frame == "base"

    @property
    def steps(self) -> tuple[LocatedStep, ...]:
        """The steps, the first of which may select the tool frame."""
        return self.own_steps if self.tool is None else (self.tool, *self.own_steps)


def parse(text: str) -> Script:
    """Return ``text`` as a script. Raises ScriptError with all problems, line by line."""
    return script_of(read(text))


def script_of(value: YamlValue) -> Script:
    """Return ``value`` as a script. Raises ScriptError with all problems, line by line."""
    names = Fields(value, Script.noun)
    context = context_of(names)
    try:
        script = Script.read(value, context)
    except ScriptError as error:
        problems = dict.fromkeys((*names.problems, *error.problems))
        raise ScriptError(tuple(problems)) from error
    if names.problems:
        raise ScriptError(tuple(names.problems))
    return script


def is_script(text: str) -> bool:
    """Return whether ``text`` is meant as a script, because it has steps."""
    try:
        value = read(text)
    except ScriptError:
        return False
    return value.kind == "mapping" and any(name.held == "steps" for name, _ in value.fields)


DIALECT = "https://json-schema.org/draft/2020-12/schema"

STEP_VALUES: dict[str, Schema] = {
    **{name: STEPS[name].schema() for name in sorted(STEPS)},
    **{name: block.schema() for name, block in BLOCKS.items()},
}
"""Schemas of the values of all steps, by the names of the steps."""

WITHOUT_VALUE = tuple(name for name, value in STEP_VALUES.items() if value.get("type") == "null")
"""Steps that take no value."""


def script_schema() -> Schema:
    """Return the JSON Schema of a script.

    It accepts every valid script. What it cannot express, such as limits of the arm or the value of
    a computed number, only the reader of scripts refuses.
    """
    step = any_of(
        "A step",
        {"enum": list(WITHOUT_VALUE)},
        {
            "type": "object",
            "properties": STEP_VALUES,
            "additionalProperties": False,
            "minProperties": 1,
            "maxProperties": 1,
        },
    )
    return {
        "$schema": DIALECT,
        "title": "Script of katana450",
        **Script.schema(),
        "$defs": {**DEFINITIONS, "steps": STEP_LIST, "step": step},
    }
