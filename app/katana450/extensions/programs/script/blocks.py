"""Lists of steps, with what repeats them and gives them names; written out as they are read."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Annotated

from katana450.extensions.programs.building.conditions import CHOICE, Condition
from katana450.extensions.programs.building.step import Conditional, LocatedStep, Step, count
from katana450.extensions.programs.language.declaration import (
    Declared,
    Fields,
    Kind,
    Schema,
    or_known,
    record,
)
from katana450.extensions.programs.language.kinds import (
    RAW,
    TEXT,
    any_of,
    bound,
    listed,
    reference,
    whole,
)
from katana450.extensions.programs.language.scope import Definition, ScriptContext
from katana450.extensions.programs.language.source import Problem, ScriptError, YamlValue
from katana450.extensions.programs.steps.steps import STEPS

MAX_STEPS = 1000
"""Maximum number of steps, with all repetitions."""

MAX_REPETITIONS = 1000
"""Maximum count of a ``repeat``, and of the values of a ``for_each``."""

Pairs = tuple[tuple[YamlValue, YamlValue], ...]


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
    known = (*STEPS, *BLOCKS)
    if name.held not in known:
        raise name.wrong(f"There is no step {name}{or_known(word, known)}")
    value = context.scope.bound(value)
    return _located(name, STEPS[word].read(value, context))


def _read_pairs(value: YamlValue, _context: ScriptContext) -> Pairs:
    """Read a mapping of names to values. Raises ScriptError."""
    Fields(value, "the parameters")
    return value.fields


TIMES = whole(1, MAX_REPETITIONS, "How often; with `until`, at most")
VALUES = Kind(
    listed(RAW, 1, MAX_REPETITIONS).read,
    any_of("The values", {"type": "array", "minItems": 1}, TEXT.schema),
)
PARAMETERS = Kind(_read_pairs, {"type": "object"}).about("Parameters and their values")
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

    noun = "an until"

    condition: Annotated[Condition, CHOICE]


@dataclass(frozen=True)
class Repeat(StepBlock):
    """Repeat steps."""

    noun = "a repeat"
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

    noun = "a for_each"

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
class Call(StepBlock):
    """Do the steps of a definition, with other values of its parameters."""

    noun = "a call"
    short = "name"

    name: Annotated[YamlValue, WORD]
    given: Annotated[Pairs, PARAMETERS.named("with")] = ()

    def steps_at(self, name: YamlValue, context: ScriptContext) -> tuple[LocatedStep, ...]:  # noqa: ARG002
        """Return the steps of the definition."""
        definitions = context.definitions
        if self.name.held not in definitions:
            raise self.name.wrong(
                f"There is no definition {self.name}{or_known(str(self.name.held), definitions)}"
                if definitions
                else f"There is no definition {self.name}; give it under `define:`, before it is "
                "called."
            )
        arguments = tuple((word, context.scope.bound(value)) for word, value in self.given)
        return _called(definitions[str(self.name.held)], arguments)


def _called(definition: Definition, values: Pairs) -> tuple[LocatedStep, ...]:
    """Return the steps of ``definition`` with ``values`` of its parameters."""
    known = [str(name.held) for name, _ in definition.parameters]
    arguments = {str(name.held): value for name, value in values}
    for name, _ in values:
        if name.held not in known:
            raise name.wrong(f"There is no parameter {name}{or_known(str(name.held), known)}")
    scope = definition.context.scope
    for name, default in definition.parameters:
        scope = scope.having(name, arguments.get(str(name.held), default))
    return read_steps(definition.steps, replace(definition.context, scope=scope))


@dataclass(frozen=True)
class If(StepBlock):
    """Steps that depend on one condition, which is measured when the step is reached."""

    noun = "an if"

    condition: Annotated[Condition, CHOICE]
    then: Annotated[tuple[LocatedStep, ...], INNER_STEPS.about("Steps if the condition holds")]
    otherwise: Annotated[
        tuple[LocatedStep, ...], INNER_STEPS.about("Steps if it does not hold").named("else")
    ] = ()

    def steps_at(self, name: YamlValue, context: ScriptContext) -> tuple[LocatedStep, ...]:  # noqa: ARG002
        """Return the choice."""
        return _located(name, Conditional(self.condition, self.then, self.otherwise))


BLOCKS: dict[str, type[StepBlock]] = {"repeat": Repeat, "for_each": ForEach, "call": Call, "if": If}
"""Class of each block, which stands for several steps, by its name in a script."""


@dataclass(frozen=True)
class _Defined(Declared):
    """Steps with parameters."""

    noun = "a definition"

    steps: Annotated[YamlValue, TEXT_OF_STEPS]
    parameters: Annotated[Pairs, PARAMETERS.named("with")] = ()


DEFINED = record(_Defined)


def with_definitions(value: YamlValue, context: ScriptContext) -> ScriptContext:
    """Return ``context`` with the definitions ``value``; each may call those before it.

    Raises ScriptError, also for the problems of a definition that is not called.
    """
    fields = Fields(value, "the definitions")
    for name in [str(name.held) for name, _ in value.fields]:

        def read_definition(inner: YamlValue, context: ScriptContext = context) -> Definition:
            defined = DEFINED(inner, context)
            definition = Definition(defined.steps, defined.parameters, context)
            _called(definition, ())
            return definition

        known = fields.take(name, read_definition, None)
        if known is not None:
            context = replace(context, definitions={**context.definitions, name: known})
    fields.done()
    return context


def _located(place: YamlValue, *steps: Step | Conditional) -> tuple[LocatedStep, ...]:
    """Return ``steps`` with the place of ``place``."""
    return tuple(LocatedStep(step, place.line, place.column) for step in steps)
