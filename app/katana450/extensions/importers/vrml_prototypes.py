"""Prototypes of VRML97, and their expansion into plain nodes.

Source: ISO/IEC 14772-1:1997, 4.8 Prototype semantics.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

from katana450.errors import InputError
from katana450.extensions.export.vrml_node import Node, Type, Value

MAX_EXPANDED = 100_000
"""Maximum number of nodes that the prototypes of a file make."""

IS = "IS"
"""Kind of a placeholder: a node whose name is that of the field of the prototype it stands for."""

Values = Mapping[str, tuple[Type | None, Value]]
"""Types and values of the fields of an instance."""

NO_VALUES: Values = MappingProxyType({})
"""Values of the fields outside of any prototype."""


@dataclass(frozen=True, eq=False)
class Prototype:
    """A declared kind of node.

    Attributes:
        types: type of each field; None for a type without a meaning for surfaces.
        defaults: values of the fields that an instance does not set.
        body: the node it stands for, with placeholders.
    """

    types: Mapping[str, Type | None]
    defaults: Mapping[str, Value]
    body: Node


@dataclass(frozen=True, eq=False)
class Instance(Node):
    """A node of a declared kind, which is not expanded yet."""

    prototype: Prototype = field(default_factory=lambda: Prototype({}, {}, Node("NULL")))


class PrototypeExpansion:
    """Expands the instances in trees of nodes; what holds none is shared, not copied."""

    def __init__(self, name: str) -> None:
        """Prepare the file ``name``."""
        self._name = name
        self._count = 0
        self._plain: dict[int, bool] = {}
        self._done: dict[tuple[int, int], tuple[Node, Values, Node]] = {}

    def expanded(self, node: Node) -> Node:
        """Return ``node`` without instances. Raises InputError if there are too many nodes."""
        return self._resolved(node, NO_VALUES)

    def _resolved(self, node: Node, values: Values) -> Node:
        if self._is_plain(node):
            return node
        # Node and values are kept too, since a new object may get the number of a deleted one.
        key = (id(node), id(values))
        if key not in self._done:
            self._done[key] = (node, values, self._made(node, values))
        return self._done[key][2]

    def _made(self, node: Node, values: Values) -> Node:
        self._count += 1
        if self._count > MAX_EXPANDED:
            raise InputError(f"{self._name} has prototypes that make over {MAX_EXPANDED} nodes.")
        fields: dict[str, Value] = {}
        for name, value in node.fields:
            found = self._value(value, values)
            if found is not None:
                fields[name] = found
        if not isinstance(node, Instance):
            return Node(node.kind, tuple(fields.items()), node.name)
        prototype = node.prototype
        inner: dict[str, tuple[Type | None, Value]] = {}
        for name, kind in prototype.types.items():
            given = fields.get(name, self._value(prototype.defaults[name], NO_VALUES))
            if given is not None:
                inner[name] = (kind, given)
        return self._resolved(prototype.body, inner)

    def _value(self, value: Value, values: Values) -> Value | None:
        """Return ``value`` without instances; None if it stands for no value of its type."""
        if isinstance(value, Node) and value.kind == IS:
            kind, found = values.get(value.name or "", (None, None))
            return found if kind is not None and kind.value == value.get("type") else None
        if isinstance(value, Node):
            return self._resolved(value, values)
        if isinstance(value, tuple) and any(isinstance(each, Node) for each in value):
            nodes = (each for each in value if isinstance(each, Node))
            return tuple(self._resolved(each, values) for each in nodes)
        return value

    def _is_plain(self, node: Node) -> bool:
        """Return whether the tree of ``node`` has neither instances nor placeholders."""
        key = id(node)
        if key not in self._plain:
            self._plain[key] = not (isinstance(node, Instance) or node.kind == IS) and all(
                self._is_plain(part)
                for _, value in node.fields
                for part in (value if isinstance(value, tuple) else (value,))
                if isinstance(part, Node)
            )
        return self._plain[key]
