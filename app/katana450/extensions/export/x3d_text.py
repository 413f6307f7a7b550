"""The text of a world as X3D in its XML encoding (ISO/IEC 19776-1), with the nodes of VRML97."""

from __future__ import annotations

from collections.abc import Mapping
from xml.sax.saxutils import quoteattr

from katana450.extensions.export.vrml_node import FIELDS, WIDTHS, Node, Type, Use, Value, World

HEADER = (
    '<?xml version="1.0" encoding="UTF-8"?>\n'
    '<!DOCTYPE X3D PUBLIC "ISO//Web3D//DTD X3D 3.3//EN" '
    '"https://www.web3d.org/specifications/x3d-3.3.dtd">\n'
    '<X3D profile="Immersive" version="3.3" '
    'xmlns:xsd="http://www.w3.org/2001/XMLSchema-instance" '
    'xsd:noNamespaceSchemaLocation="https://www.web3d.org/specifications/x3d-3.3.xsd">\n'
    "<Scene>\n"
)
"""Beginning of a file: the profile that has Switch, sensors and interpolators."""

ROWS_A_LINE = 16
"""Rows of numbers per line."""


def x3d_text(world: World) -> str:
    """Return the text of a file; floats are written so that they can be read back exactly."""
    kinds = {name: node.kind for name, node in world.named().items()}
    parts = [HEADER]
    for node in world.nodes:
        _write(parts, node, kinds)
    for route in world.routes:
        parts.append(
            f'<ROUTE fromNode="{route.source}" fromField="{route.out}" '
            f'toNode="{route.target}" toField="{route.into}"/>\n'
        )
    return "".join([*parts, "</Scene>\n</X3D>\n"])


def _write(parts: list[str], node: Node | Use, kinds: Mapping[str, str]) -> None:
    """Add the element of ``node``; ``kinds``: the kind of each node with a DEF name."""
    if isinstance(node, Use):
        parts.append(f'<{kinds[node.name]} USE="{node.name}"/>\n')
        return
    parts.append(f"<{node.kind}" + ("" if node.name is None else f' DEF="{node.name}"'))
    inside: list[Node | Use] = []
    for name, value in node.fields:
        kind = FIELDS[node.kind][name]
        if kind in (Type.NODE, Type.NODE_LIST):
            # A reference is a tuple too.
            each = value if kind is Type.NODE_LIST and isinstance(value, tuple) else (value,)
            inside += [part for part in each if isinstance(part, Node | Use)]
        else:
            parts.append(f" {name}={_attribute(kind, value)}")
    if not inside:
        parts.append("/>\n")
        return
    parts.append(">\n")
    for child in inside:
        _write(parts, child, kinds)
    parts.append(f"</{node.kind}>\n")


def _attribute(kind: Type, value: Value) -> str:
    """Return the value of a field in quotes."""
    if isinstance(value, bool):
        return '"true"' if value else '"false"'
    if isinstance(value, str):
        return quoteattr(value)
    if isinstance(value, float | int):
        return f'"{_number(value)}"'
    assert isinstance(value, tuple)
    if kind is Type.STRING_LIST:
        texts = (str(each).replace("\\", "\\\\").replace('"', '\\"') for each in value)
        return quoteattr(" ".join(f'"{each}"' for each in texts))
    numbers = [_number(each) for each in value if isinstance(each, float | int)]
    step = WIDTHS[kind] * ROWS_A_LINE
    rows = [" ".join(numbers[at : at + step]) for at in range(0, len(numbers), step)]
    return '"' + "\n".join(rows) + '"'


def _number(value: float) -> str:
    return repr(value).removesuffix(".0")
