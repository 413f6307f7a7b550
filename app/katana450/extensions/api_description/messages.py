"""The message classes of the API, their documentation, and their JSON Schema."""

from __future__ import annotations

import inspect
import re
from typing import Any, Union

import msgspec

from katana450.arm.control.act import Request
from katana450.arm.control.checked import field_schema
from katana450.server.api import answers

TITLE = "katana450"

LICENSE = {"name": "MIT", "identifier": "MIT"}

ABOUT = (
    "Every message is a JSON object: `do` names a request, `is` an answer. Lengths are in m, "
    "angles in rad, times in s, unless a field says otherwise. One client at a time holds the "
    "lease, the right to drive. Everybody may stop the arm at any time."
)
"""Description of the API."""

REFERENCE = "#/components/schemas/{name}"
"""Reference to the schema of a class."""


def summary(kind: type) -> str:
    """Return the first line of the docstring of ``kind``."""
    return (inspect.getdoc(kind) or "").partition("\n")[0]


def documentation(kind: type) -> tuple[str, dict[str, str]]:
    """Return the docstring of ``kind`` as Markdown, and its ``Attributes`` by their names.

    These include the ones that it inherits.
    """
    text, fields = _divided(inspect.getdoc(kind) or "")
    for base in kind.__mro__[1:]:
        if issubclass(base, msgspec.Struct):
            fields = _divided(inspect.cleandoc(base.__doc__ or ""))[1] | fields
    return text, fields


def schemas(asked: tuple[type[Request], ...]) -> tuple[dict[str, Any], dict[str, Any], Any]:
    """Return the schemas of a request and of an answer, and those of all classes by name.

    Each field is described by the entry of its class under ``Attributes``. ``asked``: the requests
    of the server.
    """
    shapes: list[Any] = [Union[asked], Union[answers.EVERY]]  # noqa: UP007
    (request, answer), components = msgspec.json.schema_components(
        shapes, schema_hook=field_schema, ref_template=REFERENCE
    )
    components = {name: _portable(schema) for name, schema in components.items()}
    messages = {each.__name__: each for each in (*asked, *answers.EVERY)}
    for name, schema in components.items():
        text, fields = _divided(inspect.cleandoc(schema.get("description", "")))
        if name in messages:
            text, fields = documentation(messages[name])
        schema["description"] = text
        for field, about in fields.items():
            if field in schema.get("properties", ()):
                schema["properties"][field]["description"] = about
    return request, answer, components


def _portable(schema: Any) -> Any:
    """Return an equal of ``schema`` from which programs can generate clients.

    They cannot read the ``"items": false`` after the items of a tuple, so items that are alike get
    one schema. Of an enumeration with one value they would make a class.
    """
    if isinstance(schema, list):
        return [_portable(part) for part in schema]
    if not isinstance(schema, dict):
        return schema
    first, *others = schema.get("prefixItems", (None,))
    if first is not None and all(item == first for item in others):
        schema = {name: part for name, part in schema.items() if name != "prefixItems"}
        schema["items"] = first
    if len(schema.get("enum", ())) == 1:
        schema = {"const": schema["enum"][0]}
    return {name: _portable(part) for name, part in schema.items()}


def _divided(doc: str) -> tuple[str, dict[str, str]]:
    """Return the text of a docstring without its ``Attributes``, and these by their names."""
    text, _, attributes = doc.replace("``", "`").partition("Attributes:\n")
    entries = re.findall(r"^ {4}(\w+): (.*(?:\n {8}.*)*)", attributes, flags=re.MULTILINE)
    return text.rstrip(), {name: " ".join(about.split()) for name, about in entries}
