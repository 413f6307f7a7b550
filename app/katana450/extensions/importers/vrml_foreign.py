"""Tolerant parser of VRML97, and of X3D in its encoding, for worlds of other programs."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import replace

from katana450.extensions.export.vrml_node import Node, Route, Type, Use, Value
from katana450.extensions.importers.vrml_prototypes import IS, Instance, Prototype
from katana450.extensions.importers.vrml_reader import VALUES, Reader
from katana450.extensions.importers.vrml_standard import STANDARD, TEXTURES

BUILT_IN = "urn:"
"""Beginning of an address of a node or prototype that a program has built in."""

CLOSERS = {"{": "}", "[": "]"}
"""The closing token of each opening token."""

EVENT_ACCESS = ("eventIn", "eventOut", "inputOnly", "outputOnly")
"""Words before a part of an interface that has no value; the last two are those of X3D."""

FIELD_ACCESS = ("field", "exposedField", "initializeOnly", "inputOutput")
"""Words before a part of an interface that has a value."""

X3D_STATEMENTS = {"PROFILE": 1, "COMPONENT": 1, "META": 2, "IMPORT": 1, "EXPORT": 1}
"""Statements of X3D files with this number of words after them, which change no surface."""

LENGTHS = (1e-9, 1e9)
"""[m] Bounds of a unit of length."""

NOT_NUMBERS = ("nan", "inf", "1.#")
"""Beginnings of words that programs write for what is no number."""

TYPES = {kind.value: kind for kind in Type}
"""Types by their names in an interface."""

WORDS = ("TRUE", "FALSE", "NULL")
"""Values that are neither numbers, texts nor nodes."""


class ForeignReader(Reader):
    """A reader that knows the standard nodes and prototypes, and omits others.

    It puts reused nodes in place.
    """

    fields = STANDARD

    def __init__(self, text: str, name: str) -> None:
        """Read ``text`` of the file ``name``."""
        super().__init__(text, name)
        self.left_out: Counter[str] = Counter()
        self.prototypes: dict[str, Prototype] = {}
        # Nodes of the standard by the names that the file gives them.
        self._built_in: dict[str, str] = {}
        # Unit of length [m], if the file states one.
        self.length: float | None = None

    def _define(self, name: str) -> None:
        # The standard allows a name to be defined again.
        self._named[name] = None

    def _new_name(self) -> str:
        # Names that the standard does not allow are common.
        name = self._take()
        if name[0] in '"[]{}':
            raise self._error(f"{name!r} is not a name")
        return name

    def _kind(self, name: str) -> str:
        # The name is left out in DEF Transform { }, and written twice in DEF a DEF a Group { }.
        while self._ahead == "DEF":
            self._take()
            self._define(self._new_name())
        return name if self._ahead == "{" else self._take()

    def _used(self, node: Node, _name: str) -> Node:
        return node

    def _undefined(self, _name: str) -> Node:
        self.left_out["nodes that are used, but not defined"] += 1
        return Node("NULL")

    def _again(self, kind: str, field: str) -> None:
        # The last value counts.
        self.left_out[f"the first value of {field} in {kind}"] += 1

    def _bool(self) -> bool:
        if self._ahead.upper() in WORDS[:2]:
            return self._take().upper() == "TRUE"
        return super()._bool()

    def _no_node(self, depth: int) -> Node:
        # Some programs write numbers, others a list of one node.
        found: list[Node] = []
        if self._ahead != "[":
            self._skip_value(depth)
        else:
            self._take()
            while self._ahead != "]":
                if self._ahead[:1] in VALUES and self._ahead:
                    self._skip_value(depth)
                else:
                    found += [each for each in (self._node(depth + 1),) if isinstance(each, Node)]
            self._take()
        if not found:
            self.left_out["values in the place of nodes"] += 1
        return next(iter(found), Node("NULL"))

    def _float(self) -> float:
        # Normals are often no numbers; vertices that are used are checked later.
        if self._ahead.lstrip("+-").lower().startswith(NOT_NUMBERS):
            self._take()
            return math.nan
        return super()._float()

    def _placeholder(self, kind: Type) -> Value:
        self._take()
        return Node(IS, (("type", kind.value),), self._take())

    def _unknown(self, kind: str, name: str | None, depth: int) -> Node:
        if kind in self._built_in:
            node = self._node(depth, self._built_in[kind])
            return replace(node, name=name) if isinstance(node, Node) else Node("NULL")
        if kind in self.prototypes:
            return self._instance(self.prototypes[kind], name, depth)
        if kind in ("PROTO", "EXTERNPROTO"):
            self._prototype(kind, depth)
            return Node("NULL")
        if kind in X3D_STATEMENTS:
            for _ in range(X3D_STATEMENTS[kind]):
                self._take()
            if self._ahead == "AS":
                self._take()
                self._take()
            return Node("NULL")
        if kind[0].islower() and self._ahead in self.fields:
            # A field without the node that has it.
            found = self._node(depth)
            return found if isinstance(found, Node) else Node("NULL")
        if kind == "UNIT":
            self._unit()
            return Node("NULL")
        if kind == "ROUTE":
            self._ends()
            return Node("NULL")
        if kind != "NULL":
            self._skip_braces()
        if kind in TEXTURES:
            self.left_out["pictures on the surface"] += 1
        return Node(kind, (), name)

    def _unit(self) -> None:
        """Parse the category, name and factor of a unit of X3D."""
        category, name, factor = self._take(), self._take(), self._float()
        if category == "length":
            if not LENGTHS[0] < factor < LENGTHS[1]:
                raise self._error(f"the unit {name!r} of {factor:g} m is not possible")
            self.length = factor
        elif category == "angle" and factor != 1.0:
            self.left_out["the unit of angles"] += 1

    def _prototype(self, kind: str, depth: int) -> None:
        """Parse a declaration after its first word."""
        name = self._new_name()
        types, defaults = self._interface(depth)
        if kind == "EXTERNPROTO":
            urls = tuple(self._items(self._string))
            self.prototypes[name] = Prototype(name, types, defaults, None, urls)
            kinds = [url.rpartition(":")[2] for url in urls if url.startswith(BUILT_IN)]
            kind = next((kind for kind in kinds if kind in STANDARD), "")
            if kind:
                self._built_in[name] = kind
            return
        named, prototypes = self._named, self.prototypes
        self._named, self.prototypes = {}, dict(prototypes)
        self._expect("{")
        body: list[Node] = []
        while self._ahead != "}":
            node = self._node(depth + 1)
            if isinstance(node, Node) and node.kind != "NULL":
                body.append(node)
        self._take()
        self._named, self.prototypes = named, prototypes
        # What a file declares counts, also under a name of the standard.
        self.fields = {kind: fields for kind, fields in self.fields.items() if kind != name}
        first = body[0] if body else Node("NULL")
        self.prototypes[name] = Prototype(name, types, defaults, first)

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
            if access in EVENT_ACCESS:
                continue
            types[field] = kind
            # A prototype in another file has its defaults there.
            if self._ahead in ("]", *EVENT_ACCESS, *FIELD_ACCESS):
                continue
            if kind is None:
                self._skip_value(depth)
            else:
                defaults[field] = self._value(kind, depth)
        self._take()
        return types, defaults

    def _instance(self, prototype: Prototype, name: str | None, depth: int) -> Node:
        """Parse a node of a declared kind after its name."""
        self._expect("{")
        fields: dict[str, Value] = {}
        while self._ahead != "}":
            field = self._take()
            kind = prototype.types.get(field)
            if kind is None:
                self._stray(prototype.name, field, depth)
            else:
                fields[field] = self._value(kind, depth)
        self._take()
        return Instance(prototype.name, tuple(fields.items()), name, prototype)

    def _skip_braces(self) -> None:
        if self._ahead != "{":
            raise self._error(f"expected '{{', not {self._ahead[:40]!r}")
        self._skip_brackets()

    def _skip_brackets(self) -> None:
        """Skip a part in brackets or braces; nodes that are named in it can be used later."""
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

    def _stray(self, kind: str, field: str, depth: int) -> list[Node]:
        if field in ("DEF", "USE") or (self._ahead == "{" and field in STANDARD):
            node = self._node(depth + 1, field)
            # A group without the word children.
            if "children" in self.fields.get(kind, {}) and isinstance(node, Node):
                return [node]
            self.left_out[f"a node in {kind}"] += 1
        elif field in ("PROTO", "EXTERNPROTO"):
            self._prototype(field, depth)
        elif field == "ROUTE":
            self._ends()
        elif self._ahead == IS:
            self._take()
            self._take()
        elif self._ahead == "{":
            self._skip_braces()
            self.left_out[f"{field} in {kind}"] += 1
        elif field[0] in '"[]{}' or not self._skip_value(depth):
            return super()._stray(kind, field, depth)
        elif field != "metadata":
            self.left_out[f"{field} of {kind}"] += 1
        return []

    def _skip_value(self, depth: int) -> bool:
        """Skip the value of a field of unknown type; return whether there is one."""
        if self._ahead == "[":
            self._skip_brackets()
            return True
        if self._ahead in WORDS:
            self._take()
            return True
        plain = 0
        while self._ahead[:1] in VALUES[1:] and self._ahead:
            self._take()
            plain += 1
        if plain or not self._ahead[:1].isupper():
            return plain > 0
        word = self._take()
        # A word alone is a text without its quotes.
        if word in ("DEF", "USE") or self._ahead == "{":
            self._node(depth + 1, word)
        return True

    def _route(self) -> Route:
        self._take()
        return self._ends()

    def _ends(self) -> Route:
        """Return the rest of a ROUTE after its first word; its target does not matter here."""
        source = self._take()
        self._expect("TO")
        return Route(source, "", self._take(), "")


def parsed(text: str, name: str) -> tuple[tuple[Node, ...], ForeignReader]:
    """Return the nodes of a world, and its reader. Raises InputError with the line of an error."""
    reader = ForeignReader(text, name)
    nodes = reader.world().nodes
    return tuple(each for each in nodes if not isinstance(each, Use)), reader
