"""Strict parser for the text of VRML97, which reads what this project exports."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping
from typing import TypeVar

from katana450.errors import InputError
from katana450.extensions.export.vrml_node import (
    EVENTS,
    FIELDS,
    KEYWORDS,
    LISTS,
    SETTERS,
    WIDTHS,
    Node,
    Route,
    Type,
    Use,
    Value,
    World,
)

T = TypeVar("T")
N = TypeVar("N", int, float)

MAX_QUOTED_CHARACTERS = 160
"""Maximum length of a quotation from a file in an error message."""

MAX_DEPTH = 200
"""Maximum nesting of nodes, within the limit of Python's stack."""

VALUES = '["+-.0123456789'
"""Beginnings of values that are no nodes."""

# Possessive quantifiers, so that a mismatch in an untrusted file fails without backtracking.
_TOKEN = re.compile(
    r'[\s,]*+(?:#[^\n\r]*+[\s,]*+)*+("(?:[^"\\]|\\.)*+"|[\[\]{}]|[^\s,"#\[\]{}]+|$)', re.DOTALL
)
_NUMBER = re.compile(r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")
_INTEGER = re.compile(r"[+-]?(?:[0-9]{1,10}|0[xX][0-9a-fA-F]{1,8})")
NUMBERS, INTEGERS = (
    re.compile(rf"\s*(?:{one}\s+)*+(?:{one})?+") for one in (_NUMBER.pattern, "[+-]?[0-9]{1,10}")
)
_NAME = re.compile(r"[^\x00-\x20\"#',.\[\]\\{}\x7f0-9+-][^\x00-\x20\"#',.\[\]\\{}\x7f]*")


class Reader:
    """A parser of the nodes in a table of fields; it refuses all others."""

    fields = FIELDS

    def __init__(self, text: str, name: str) -> None:
        """Parse ``text`` of the file ``name``, which is used in messages."""
        self._text, self._name = text, name
        self._at = self._next = 0
        self._tokens = self._scan()
        self._ahead = next(self._tokens)
        self._named: dict[str, Node | None] = {}

    def world(self) -> World:
        """Return the content of the file. Raises InputError with the line of an error."""
        nodes: list[Node] = []
        routes: list[Route] = []
        while self._ahead:
            if self._ahead == "ROUTE":
                routes.append(self._route())
            else:
                node = self._node(0)
                if isinstance(node, Use):
                    raise self._error("USE is not allowed at the top level")
                nodes.append(node)
        return World(tuple(nodes), tuple(routes))

    def _scan(self) -> Iterator[str]:
        self._next = len(self._text.partition("\n")[0])
        while True:
            found = _TOKEN.match(self._text, self._next)
            if found is None:
                raise self._error("unterminated text or unexpected character")
            self._at, self._next = found.start(1), found.end()
            yield found[1]

    def _error(self, what: str) -> InputError:
        line = self._text.count("\n", 0, self._at) + 1
        short = what if len(what) <= MAX_QUOTED_CHARACTERS else f"{what[:MAX_QUOTED_CHARACTERS]}…"
        return InputError(f"{self._name}, line {line}: {short}.")

    def _take(self) -> str:
        token = self._ahead
        if not token:
            raise self._error("the file ends too early")
        self._ahead = next(self._tokens)
        return token

    def _expect(self, token: str) -> None:
        if self._ahead != token:
            raise self._error(f"expected {token!r}, not {self._ahead!r}")
        self._take()

    def _new_name(self) -> str:
        name = self._take()
        if not _NAME.fullmatch(name) or name in KEYWORDS:
            raise self._error(f"{name!r} is not a name")
        return name

    def _node(self, depth: int, token: str = "") -> Node | Use:
        """Return the next node, after its first ``token`` if that is taken already."""
        if depth > MAX_DEPTH:
            raise self._error(f"nodes are nested more than {MAX_DEPTH} deep")
        name: str | None = None
        token = token or self._take()
        if token == "USE":
            used = self._new_name()
            node = self._named.get(used)
            return self._undefined(used) if node is None else self._used(node, used)
        if token == "DEF":
            name = self._new_name()
            self._define(name)
            token = self._kind(name)
        kinds = self.fields.get(token)
        if kinds is None:
            node = self._unknown(token, name, depth)
            if name is not None:
                self._named[name] = node
            return node
        self._expect("{")
        fields: dict[str, Value] = {}
        strays: list[Node] = []
        while self._ahead != "}":
            field = self._take()
            if field not in kinds:
                strays += self._stray(token, field, depth)
                continue
            if field in fields:
                self._again(token, field)
            fields[field] = self._value(kinds[field], depth)
        self._take()
        if strays:
            fields["children"] = (*_nodes(fields.get("children")), *strays)
        node = Node(token, tuple(fields.items()), name)
        if name is not None:
            self._named[name] = node
        return node

    def _define(self, name: str) -> None:
        if name in self._named:
            raise self._error(f"{name!r} is defined twice")
        self._named[name] = None

    def _kind(self, _name: str) -> str:
        """Take the kind of the node with the name ``_name``."""
        return self._take()

    def _used(self, _node: Node, name: str) -> Node | Use:
        return Use(name)

    def _undefined(self, name: str) -> Node:
        """Return what stands for a node that is used but not defined."""
        raise self._error(f"{name!r} is used before it is defined")

    def _placeholder(self, _kind: Type) -> Value:
        """Parse what stands for a field of a prototype."""
        raise self._error("IS is not supported")

    def _no_node(self, _depth: int) -> Node:
        """Parse a value in the place of a node."""
        raise self._error(f"expected a node, not {self._ahead!r}")

    def _again(self, kind: str, field: str) -> None:
        """Decide about a field that is given a second time."""
        raise self._error(f"the field {field} is given twice in one {kind}")

    def _unknown(self, kind: str, _name: str | None, _depth: int) -> Node:
        """Parse a node that is not in the table."""
        raise self._error(f"the node {kind!r} is not supported")

    def _stray(self, kind: str, field: str, _depth: int) -> list[Node]:
        """Parse a token in the place of a field of a node ``kind``; return children in it."""
        raise self._error(f"{kind} has no field {field!r}")

    def _value(self, kind: Type, depth: int) -> Value:
        if self._ahead == "IS":
            return self._placeholder(kind)
        match kind:
            case Type.NODE:
                if self._ahead[:1] in VALUES and self._ahead:
                    return self._no_node(depth)
                return self._node(depth + 1)
            case Type.NODE_LIST:
                return tuple(self._items(lambda: self._node(depth + 1)))
            case Type.BOOL:
                return self._bool()
            case Type.STRING:
                return self._string()
            case Type.STRING_LIST:
                return tuple(self._items(self._string))
            case Type.INT:
                return self._integer()
            case Type.INT_LIST:
                whole = self._row(INTEGERS, int)
                return tuple(self._items(self._integer)) if whole is None else whole
        width = WIDTHS[kind]
        if kind not in LISTS:
            row = tuple(self._float() for _ in range(width))
            return row[0] if width == 1 else row
        # A list of one value may omit its brackets.
        if self._ahead != "[":
            return tuple(self._float() for _ in range(width))
        numbers = self._row(NUMBERS, float)
        if numbers is None:
            numbers = tuple(self._items(self._float))
        if len(numbers) % width:
            raise self._error(f"{len(numbers)} numbers do not form rows of {width}")
        return numbers

    def _items(self, one: Callable[[], T]) -> Iterator[T]:
        if self._ahead != "[":
            yield one()
            return
        self._take()
        while self._ahead != "]":
            yield one()
        self._take()

    def _row(self, pattern: re.Pattern[str], one: Callable[[str], N]) -> tuple[N, ...] | None:
        """Return a list of plain numbers at once; None if the list is not that simple."""
        if self._ahead != "[":
            return None
        end = self._text.find("]", self._next)
        plain = self._text[self._next : end].replace(",", " ")
        if end < 0 or not pattern.fullmatch(plain):
            return None
        numbers = tuple(map(one, plain.split()))
        if not all(map(math.isfinite, numbers)):
            return None
        self._next = end
        self._take()
        self._take()
        return numbers

    def _string(self) -> str:
        token = self._take()
        if not token.startswith('"'):
            raise self._error(f"expected a text in quotes, not {token!r}")
        # Other backslashes are in paths of Windows.
        return re.sub(r"\\([\"\\])", r"\1", token[1:-1])

    def _bool(self) -> bool:
        token = self._take()
        if token not in ("TRUE", "FALSE"):
            raise self._error(f"expected TRUE or FALSE, not {token!r}")
        return token == "TRUE"

    def _float(self) -> float:
        token = self._take()
        if not _NUMBER.fullmatch(token):
            raise self._error(f"expected a number, not {token!r}")
        value = float(token)
        if not math.isfinite(value):
            raise self._error(f"the number {token!r} is too large")
        return value

    def _integer(self) -> int:
        token = self._take()
        if not _INTEGER.fullmatch(token):
            raise self._error(f"expected a whole number, not {token!r}")
        return int(token, 0) if "x" in token.lower() else int(token)

    def _route(self) -> Route:
        self._take()
        source, out = self._end(EVENTS, "out of")
        self._expect("TO")
        target, into = self._end(SETTERS, "into")
        kinds = {name: node.kind for name, node in self._named.items() if node is not None}
        if EVENTS[kinds[source], out] is not SETTERS[kinds[target], into]:
            raise self._error(f"{source}.{out} and {target}.{into} have different types")
        return Route(source, out, target, into)

    def _end(self, events: Mapping[tuple[str, str], Type], which: str) -> tuple[str, str]:
        token = self._take()
        name, _, event = token.partition(".")
        node = self._named.get(name)
        if node is None or (node.kind, event) not in events:
            raise self._error(f"a route cannot go {which} {token!r}")
        return name, event


def _nodes(value: Value | None) -> list[Node | Use]:
    """Return the nodes in a field."""
    items = value if isinstance(value, tuple) else (value,)
    return [each for each in items if isinstance(each, Node | Use)]
