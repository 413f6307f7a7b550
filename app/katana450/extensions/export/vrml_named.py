"""Nodes and fields of a running world by name, and the orders of one message to them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from katana450.arm.control import commands as cmd
from katana450.arm.control.state import State
from katana450.extensions.export.vrml_node import Type
from katana450.maths.geometry.arrays import FloatArray

FieldValue = float | list[float]
"""The value of a field: one number or several."""


class FieldOrders:
    """The orders of one message, collected until all of it is parsed.

    Attributes:
        state: the present state.
        axes: targets of axes [rad, m], by their numbers.
        position: (3,) [m] target of the tool in the root's frame; None without one.
        R: (3, 3) target of the tool in the root's frame; None without one.
        others: further commands.
    """

    def __init__(self, state: State) -> None:
        """Begin without orders."""
        self.state = state
        self.axes: dict[int, float] = {}
        self.position: FloatArray | None = None
        self.R: FloatArray | None = None
        self.others: list[cmd.Command] = []


@dataclass(frozen=True, eq=False)
class NamedField:
    """A field of a node.

    Attributes:
        type: its type.
        read: function that returns its value.
        put: function that sets it; None if it can only be read.
        why: reason why it can only be read, with what to do; empty if there is nothing to say.
    """

    type: Type
    read: Callable[[State], FieldValue]
    put: Callable[[FieldOrders, FieldValue | None], None] | None = None
    why: str = ""


@dataclass(frozen=True, eq=False)
class NamedNode:
    """A node: its kind, the object that it belongs to, and its fields."""

    kind: str
    of: str
    fields: Mapping[str, NamedField]
