"""The values in the steps of a script with their places in the text, for fields of an editor.

What a value may be follows from the JSON Schema of its step.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator, Mapping

import msgspec

from katana450.extensions.programs.language.declaration import Schema
from katana450.extensions.programs.language.kinds import DEFINITIONS, reference
from katana450.extensions.programs.language.source import YamlValue

Names = Mapping[str, Iterable[str]]
"""The known names of each kind, as ``names`` in a schema calls it."""

FINE_RANGE = 1.0
"""Widest range of a number that is changed in steps of FINE_STEP, not of 1."""

FINE_STEP = 0.05

PLAIN_TEXT = re.compile(r"[\w .+*/()-]+")
"""Texts that need no quotes between braces."""


class StepValue(msgspec.Struct, frozen=True, omit_defaults=True):
    """A value that a field of an editor replaces.

    Attributes:
        name: its name in the step.
        line, column, end: its place, and the column behind it, from 1.
        text: the value without quotes.
        about: description for people.
        unit: unit of a number; empty for none.
        step: change of a number by a key; 0 if it is no number.
        options: texts that it may be, the present one among them if it must be one of them.
        free: whether it may be something else.
        before, after: texts about a value that the step does not have yet, whose ``text`` is empty.
    """

    name: str
    line: int
    column: int
    end: int
    text: str
    about: str = ""
    unit: str = ""
    step: float = 0.0
    options: tuple[str, ...] = ()
    free: bool = False
    before: str = ""
    after: str = ""


def names_in(script: YamlValue, known: Names) -> Names:
    """Return the ``known`` names with those of the poses and objects that ``script`` gives."""
    fields = {name.held: value for name, value in script.fields} if script.kind == "mapping" else {}
    poses, scene = fields.get("poses"), fields.get("scene")
    pairs = poses.fields if poses is not None and poses.kind == "mapping" else ()
    items = scene.items if scene is not None and scene.kind == "list" else ()
    objects = (pair for item in items if item.kind == "mapping" for pair in item.fields)
    own = [str(value.held) for name, value in objects if name.held == "name"]
    names = [str(name.held) for name, _ in pairs]
    return {**known, "poses": names, "objects": (*own, *known.get("objects", ()))}


def values_of(
    value: YamlValue, schema: Schema, names: Names, name: str, prefix: str = ""
) -> Iterator[StepValue]:
    """Yield the values in ``value``, which ``schema`` describes, without the steps in it.

    ``name``: of the value itself; ``prefix`` begins the names of those in it.
    """
    if schema == {**schema, **reference("steps")}:
        return
    variants = tuple(_variants(schema))
    if value.kind == "mapping":
        properties: Schema = {}
        others: Schema = {}
        for kind in variants:
            properties |= kind.get("properties", {})
            others = kind.get("additionalProperties") or others
        for key, inner in value.fields:
            word = f"{prefix}{key.held}".replace("_", " ")
            part = properties.get(str(key.held), others)
            yield from values_of(inner, part, names, word, f"{word} ")
    elif value.kind == "list":
        items: Schema = next((kind["items"] for kind in variants if "items" in kind), {})
        # A point may be given by its components, in the same order.
        mappings = (tuple(kind.get("properties", ())) for kind in variants)
        numbers = tuple(str(number) for number in range(1, len(value.items) + 1))
        is_posture = any(kind == {**kind, **reference("joints")} for kind in variants)
        lists = (*mappings, tuple(names.get("axes", ())) if is_posture else ())
        words = next((keys for keys in lists if len(keys) == len(numbers)), numbers)
        for inner, key in zip(value.items, words, strict=True):
            yield from values_of(inner, items, names, f"{prefix}{key}", f"{prefix}{key} ")
    elif value.end and schema.get("type") != "null":
        yield _scalar(value, variants, names, name)


def step_values(value: YamlValue, schema: Schema, names: Names, name: str) -> list[StepValue]:
    """Return the values of a step, also those that it may have, in the order of ``schema``.

    Args:
        value: what the step takes.
        schema: describes it.
        names: known names; ``unsuited`` are fields that the arm cannot have.
        name: the step for people.
    """
    properties = [kind.get("properties", ()) for kind in _variants(schema)]
    words = [f"{key} ".replace("_", " ") for keys in properties for key in keys]

    def place(field: StepValue) -> int:
        # The name of a part begins with that of the whole.
        return next((i for i, word in enumerate(words) if f"{field.name} ".startswith(word)), -1)

    fields = [*values_of(value, schema, names, name), *_absent(value, schema, names)]
    return sorted(fields, key=place)


def _absent(value: YamlValue, schema: Schema, names: Names) -> Iterator[StepValue]:
    """Yield the plain values that the step ``value``, which ``schema`` describes, may also have."""
    mappings = [kind for kind in _variants(schema) if "properties" in kind]
    line, column, end, after = value.line, value.column, value.end, ""
    if value.kind == "mapping":
        present = tuple(str(key.held) for key, _ in value.fields)
        first, last = value.fields[0][0], value.fields[-1][1]
        is_flow = (line, column) != (first.line, first.column)
        before = ", " if is_flow else "\n" + " " * (first.column - 1)
        line, column = last.line, last.end
        if not last.end:
            line, column, before, after = first.line, first.column, "", before
        end = column
    elif value.end and mappings and len(mappings[0]["required"]) == 1:
        present = tuple(mappings[0]["required"])
        is_plain = PLAIN_TEXT.fullmatch(str(value.held)) and end - column == len(str(value.held))
        text = value.held if is_plain else json.dumps(value.held, ensure_ascii=False)
        before, after = f"{{{present[0]}: {text}, ", "}"
    else:
        return
    mapping = next((kind for kind in mappings if set(present) <= set(kind["properties"])), {})
    excluded = mapping.get("not", {}).get("required", ())
    hidden = {*present, *names.get("unsuited", ())}
    hidden |= set(excluded if set(excluded) & set(present) else ())
    for name, part in mapping.get("properties", {}).items():
        variants = tuple(_variants(part))
        types = {kind.get("type", "string") for kind in variants if {"type", "enum"} & set(kind)}
        if types and types <= {"string", "number"} and name not in hidden:
            empty = YamlValue(line, column, None, "number", end=end)
            field = _scalar(empty, variants, names, name.replace("_", " "))
            yield msgspec.structs.replace(field, before=f"{before}{name}: ", after=after)


def _scalar(value: YamlValue, variants: Iterable[Schema], names: Names, name: str) -> StepValue:
    text = "" if value.held is None else str(value.held)
    numeric = next((kind for kind in variants if kind.get("type") == "number"), None)
    words = [word for kind in variants for word in kind.get("enum", ())]
    words += (word for kind in variants for word in names.get(kind.get("names", ""), ()))
    about = next((kind["description"] for kind in variants if "description" in kind), "")
    step = 0.0
    if numeric is not None and value.kind in ("whole", "number"):
        # Its field takes numbers alone.
        about = about.partition(", or a text")[0]
        step = FINE_STEP if numeric["maximum"] - numeric["minimum"] <= FINE_RANGE else 1.0
    return StepValue(
        name,
        value.line,
        value.column,
        value.end,
        text,
        about,
        "" if numeric is None else numeric.get("unit", ""),
        step,
        tuple(dict.fromkeys((text, *words) if numeric is None else words)) if words else (),
        numeric is not None,
    )


def _variants(schema: Schema) -> Iterator[Schema]:
    """Yield ``schema`` and what it allows, with the schemas to which it refers."""
    yield schema
    if "$ref" in schema:
        yield from _variants(DEFINITIONS[schema["$ref"].rpartition("/")[2]])
    for option in schema.get("anyOf", ()):
        yield from _variants(option)
