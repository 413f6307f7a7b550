"""A VRML97 world as values: nodes with their fields, and routes between their events.

The form of a value shows the type of its field, so that no table of types is needed.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

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


class Route(NamedTuple):
    """A route that passes each event of one node on to another node.

    Attributes:
        source: DEF name of the node that sends the event.
        out: name of the event that it sends.
        target: DEF name of the node that receives the event.
        into: name of the event that it receives.
    """

    source: str
    out: str
    target: str
    into: str


@dataclass(frozen=True)
class World:
    """The content of a VRML file: its top-level nodes, and its routes."""

    nodes: tuple[Node, ...]
    routes: tuple[Route, ...] = ()

    def named(self) -> dict[str, Node]:
        """Return every node with a DEF name, by that name."""
        return {n.name: n for top in self.nodes for n in top.walk() if n.name is not None}


def axis_angle(R: FloatArray) -> list[float]:
    """Return the rotation (3, 3) as an axis and an angle [rad]."""
    w = so3.log(R)
    angle = float(np.linalg.norm(w))
    return [*(w / angle).tolist(), angle] if angle else [0.0, 0.0, 1.0, 0.0]
