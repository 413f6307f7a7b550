"""Tolerant parser of VRML 1.0: nodes with their fields, and the nodes inside them.

Source: G. Bell, A. Parisi, M. Pesce, The Virtual Reality Modeling Language, version 1.0 (1996). A
node of an unknown kind is parsed as any other, since a word before a brace is a node and any other
word a field.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field

from katana450.extensions.importers.vrml_reader import MAX_DEPTH, NUMBERS, Reader

Item = float | str
"""A value: a number, or a text or word."""

BEGINNING = re.compile(r"\"|[+-]?\.?[0-9]")
"""Beginning of a text or number. File names without quotes are words."""

HEXADECIMAL = re.compile(r"0[xX][0-9a-fA-F]{1,8}")
"""A number of base 16, as in pictures."""


@dataclass(frozen=True, eq=False)
class Node1:
    """A node of VRML 1.0.

    Attributes:
        kind: name of its kind.
        fields: values of each field that is set.
        children: nodes inside it, in their order.
    """

    kind: str
    fields: dict[str, tuple[Item, ...]] = field(default_factory=dict)
    children: list[Node1] = field(default_factory=list)

    def numbers(self, name: str, default: tuple[float, ...]) -> tuple[float, ...]:
        """Return the numbers of a field; ``default`` if it is not set."""
        values = self.fields.get(name)
        return default if values is None else tuple(v for v in values if not isinstance(v, str))

    def words(self, name: str) -> tuple[str, ...]:
        """Return the texts or words of a field."""
        return tuple(v for v in self.fields.get(name, ()) if isinstance(v, str))


def parsed_vrml1(text: str, name: str) -> list[Node1]:
    """Return the nodes of a world of the file ``name``. Raises InputError with the line."""
    return _Reader1(text, name).nodes()


class _Reader1(Reader):
    """A parser of the nodes of a file."""

    def __init__(self, text: str, name: str) -> None:
        super().__init__(text, name)
        self._nodes: dict[str, Node1] = {}

    def nodes(self) -> list[Node1]:
        """Return the nodes of the file, of which the standard allows only one."""
        found: list[Node1] = []
        while self._ahead:
            found.append(self._node1(self._take(), 0))
        return found

    def _node1(self, token: str, depth: int) -> Node1:
        """Return the node that begins with ``token``."""
        if depth > MAX_DEPTH:
            raise self._error(f"nodes are nested more than {MAX_DEPTH} deep")
        if token == "USE":
            used = self._take()
            return self._nodes.get(used) or Node1("a node that is used, but not defined")
        name: str | None = None
        if token == "DEF":
            name, token = self._take(), self._take()
        if token in "{}[]" or token.startswith('"') or self._ahead != "{":
            raise self._error(f"expected a node, not {token!r}")
        self._take()
        node = Node1(token)
        if name is not None:
            self._nodes[name] = node
        while self._ahead != "}":
            word = self._take()
            if word in ("DEF", "USE") or self._ahead == "{":
                node.children.append(self._node1(word, depth + 1))
            elif word in "[]" or word.startswith('"'):
                raise self._error(f"expected a field or node, not {word!r}")
            else:
                node.fields[word] = self._values()
                if self._ahead == "{":
                    # The value was the kind of a node, which no standard field has.
                    self._node1(str(node.fields.pop(word)[-1]), depth + 1)
        self._take()
        return node

    def _values(self) -> tuple[Item, ...]:
        """Return the values of a field after its name."""
        if self._ahead == "[":
            plain = self._row(NUMBERS, float)
            return tuple(self._items(self._item)) if plain is None else plain
        found: list[Item] = []
        if self._ahead.startswith("("):
            # Words that can be combined: (SIDES | TOP).
            while not (found and str(found[-1]).endswith(")")):
                found.append(self._take())
            return tuple(re.findall(r"[A-Za-z_]+", " ".join(map(str, found))))
        while BEGINNING.match(self._ahead):
            found.append(self._item())
        if not found:
            found.append(self._item())
        if self._ahead == "~":
            self._take()
        return tuple(found)

    def _item(self) -> Item:
        token = self._ahead
        if token[:1] == '"':
            return self._string()
        if BEGINNING.match(token):
            if not HEXADECIMAL.fullmatch(token):
                return self._float()
            return float(int(self._take(), 16))
        if token in ("{", "}", "[", "]"):
            raise self._error(f"expected a value, not {token!r}")
        return self._take()
