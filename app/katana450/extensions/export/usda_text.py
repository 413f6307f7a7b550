"""Text of scenes in USD's text format (.usda): prims, their properties, and values."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from katana450.maths.geometry.arrays import FloatArray, IntArray

INDENT = "    "


@dataclass
class Prim:
    """An element of the scene.

    Attributes:
        kind: its schema, such as Xform.
        name: an identifier, unique among its siblings.
        schemas: further schemas that are applied to it.
        properties: declarations, such as ``uniform token purpose``, with their values as text;
            None for a declaration without a value.
        children: the prims in it.
    """

    kind: str
    name: str
    schemas: Sequence[str] = ()
    properties: dict[str, str | None] = field(default_factory=dict)
    children: list[Prim] = field(default_factory=list)

    def lines(self) -> Iterator[str]:
        """Yield the lines of its text."""
        yield f"def {self.kind} {quoted(self.name)}"
        if self.schemas:
            yield "("
            yield f"{INDENT}prepend apiSchemas = [{', '.join(map(quoted, self.schemas))}]"
            yield ")"
        yield "{"
        for declaration, value in self.properties.items():
            yield INDENT + (declaration if value is None else f"{declaration} = {value}")
        for child in self.children:
            for line in child.lines():
                yield INDENT + line
        yield "}"


def usda_text(root: Prim, comment: str, beside: Sequence[Prim] = ()) -> str:
    """Return the text of a stage in metres and kilograms, z up, with the default prim ``root``.

    Other files that refer to the stage get its default prim without the prims ``beside`` it.
    """
    head = (
        "#usda 1.0",
        "(",
        f"{INDENT}defaultPrim = {quoted(root.name)}",
        f"{INDENT}doc = {quoted(comment)}",
        f"{INDENT}kilogramsPerUnit = 1",
        f"{INDENT}metersPerUnit = 1",
        f'{INDENT}upAxis = "Z"',
        ")",
        "",
    )
    others = [line for prim in beside for line in ("", *prim.lines())]
    return "\n".join((*head, *root.lines(), *others, ""))


def quoted(text: str) -> str:
    """Return ``text`` as a string."""
    plain = text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n")
    return f'"{plain}"'


def number(value: float) -> str:
    """Return a number, infinite or exact."""
    if np.isinf(value):
        return "inf" if value > 0.0 else "-inf"
    return repr(float(value) + 0.0)


def vector(values: Sequence[float] | FloatArray) -> str:
    """Return a tuple of numbers: a vector, or a quaternion with its real part first."""
    return f"({', '.join(number(value) for value in values)})"


def matrix(T: FloatArray) -> str:
    """Return a pose (4, 4); USD multiplies row vectors, so its matrices are transposed."""
    return f"( {', '.join(vector(row) for row in T.T)} )"


def points(rows: FloatArray, digits: int) -> str:
    """Return an array of vectors (n, 3), rounded to ``digits`` decimal places."""
    rounded = (np.round(rows, digits) + 0.0).tolist()
    return f"[{', '.join(f'({x:g}, {y:g}, {z:g})' for x, y, z in rounded)}]"


def whole(values: IntArray) -> str:
    """Return an array of whole numbers."""
    return f"[{', '.join(map(str, values.tolist()))}]"
