"""The methods of `ScriptWriter` that write one step each, derived from the classes of the steps.

``step_methods.pyi`` beside this file has their signatures for editors and type checkers.
"""

from __future__ import annotations

import keyword
from collections.abc import Callable, Mapping
from inspect import Parameter, Signature
from typing import Any, NamedTuple

from katana450.extensions.programs.building.step import Step
from katana450.extensions.programs.language.declaration import (
    REQUIRED,
    Group,
    Schema,
    declaration_of,
)
from katana450.extensions.programs.language.kinds import DEFINITIONS
from katana450.extensions.programs.steps.steps import STEPS


class StepField(NamedTuple):
    """A field of a step.

    Attributes:
        name: its name in a script.
        schema: its JSON Schema.
        attribute: name of the attribute of the class with its value; of a group, that of the group.
        parameter: the parameter of the method that writes the step.
    """

    name: str
    schema: Schema
    attribute: str
    parameter: Parameter

    @property
    def about(self) -> str:
        """Its description, with the unit."""
        return str(resolved(self.schema).get("description", "A text"))


def resolved(schema: Schema) -> Schema:
    """Return ``schema``, or the definition that it refers to."""
    return DEFINITIONS[schema["$ref"].rpartition("/")[2]] if "$ref" in schema else schema


def fields_of(step: type[Step]) -> list[StepField]:
    """Return the fields of ``step`` in the order of the parameters of its method.

    Fields that must be given come first, or the first one if none must. Others are given by name.
    """
    fields: list[StepField] = []
    parts = declaration_of(step).parts
    is_any_required = any(part.default is REQUIRED for part in parts.values())
    for attribute, (kind, default) in parts.items():
        is_required = default is REQUIRED and not isinstance(kind, Group)
        is_first = is_required or not (is_any_required or isinstance(kind, Group) or fields)
        schemas: Mapping[str, Schema] = (
            kind.schemas if isinstance(kind, Group) else {kind.field or attribute: kind.schema}
        )
        for name, schema in schemas.items():
            parameter = Parameter(
                # Such as `from`, which is a word of Python.
                f"{name}_" if keyword.iskeyword(name) else name,
                Parameter.POSITIONAL_OR_KEYWORD if is_first else Parameter.KEYWORD_ONLY,
                default=Parameter.empty if is_required else None,
            )
            fields.append(StepField(name, schema, attribute, parameter))
    return sorted(fields, key=lambda field: field.parameter.kind)


def documentation_of(step: type[Step]) -> str:
    """Return the docstring of the method that writes ``step``."""
    summary, *_ = (step.__doc__ or "").partition("\n\n")
    fields = fields_of(step)
    if not fields:
        return summary
    rows = (f"    {field.parameter.name}: {field.about.rstrip('.')}." for field in fields)
    return "\n".join((summary, "", "Args:", *rows))


def _method(word: str, step: type[Step]) -> Callable[..., None]:
    fields = fields_of(step)
    short = next((field.name for field in fields if field.attribute == step.short), "")
    own = Parameter("self", Parameter.POSITIONAL_OR_KEYWORD)
    signature = Signature([own, *(field.parameter for field in fields)])

    def method(*args: Any, **values: Any) -> None:
        writer, *_ = args
        arguments = signature.bind(*args, **values).arguments
        content = {
            field.name: arguments[field.parameter.name]
            for field in fields
            if arguments.get(field.parameter.name) is not None
        }
        writer.write(word, content[short] if [*content] == [short] else content)

    method.__name__, method.__qualname__ = word, f"StepMethods.{word}"
    method.__doc__ = documentation_of(step)
    vars(method)["__signature__"] = signature
    return method


METHODS = {word: STEPS[word] for word in sorted(STEPS) if word != "move"}
"""Class of the step of each method. A `ScriptWriter` moves by a method of its own."""


class StepMethods:
    """One method for each step, with the fields of the step as they are given in a script."""


for word, step in METHODS.items():
    setattr(StepMethods, word, _method(word, step))
