"""The names at one place of a script: values, places and definitions."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TypeVar

from katana450.extensions.programs.language.expression import (
    FUNCTIONS,
    UNITS,
    ExpressionError,
    Quantity,
    evaluate,
)
from katana450.extensions.programs.language.source import YamlValue
from katana450.extensions.programs.language.step_target import StepTarget

NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
"""Pattern of a name."""

ITEM = re.compile(r"\[(\d+)\]")
"""Pattern of the number of an item of a list, as in ``corner[0]``."""

V = TypeVar("V")

RESERVED = frozenset(
    {*UNITS, *FUNCTIONS, "x", "y", "z", "pi", "open", "closed", "keep", "roomiest"}
)
"""Words with a meaning of their own."""


@dataclass(frozen=True)
class Scope:
    """The values that names stand for at one place of a script.

    Attributes:
        values: all values by their names, and the parts of mappings by names such as ``box.name``.
        numbers: those that are numbers, and the numbers in mappings and lists, by names such as
            ``corner.x`` and ``corner.0``.
    """

    values: Mapping[str, YamlValue] = field(default_factory=dict)
    numbers: Mapping[str, Quantity] = field(default_factory=dict)

    def having(self, name: YamlValue, value: YamlValue) -> Scope:
        """Return the scope with one more value, in which the names so far may be used.

        Raises ScriptError if ``name`` is no name for a value.
        """
        word = str(name.held)
        if name.kind != "text" or not NAME.fullmatch(word):
            raise name.wrong(f"Expected a name of letters, digits and _, not {name}.")
        if word in RESERVED:
            raise name.wrong(f"{word!r} has a meaning of its own. Choose another name.")
        bound = self.bound(value)
        values, numbers = _without(self.values, word), _without(self.numbers, word)
        if bound.number is not None:
            numbers[word] = Quantity(bound.number, bound.unit)
        parts: list[tuple[object, YamlValue]] = []
        if bound.kind == "mapping":
            parts = [(part.held, inner) for part, inner in bound.fields]
        elif bound.kind == "list":
            parts = list(enumerate(bound.items))
        for part, inner in parts:
            values[f"{word}.{part}"] = inner
            if inner.number is not None:
                numbers[f"{word}.{part}"] = Quantity(inner.number, inner.unit)
        return Scope({**values, word: bound}, numbers)

    def bound(self, value: YamlValue) -> YamlValue:
        """Return ``value`` with names and expressions in it replaced by what they stand for."""
        match value.kind:
            case "mapping":
                pairs = tuple((name, self.bound(inner)) for name, inner in value.fields)
                return replace(value, held=pairs)
            case "list":
                return replace(value, held=tuple(self.bound(inner) for inner in value.items))
            case "text":
                return self._bound_text(value)
        return value

    def _bound_text(self, value: YamlValue) -> YamlValue:
        text = str(value.held)
        name = ITEM.sub(r".\1", text)
        if name in self.values:
            # Errors are reported where the name is used.
            return replace(self.values[name], line=value.line, column=value.column, file=value.file)
        try:
            quantity = evaluate(text, self.numbers)
        except ExpressionError as error:
            return replace(value, why=str(error))
        return replace(value, kind="number", number=quantity.value, unit=quantity.kind)


@dataclass(frozen=True)
class Definition:
    """Named steps with parameters.

    Attributes:
        steps: the text of the steps.
        parameters: the values by default, by the names of the parameters.
        context: the names at the place of the definition, with the definitions before it.
    """

    steps: YamlValue
    parameters: tuple[tuple[YamlValue, YamlValue], ...]
    context: ScriptContext


@dataclass(frozen=True)
class ScriptContext:
    """The names at one place of a script.

    Attributes:
        in_base: whether points are in the base frame, not in {S}.
        scope: named values.
        poses: named places.
        definitions: named steps.
    """

    in_base: bool = False
    scope: Scope = field(default_factory=Scope)
    poses: Mapping[str, StepTarget] = field(default_factory=dict)
    definitions: Mapping[str, Definition] = field(default_factory=dict)


def _without(named: Mapping[str, V], word: str) -> dict[str, V]:
    """Return ``named`` without the value ``word`` and its parts."""
    return {
        name: value
        for name, value in named.items()
        if name != word and not name.startswith(f"{word}.")
    }
