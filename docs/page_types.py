"""Write ``tests/javascript/types.d.ts``: the types of acts and answers that check the page.

Run it with ``python -m docs.page_types``.
"""

from __future__ import annotations

import json
import textwrap
from pathlib import Path
from typing import Any

import msgspec

from docs.api import added_requests
from katana450.arm.control.commands.checked import field_schema
from katana450.extensions.programs.script.blocks import TextBlock
from katana450.extensions.robot_choice.robot_routes import Choices
from katana450.server.api import answers, requests

FILE = Path(__file__).resolve().parents[1] / "tests" / "javascript" / "types.d.ts"

HEAD = """\
// Written by `python -m docs.page_types` from the classes of the acts and answers.
declare namespace Api {
"""

OF_PAGE = (TextBlock, Choices)
"""Answers to the page alone, beside those of the API."""

LINE_LENGTH = 120

NO_BREAK = "\0"
"""Stands for a space at which no line ends."""

SIMPLE = {
    "string": "string",
    "number": "number",
    "integer": "number",
    "boolean": "boolean",
    "null": "null",
}
"""Types of TypeScript by those of JSON Schema."""


def content() -> str:
    """Return the content of the file."""
    acts = [*requests.CORE, *(kind for kinds in added_requests().values() for kind in kinds)]
    lines: list[str] = []
    groups = (("Act", acts, True), ("Answer", answers.EVERY, False), ("Page", OF_PAGE, True))
    for title, kinds, omitted in groups:
        components = msgspec.json.schema_components(kinds, schema_hook=field_schema)[1]
        for name, schema in components.items():
            # Acts may leave out every default; of answers only the outer object does.
            lines += _declared(name, schema, omitted or "is" in schema.get("properties", {}))
        names = " | ".join(sorted(kind.__name__ for kind in kinds))
        lines += _wrapped(f"type {title} = {names};")
    # A class that acts and answers share is declared by the first.
    declared = {text.split()[1]: text for text in reversed(lines)}
    return f"{HEAD}{''.join(declared[name] for name in sorted(declared))}}}\n"


def _declared(name: str, schema: dict[str, Any], omitted: bool) -> list[str]:
    if "enum" in schema:
        return _wrapped(f"type {name} = {_type(schema)};")
    fields = []
    for field, kind in schema["properties"].items():
        mark = "?" if omitted and field not in schema.get("required", ()) else ""
        fields.append(f"{field}{mark}: {_type(kind)};".replace(" ", NO_BREAK))
    return _wrapped(f"interface {name} {{ {' '.join(fields)} }}")


def _type(schema: dict[str, Any]) -> str:
    """Return the type of TypeScript for a JSON Schema."""
    if "$ref" in schema:
        return str(schema["$ref"].rpartition("/")[2])
    if "anyOf" in schema:
        return " | ".join(dict.fromkeys(_type(option) for option in schema["anyOf"]))
    if "enum" in schema:
        return " | ".join(json.dumps(value) for value in schema["enum"])
    if schema.get("type") == "array":
        if "prefixItems" in schema:
            return f"[{', '.join(_type(member) for member in schema['prefixItems'])}]"
        member = _type(schema["items"])
        return f"({member})[]" if " " in member else f"{member}[]"
    if schema.get("type") == "object":
        values = schema.get("additionalProperties", {})
        return f"Record<string, {_type(values) if isinstance(values, dict) else 'unknown'}>"
    return SIMPLE.get(schema.get("type", ""), "unknown")


def _wrapped(text: str) -> list[str]:
    """Return ``text`` as one entry, in lines of at most LINE_LENGTH characters.

    A line may end after a field, or within a union of classes.
    """
    lines = textwrap.wrap(
        text,
        LINE_LENGTH,
        initial_indent="  ",
        subsequent_indent="    ",
        break_long_words=False,
        break_on_hyphens=False,
    )
    return ["\n".join(lines).replace(NO_BREAK, " ") + "\n"]


if __name__ == "__main__":
    FILE.write_text(content(), encoding="utf-8")
