"""The names at one place of a script: values, places and definitions."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from katana450.caching import cached_property
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

RESERVED = frozenset(
    {*UNITS, *FUNCTIONS, "x", "y", "z", "pi", "open", "closed", "keep", "roomiest"}
)
"""Words with a meaning of their own."""


@dataclass(frozen=True)
class Scope:
    """The values that names stand for at one place of a script.

    Attributes:
        values: all values by their names, and the parts of mappings and lists by names such as
            ``box.name`` and ``corner.0``.
    """

    values: Mapping[str, YamlValue] = field(default_factory=dict)

    @cached_property
    def numbers(self) -> Mapping[str, Quantity]:
        """The values that are numbers."""
        return {
            name: Quantity(value.number, value.unit)
            for name, value in self.values.items()
            if value.number is not None
        }

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
        values = {
            name: other
            for name, other in self.values.items()
            if name != word and not name.startswith(f"{word}.")
        }
        if bound.kind == "mapping":
            values |= {f"{word}.{part.held}": inner for part, inner in bound.fields}
        elif bound.kind == "list":
            values |= {f"{word}.{number}": inner for number, inner in enumerate(bound.items)}
        return Scope({**values, word: bound})

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
