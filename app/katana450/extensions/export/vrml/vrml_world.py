"""A VRML97 world as values, and its text in VRML97 and in X3D's XML encoding (ISO/IEC 19776-1).

The form of a value shows the type of its field, so that no table of types is needed. Floats are
written so that they can be read back exactly.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple
from xml.sax.saxutils import quoteattr

import numpy as np

from katana450.maths.geometry import so3
from katana450.maths.geometry.arrays import FloatArray

KEYWORDS = frozenset(
    [
        *("DEF", "EXTERNPROTO", "FALSE", "IS", "NULL", "PROTO", "ROUTE", "TO", "TRUE", "USE"),
        *("eventIn", "eventOut", "exposedField", "field"),
    ]
)
"""Reserved words of VRML97, which no node may have as its name."""


class Use(NamedTuple):
    """A reference (USE) to the node whose DEF name is ``name``."""

    name: str


@dataclass(frozen=True)
class Node:
    """A node of a VRML world.

    The value of a field is a bool, float, str, Node or Use; a tuple of the numbers of a vector; or
    a list. A list of vectors is one flat list of numbers.

    Attributes:
        kind: type name of the node, such as ``Transform``.
        fields: name and value of each field that is set.
        name: its DEF name; None without one.
    """

    kind: str
    fields: tuple[tuple[str, Value], ...] = ()
    name: str | None = None

    def get(self, field: str) -> Value | None:
        """Return the value of a field; None if it is not set."""
        return next((value for name, value in self.fields if name == field), None)

    def walk(self) -> Iterator[Node]:
        """Yield this node, then all nodes inside it, in the order in which a file has them."""
        yield self
        for _, value in self.fields:
            for part in value if isinstance(value, list) else (value,):
                if isinstance(part, Node):
                    yield from part.walk()


Value = bool | float | str | Node | Use | tuple[float, ...] | list[Any]
"""The value of a field."""


@dataclass(frozen=True)
class World:
    """The content of a VRML file: its top-level nodes."""

    nodes: tuple[Node, ...]

    def named(self) -> dict[str, Node]:
        """Return every node with a DEF name, by that name."""
        return {n.name: n for top in self.nodes for n in top.walk() if n.name is not None}


def axis_angle(R: FloatArray) -> list[float]:
    """Return the rotation (3, 3) as an axis and an angle [rad]."""
    w = so3.log(R)
    angle = float(np.linalg.norm(w))
    return [*(w / angle).tolist(), angle] if angle else [0.0, 0.0, 1.0, 0.0]


HEADER = "#VRML V2.0 utf8"
"""First line of a VRML file."""

X3D_HEADER = (
    '<?xml version="1.0" encoding="UTF-8"?>\n'
    '<!DOCTYPE X3D PUBLIC "ISO//Web3D//DTD X3D 3.3//EN" '
    '"https://www.web3d.org/specifications/x3d-3.3.dtd">\n'
    '<X3D profile="Immersive" version="3.3" '
    'xmlns:xsd="http://www.w3.org/2001/XMLSchema-instance" '
    'xsd:noNamespaceSchemaLocation="https://www.web3d.org/specifications/x3d-3.3.xsd">\n'
    "<Scene>\n"
)
"""Beginning of an X3D file: the profile is Immersive."""

NUMBERS_A_LINE = 48
"""Numbers per line: few enough for old readers, enough for small files."""

_ZERO_AFTER = re.compile(r"\.0(?![0-9e])")


def world_text(world: World) -> str:
    """Return the text of a VRML file."""
    parts = [HEADER, "\n"]
    for node in world.nodes:
        _write(parts, node, 0)
    return "".join(parts)


def x3d_text(world: World) -> str:
    """Return the text of an X3D file."""
    kinds = {name: node.kind for name, node in world.named().items()}
    parts = [X3D_HEADER]
    for node in world.nodes:
        _write_element(parts, node, kinds)
    return "".join([*parts, "</Scene>\n</X3D>\n"])


def _write(parts: list[str], node: Node | Use, depth: int) -> None:
    """Add the text of ``node`` in VRML."""
    indent = " " * depth
    if isinstance(node, Use):
        parts.append(f"{indent}USE {node.name}\n")
        return
    parts.append(f"{indent}{'' if node.name is None else f'DEF {node.name} '}{node.kind} {{\n")
    for name, value in node.fields:
        children = _children(value)
        if not children:
            text = _quoted(value) if isinstance(value, str) else _plain(value)
            text = text.upper() if isinstance(value, bool) else text
            text = f"[ {text} ]" if isinstance(value, list) else text
            parts.append(f"{indent} {name} {text}\n")
            continue
        is_list = isinstance(value, list)
        parts.append(f"{indent} {name}{' [' if is_list else ''}\n")
        for child in children:
            _write(parts, child, depth + 2)
        if is_list:
            parts.append(f"{indent} ]\n")
    parts.append(f"{indent}}}\n")


def _write_element(parts: list[str], node: Node | Use, kinds: Mapping[str, str]) -> None:
    """Add the element of ``node``; ``kinds``: the kind of each node with a DEF name."""
    if isinstance(node, Use):
        parts.append(f'<{kinds[node.name]} USE="{node.name}"/>\n')
        return
    parts.append(f"<{node.kind}" + ("" if node.name is None else f' DEF="{node.name}"'))
    children: list[Node | Use] = []
    for name, value in node.fields:
        children += _children(value)
        # A field of no nodes cannot be told from another list without values: both are defaults.
        if _children(value) or value == []:
            continue
        if isinstance(value, str) or (isinstance(value, list) and isinstance(value[0], str)):
            attribute = quoteattr(value if isinstance(value, str) else _plain(value))
        else:
            # The ends of lines between numbers stay as they are.
            attribute = f'"{_plain(value)}"'
        parts.append(f" {name}={attribute}")
    if not children:
        parts.append("/>\n")
        return
    parts.append(">\n")
    for child in children:
        _write_element(parts, child, kinds)
    parts.append(f"</{node.kind}>\n")


def _children(value: Value) -> list[Node | Use]:
    """Return the nodes in the value of a field; none for another field."""
    items = value if isinstance(value, list) else [value]
    return [item for item in items if isinstance(item, Node | Use)]


def _plain(value: Value) -> str:
    """Return a value other than nodes and a single text, as both formats write it."""
    if isinstance(value, bool):
        return str(value).lower()
    items = value if isinstance(value, list | tuple) else (value,)
    words = [_quoted(item) if isinstance(item, str) else repr(item) for item in items]
    starts = range(0, len(words), NUMBERS_A_LINE)
    text = "\n".join(" ".join(words[start : start + NUMBERS_A_LINE]) for start in starts)
    # 2 for 2.0. The zero of 0.5 stays: VTK reads .0122 as 0.
    return text if words and words[0].startswith('"') else _ZERO_AFTER.sub("", text)


def _quoted(text: str) -> str:
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'
