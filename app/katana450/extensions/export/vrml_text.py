"""Text of VRML97 values and worlds."""

from __future__ import annotations

import re

from katana450.extensions.export.vrml_node import (
    FIELDS,
    LISTS,
    WIDTHS,
    Node,
    Type,
    Use,
    Value,
    World,
)

HEADER = "#VRML V2.0 utf8"
"""First line of a file."""

LINE = 16
"""Rows of numbers per line: few enough for old readers, enough for small files."""

_ZERO_AFTER = re.compile(r"\.0(?![0-9e])")


def world_text(world: World) -> str:
    """Return the text of a file; floats are written so that they can be read back exactly."""
    parts = [HEADER, "\n"]
    for node in world.nodes:
        _write(parts, node, 0)
    parts += [f"ROUTE {r.source}.{r.out} TO {r.target}.{r.into}\n" for r in world.routes]
    return "".join(parts)


def _write(parts: list[str], node: Node | Use | str | float, depth: int) -> None:
    indent = " " * depth
    if isinstance(node, Use):
        parts.append(f"{indent}USE {node.name}\n")
        return
    assert isinstance(node, Node)
    parts.append(f"{indent}{'' if node.name is None else f'DEF {node.name} '}{node.kind} {{\n")
    for name, value in node.fields:
        kind = FIELDS[node.kind][name]
        if kind is Type.NODE:
            assert isinstance(value, Node | Use)
            parts.append(f"{indent} {name}\n")
            _write(parts, value, depth + 1)
        elif kind is Type.NODE_LIST:
            assert isinstance(value, tuple)
            parts.append(f"{indent} {name} [\n")
            for child in value:
                _write(parts, child, depth + 2)
            parts.append(f"{indent} ]\n")
        else:
            parts.append(f"{indent} {name} {_plain(kind, value)}\n")
    parts.append(f"{indent}}}\n")


def _plain(kind: Type, value: Value) -> str:
    if isinstance(value, bool):
        return "TRUE" if value else "FALSE"
    if isinstance(value, str):
        return _quoted(value)
    if isinstance(value, float | int):
        return _short(repr(value))
    assert isinstance(value, tuple)
    if kind is Type.STRING_LIST:
        return f"[ {' '.join(_quoted(str(text)) for text in value)} ]"
    numbers = list(map(repr, value))
    if kind not in LISTS:
        return _short(" ".join(numbers))
    step = WIDTHS[kind] * LINE
    rows = [" ".join(numbers[at : at + step]) for at in range(0, len(numbers), step)]
    return "[" + _short("\n".join(rows)) + "]"


def _quoted(text: str) -> str:
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'


def _short(numbers: str) -> str:
    """Write 2 for 2.0. The zero of 0.5 stays: VTK reads .0122 as 0."""
    return _ZERO_AFTER.sub("", numbers)
