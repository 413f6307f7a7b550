"""Lists of steps, with what repeats them and gives them names; written out as they are read."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from katana450.extensions.programs import fields as read
from katana450.extensions.programs.conditions import (
    CHOICE_CONDITIONS,
    Condition,
    ProgramTime,
    one_condition,
)
from katana450.extensions.programs.fields import Fields
from katana450.extensions.programs.located_step import Conditional, LocatedStep, count
from katana450.extensions.programs.pick import stacked
from katana450.extensions.programs.scope import Scope
from katana450.extensions.programs.script_context import ScriptContext
from katana450.extensions.programs.source import Problem, ScriptError, YamlValue
from katana450.extensions.programs.step import Step
from katana450.extensions.programs.steps import STEPS

MAX_STEPS = 1000
"""Maximum number of steps, with all repetitions."""

MAX_REPETITIONS = 1000
"""Maximum count of a ``repeat``, and of the values of a ``for_each``."""

BLOCKS = ("repeat", "for_each", "call", "stack", "if")
"""Names of what stands for several steps."""


@dataclass(frozen=True)
class Definition:
    """Named steps with parameters.

    Attributes:
        steps: the text of the steps.
        parameters: the values by default, by the names of the parameters.
        reader: reader for the place of the definition, which knows the definitions before it.
    """

    steps: YamlValue
    parameters: tuple[tuple[YamlValue, YamlValue], ...]
    reader: StepReader


@dataclass(frozen=True)
class StepReader:
    """Reader of steps at one place of a script.

    Attributes:
        setting: settings that all steps share.
        scope: named values.
        definitions: named steps.
    """

    setting: ScriptContext
    scope: Scope = field(default_factory=Scope)
    definitions: Mapping[str, Definition] = field(default_factory=dict)

    def defining(self, value: YamlValue) -> StepReader:
        """Return the reader with the definitions ``value``; each may call those before it."""
        fields = Fields(value, "the definitions")
        reader = self
        for name, _ in value.fields:
            found = fields.take(str(name.held), reader._definition, None)
            if found is not None:
                known = {**reader.definitions, str(name.held): found}
                reader = replace(reader, definitions=known)
        fields.done()
        return reader

    def _definition(self, value: YamlValue) -> Definition:
        fields = Fields(value, "a definition")
        parameters = fields.take("with", _pairs, ())
        steps = fields.need("steps", lambda inner: inner, value)
        fields.done()
        found = Definition(steps, parameters, self)
        # Problems are reported here too, and not only where it is called.
        self._called(found, ())
        return found

    def steps(self, value: YamlValue) -> tuple[LocatedStep, ...]:
        """Read a list of steps. Raises ScriptError with all problems."""
        found: list[LocatedStep] = []
        total = 0
        problems: list[Problem] = []
        for item in value.items if value.kind == "list" else ():
            try:
                steps = self._step(item)
                found += steps
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
        return tuple(found)

    def _step(self, item: YamlValue) -> tuple[LocatedStep, ...]:
        """Return one step, or those of a block."""
        name, value = item, YamlValue(item.line, item.column, None, "nothing")
        if item.kind == "mapping":
            if len(item.fields) != 1:
                names = ", ".join(str(name.held) for name, _ in item.fields)
                raise item.wrong(f"A step must be one name with its value, not {names or 'none'}.")
            ((name, value),) = item.fields
        known = (*STEPS, *BLOCKS)
        if name.held not in known:
            raise name.wrong(f"There is no step {name}{read.or_known(str(name.held), known)}")
        match name.held:
            case "repeat":
                found = self._repeated(name, value)
            case "for_each":
                found = self._for_each(value)
            case "call":
                found = self._call(name, value)
            case "if":
                found = _located(name, self._conditional(value))
            case "stack":
                return _located(name, *stacked(self.scope.bound(value), self.setting))
            case _:
                step = STEPS[str(name.held)].read(self.scope.bound(value), self.setting)
                return _located(name, step)
        if count(found) > MAX_STEPS:
            raise name.wrong(f"This gives {count(found)} steps; the maximum is {MAX_STEPS}.")
        return found

    def _conditional(self, value: YamlValue) -> Conditional:
        fields = Fields(value, "an if")
        condition = one_condition(fields, CHOICE_CONDITIONS, self.setting, self.scope)
        then = fields.need("then", self.steps, ())
        otherwise = fields.take("else", self.steps, ())
        fields.done()
        assert condition is not None
        return Conditional(condition, then, otherwise)

    def _repeated(self, name: YamlValue, value: YamlValue) -> tuple[LocatedStep, ...]:
        fields = Fields(value, "a repeat")
        times = fields.need(
            "times", lambda each: read.whole(1, MAX_REPETITIONS)(self.scope.bound(each)), 1
        )
        until = fields.take("until", self._until, None)
        if until is not None or not fields.has("index"):
            # The same steps again, which are planned only once.
            steps = fields.need("steps", self.steps, ())
            fields.done()
            if until is not None and times * (count(steps) + 1) <= MAX_STEPS:
                repeated = steps
                for _ in range(times - 1):
                    repeated = (*steps, *_located(name, Conditional(until, (), repeated)))
                return repeated
            return steps * times if times * count(steps) <= MAX_STEPS else steps * (MAX_STEPS + 1)
        index = fields.take("index", lambda each: each, value)
        numbers = [
            YamlValue(index.line, index.column, str(i), "whole", float(i)) for i in range(times)
        ]
        return self._each(fields, index, numbers)

    def _until(self, value: YamlValue) -> Condition | ProgramTime:
        fields = Fields(value, "an until")
        condition = one_condition(fields, CHOICE_CONDITIONS, self.setting, self.scope)
        fields.done()
        assert condition is not None
        return condition

    def _for_each(self, value: YamlValue) -> tuple[LocatedStep, ...]:
        fields = Fields(value, "a for_each")
        name = fields.need("name", lambda each: each, value)
        given = fields.need(
            "in",
            lambda each: read.listed(lambda item: item, 1, MAX_REPETITIONS)(self.scope.bound(each)),
            (),
        )
        return self._each(fields, name, given)

    def _each(
        self, fields: Fields, name: YamlValue, values: list[YamlValue] | tuple[YamlValue, ...]
    ) -> tuple[LocatedStep, ...]:
        """Return the ``steps`` of a block once for each value of ``name``."""

        def all_of(steps: YamlValue) -> tuple[LocatedStep, ...]:
            found: list[LocatedStep] = []
            total = 0
            for each in values:
                inner = replace(self, scope=self.scope.having(name, each)).steps(steps)
                found += inner
                total += count(inner)
                if total > MAX_STEPS:
                    break
            return tuple(found)

        steps = fields.need("steps", all_of, ())
        fields.done()
        return steps

    def _call(self, call: YamlValue, value: YamlValue) -> tuple[LocatedStep, ...]:
        given: tuple[tuple[YamlValue, YamlValue], ...] = ()
        name = value
        if value.kind == "mapping":
            fields = Fields(value, "a call")
            name = fields.need("name", lambda each: each, value)
            given = fields.take("with", _pairs, ())
            fields.done()
        if name.held not in self.definitions:
            known = tuple(self.definitions)
            raise name.wrong(
                f"There is no definition {name}{read.or_known(str(name.held), known)}"
                if known
                else f"There is no definition {name}; give it under `define:`, before it is called."
            )
        arguments = tuple((word, self.scope.bound(each)) for word, each in given)
        found = self._called(self.definitions[str(name.held)], arguments)
        return tuple(each.called_at(call.line, call.file) for each in found)

    @staticmethod
    def _called(
        definition: Definition, given: tuple[tuple[YamlValue, YamlValue], ...]
    ) -> tuple[LocatedStep, ...]:
        """Return the steps of ``definition`` with the arguments ``given``."""
        reader = definition.reader
        known = [str(name.held) for name, _ in definition.parameters]
        arguments = {str(name.held): each for name, each in given}
        for name, _ in given:
            if name.held not in known:
                text = f"There is no parameter {name}{read.or_known(str(name.held), known)}"
                raise name.wrong(text)
        scope = reader.scope
        for name, default in definition.parameters:
            scope = scope.having(name, arguments.get(str(name.held), default))
        return replace(reader, scope=scope).steps(definition.steps)


def _pairs(value: YamlValue) -> tuple[tuple[YamlValue, YamlValue], ...]:
    """Read a mapping of names to values. Raises ScriptError."""
    Fields(value, "the parameters")
    return value.fields


def _located(at: YamlValue, *steps: Step | Conditional) -> tuple[LocatedStep, ...]:
    """Return ``steps`` with the place of ``at``."""
    return tuple(LocatedStep(step, at.line, at.column, at.file) for step in steps)
