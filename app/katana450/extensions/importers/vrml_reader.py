"""Parser of VRML97 worlds: nodes with their reused nodes in place, and instances of prototypes.

Source: ISO/IEC 14772-1:1997, annex A, grammar. Nodes that it does not know are left out.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterator
from typing import TypeVar

from katana450.errors import InputError
from katana450.extensions.export.vrml_node import LISTS, WIDTHS, Node, Type, Use, Value
from katana450.extensions.importers.vrml_prototypes import IS, Instance, Prototype
from katana450.extensions.importers.vrml_standard import STANDARD, TEXTURES

T = TypeVar("T")
N = TypeVar("N", int, float)

MAX_QUOTED_CHARACTERS = 160
"""Maximum length of a quotation from a file in an error message."""

MAX_DEPTH = 150
"""Maximum nesting of nodes, within the limit of Python's stack."""

CLOSERS = {"{": "}", "[": "]"}
"""The closing token of each opening token."""

EVENT_ACCESS = ("eventIn", "eventOut")
"""Words before a part of an interface that has no value."""

FIELD_ACCESS = ("field", "exposedField")
"""Words before a part of an interface that has a value."""

STATEMENTS = ("PROTO", "EXTERNPROTO", "ROUTE")
"""First words of statements, which may also stand among the fields of a node."""

TYPES = {kind.value: kind for kind in Type}
"""Types by their names in an interface."""

# Possessive quantifiers, so that a mismatch in an untrusted file fails without backtracking.
_TOKEN = re.compile(
    r'[\s,]*+(?:#[^\n\r]*+[\s,]*+)*+("(?:[^"\\]|\\.)*+"|[\[\]{}]|[^\s,"#\[\]{}]+|$)', re.DOTALL
)
# Normals are often no numbers; vertices that are used are checked later.
_NUMBER = re.compile(
    r"[+-]?(?:(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?|(?i:nan|inf(?:inity)?))"
)
_INTEGER = re.compile(r"[+-]?(?:[0-9]{1,10}|0[xX][0-9a-fA-F]{1,8})")
NUMBERS, INTEGERS = (
    re.compile(rf"\s*(?:{one}\s+)*+(?:{one})?+") for one in (_NUMBER.pattern, "[+-]?[0-9]{1,10}")
)


class Reader:
    """A parser of the text of one file.

    Attributes:
        left_out: counts of the parts that are not read, by their names.
    """

    fields = STANDARD

    def __init__(self, text: str, name: str) -> None:
        """Parse ``text`` of the file ``name``, which is used in messages."""
        self._text, self._name = text, name
        self._at = self._next = 0
        self._tokens = self._scan()
        self._ahead = next(self._tokens)
        self._named: dict[str, Node] = {}
        self._prototypes: dict[str, Prototype] = {}
        self.left_out: Counter[str] = Counter()

    def nodes(self) -> tuple[Node | Use, ...]:
        """Return the nodes of the file. Raises InputError with the line of an error."""
        found: list[Node | Use] = []
        while self._ahead:
            found += self._statement(0)
        return tuple(found)

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
        # Names that the standard does not allow are common.
        name = self._take()
        if name[0] in '"[]{}':
            raise self._error(f"{name!r} is not a name")
        return name

    def _statement(self, depth: int) -> list[Node | Use]:
        """Parse a statement; return the node if it is one."""
        if self._ahead not in STATEMENTS:
            return [self._node(depth)]
        match self._take():
            case "PROTO":
                self._prototype(depth)
            case "EXTERNPROTO":
                # Its nodes are unknown.
                self._new_name()
                self._skip_brackets()
                list(self._items(self._string))
            case _:
                self._route()
        return []

    def _route(self) -> None:
        """Parse a ROUTE after its first word; motion does not matter here."""
        self._take()
        self._expect("TO")
        self._take()

    def _node(self, depth: int) -> Node | Use:
        if depth > MAX_DEPTH:
            raise self._error(f"nodes are nested more than {MAX_DEPTH} deep")
        kind = self._take()
        if kind == "NULL":
            return Node(kind)
        if kind == "USE":
            return self._used(self._new_name())
        if kind != "DEF":
            return self._body(kind, None, depth)
        name = self._new_name()
        node = self._body(self._take(), name, depth)
        self._named[name] = node
        return node

    def _used(self, name: str) -> Node | Use:
        if name not in self._named:
            raise self._error(f"{name!r} is used before it is defined")
        return self._named[name]

    def _body(self, kind: str, name: str | None, depth: int) -> Node:
        """Parse a node after its kind."""
        prototype = self._prototypes.get(kind)
        types = self.fields.get(kind) if prototype is None else prototype.types
        if types is None:
            self._skip_brackets()
            if kind in TEXTURES:
                self.left_out["pictures on the surface"] += 1
            return Node(kind, (), name)
        fields: dict[str, Value] = {}
        self._expect("{")
        while self._ahead != "}":
            if self._ahead in STATEMENTS:
                self._statement(depth)
                continue
            field = self._take()
            if field in types:
                fields[field] = self._value(types[field], depth)
            elif self._ahead == IS:
                # An event of a prototype.
                self._take()
                self._take()
            else:
                raise self._error(f"{kind} has no field {field!r}")
        self._take()
        if prototype is None:
            return Node(kind, tuple(fields.items()), name)
        return Instance(kind, tuple(fields.items()), name, prototype)

    def _prototype(self, depth: int) -> None:
        """Parse a declaration after its first word."""
        name = self._new_name()
        types, defaults = self._interface(depth)
        named, prototypes = self._named, self._prototypes
        self._named, self._prototypes = {}, dict(prototypes)
        self._expect("{")
        body: list[Node | Use] = []
        while self._ahead != "}":
            body += self._statement(depth + 1)
        self._take()
        self._named, self._prototypes = named, prototypes
        first = next((node for node in body if isinstance(node, Node)), Node("NULL"))
        # What a file declares counts, also under a name of the standard.
        self._prototypes[name] = Prototype(types, defaults, first)

    def _interface(self, depth: int) -> tuple[dict[str, Type | None], dict[str, Value]]:
        """Return types and defaults of the fields of a prototype."""
        types: dict[str, Type | None] = {}
        defaults: dict[str, Value] = {}
        self._expect("[")
        while self._ahead != "]":
            access = self._take()
            if access not in (*EVENT_ACCESS, *FIELD_ACCESS):
                raise self._error(f"{access!r} is not a part of the interface of a prototype")
            kind, field = TYPES.get(self._take()), self._take()
            if access in FIELD_ACCESS:
                types[field] = kind
                defaults[field] = self._value(kind, depth)
        self._take()
        return types, defaults

    def _skip_brackets(self) -> None:
        """Skip a part in brackets or braces; nodes that are named in it can be used later."""
        if self._ahead not in CLOSERS:
            raise self._error(f"expected '{{', not {self._ahead[:40]!r}")
        closers: list[str] = []
        while True:
            token = self._take()
            if token in CLOSERS:
                closers.append(CLOSERS[token])
            elif token in ("}", "]"):
                if token != closers.pop():
                    raise self._error(f"{token!r} closes nothing")
                if not closers:
                    return
            elif token == "DEF":
                name = self._new_name()
                self._named[name] = Node(self._ahead, (), name)

    def _value(self, kind: Type | None, depth: int) -> Value:
        """Return the next value of a type; None stands for a type without a meaning here."""
        if self._ahead == IS:
            self._take()
            return Node(IS, (("type", "" if kind is None else kind.value),), self._take())
        match kind:
            case None:
                return self._skipped()
            case Type.NODE:
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
        # A list of one value may omit its brackets.
        if kind not in LISTS or self._ahead != "[":
            row = tuple(self._float() for _ in range(width))
            return row[0] if width == 1 and kind not in LISTS else row
        numbers = self._row(NUMBERS, float)
        if numbers is None:
            numbers = tuple(self._items(self._float))
        if len(numbers) % width:
            raise self._error(f"{len(numbers)} numbers do not form rows of {width}")
        return numbers

    def _skipped(self) -> Value:
        """Skip a value of numbers, such as an SFImage or MFTime."""
        if self._ahead == "[":
            self._skip_brackets()
        while self._ahead[:1].isdigit() or self._ahead[:1] in ("+", "-", "."):
            self._take()
        return ()

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
        end = self._text.find("]", self._next)
        plain = self._text[self._next : end].replace(",", " ")
        if self._ahead != "[" or end < 0 or not pattern.fullmatch(plain):
            return None
        self._next = end
        self._take()
        self._take()
        return tuple(map(one, plain.split()))

    def _string(self) -> str:
        token = self._take()
        if not token.startswith('"'):
            raise self._error(f"expected a text in quotes, not {token!r}")
        # Other backslashes are in paths of Windows.
        return re.sub(r"\\([\"\\])", r"\1", token[1:-1])

    def _bool(self) -> bool:
        token = self._take()
        if token.upper() not in ("TRUE", "FALSE"):
            raise self._error(f"expected TRUE or FALSE, not {token!r}")
        return token.upper() == "TRUE"

    def _float(self) -> float:
        token = self._take()
        if not _NUMBER.fullmatch(token):
            raise self._error(f"expected a number, not {token!r}")
        return float(token)

    def _integer(self) -> int:
        token = self._take()
        if not _INTEGER.fullmatch(token):
            raise self._error(f"expected a whole number, not {token!r}")
        return int(token, 0) if "x" in token.lower() else int(token)
