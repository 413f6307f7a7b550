"""Parser of VRML97 worlds: nodes with their reused nodes in place, and prototypes expanded.

Source: ISO/IEC 14772-1:1997, annex A, grammar; 4.8, prototypes. The form of a value shows its type,
so that the fields of unknown nodes are parsed too. Those of the nodes that are read are checked
when they are used.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import NamedTuple

from katana450.errors import InputError
from katana450.extensions.export.vrml.vrml_world import Node, Use, Value

MAX_QUOTED_CHARACTERS = 160
"""Maximum length of a quotation from a file in an error message."""

MAX_DEPTH = 150
"""Maximum nesting of nodes, within the limit of Python's stack."""

MAX_EXPANDED = 100_000
"""Maximum number of nodes that the prototypes of a file make."""

IS = "IS"
"""The word before the name of the field of a prototype whose value a field gets."""

EVENT_ACCESS = ("eventIn", "eventOut")
"""Words before a part of an interface that has no value."""

FIELD_ACCESS = ("field", "exposedField")
"""Words before a part of an interface that has a value."""

STATEMENTS = ("PROTO", "EXTERNPROTO", "ROUTE")
"""First words of statements, which may also stand among the fields of a node."""

_BOUNDS = " bboxCenter bboxSize"
_SURFACE = "solid ccw convex creaseAngle "
_SOLID = "solid height side bottom "

FIELD_NAMES: Mapping[str, frozenset[str]] = {
    kind: frozenset(names.split())
    for kind, names in {
        "Group": "children" + _BOUNDS,
        "Collision": "children collide proxy" + _BOUNDS,
        "Anchor": "children description parameter url" + _BOUNDS,
        "Billboard": "children axisOfRotation" + _BOUNDS,
        "Transform": "children translation center rotation scale scaleOrientation" + _BOUNDS,
        "Switch": "whichChoice choice",
        "LOD": "level range center",
        "Inline": "url" + _BOUNDS,
        "Shape": "appearance geometry",
        "Appearance": "material texture textureTransform",
        "Material": "diffuseColor specularColor emissiveColor ambientIntensity shininess "
        "transparency",
        "IndexedFaceSet": _SURFACE + "coord coordIndex color colorIndex colorPerVertex normal "
        "normalIndex normalPerVertex texCoord texCoordIndex",
        "Extrusion": _SURFACE + "beginCap endCap crossSection orientation scale spine",
        # Later programs write `solid` of solids too.
        "Box": "size solid",
        "Cone": _SOLID + "bottomRadius",
        "Cylinder": _SOLID + "radius top",
        "Sphere": "radius solid",
        "Coordinate": "point",
        "Color": "color",
    }.items()
}
"""Names of the fields of each kind of node that is read, as far as a file can set them."""

# Possessive quantifiers, so that a mismatch in an untrusted file fails without backtracking.
_TOKEN = re.compile(
    r'[\s,]*+(?:#[^\n\r]*+[\s,]*+)*+("(?:[^"\\]|\\.)*+"|[\[\]{}]|[^\s,"#\[\]{}]+|$)', re.DOTALL
)
# Normals are often no numbers; vertices that are used are checked later.
_DECIMAL = r"[+-]?(?:(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?|(?i:nan|inf(?:inity)?))"
_NUMBER = re.compile(rf"{_DECIMAL}|(?P<hexadecimal>0[xX][0-9a-fA-F]+)")
_ROW = re.compile(rf"[\s,]*+((?:{_DECIMAL}[\s,]++)*+(?:{_DECIMAL})?+)\]")


class Prototype(NamedTuple):
    """A declared kind of node.

    Attributes:
        start: place in the text at which its body begins.
        defaults: values of the fields that an instance does not set.
        known: the prototypes that its body can use.
    """

    start: int
    defaults: Mapping[str, Value | None]
    known: Mapping[str, Prototype]


class Reader:
    """A parser of the text of one file. The body of a prototype is parsed for each instance."""

    def __init__(self, text: str, name: str) -> None:
        """Parse ``text`` of the file ``name``, which is used in messages."""
        self._text, self._name = text, name
        self._at, self._next = 0, len(text.partition("\n")[0])
        self._named: dict[str, Node] = {}
        self._prototypes: dict[str, Prototype] = {}
        # The fields of the prototype whose body is parsed.
        self._values: Mapping[str, Value | None] = {}
        self._instances = self._expanded = 0
        self._ahead = ""
        self._advance()

    def nodes(self) -> tuple[Node | Use, ...]:
        """Return the nodes of the file. Raises InputError with the line of an error."""
        nodes: list[Node | Use] = []
        while self._ahead:
            nodes += self._statement(0)
        return tuple(nodes)

    def _advance(self) -> None:
        """Move to the next token; at the end of the file it is empty."""
        match = _TOKEN.match(self._text, self._next)
        if match is None:
            raise self._error("unterminated text or unexpected character")
        self._at, self._next, self._ahead = match.start(1), match.end(), match[1]

    def _error(self, what: str) -> InputError:
        line = self._text.count("\n", 0, self._at) + 1
        short = what if len(what) <= MAX_QUOTED_CHARACTERS else f"{what[:MAX_QUOTED_CHARACTERS]}…"
        return InputError(f"{self._name}, line {line}: {short}.")

    def _take(self) -> str:
        token = self._ahead
        if not token:
            raise self._error("the file ends too early")
        self._advance()
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
                self._expect("[")
                while self._take() != "]":
                    pass
                self._value(depth)
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
        self._expanded += self._instances > 0
        if self._expanded > MAX_EXPANDED:
            raise InputError(f"{self._name} has prototypes that make over {MAX_EXPANDED} nodes.")
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
        # What a file declares counts, also under a name of the standard.
        prototype = self._prototypes.get(kind)
        names = FIELD_NAMES.get(kind) if prototype is None else prototype.defaults.keys()
        fields: dict[str, Value] = {}
        self._expect("{")
        while self._ahead != "}":
            if self._ahead in STATEMENTS:
                self._statement(depth)
                continue
            field = self._take()
            if field in (*EVENT_ACCESS, *FIELD_ACCESS):
                # The interface of a script.
                self._declared(field, depth)
                continue
            is_known = names is None or field in names
            if not is_known and self._ahead != IS:
                raise self._error(f"{kind} has no field {field!r}")
            value = self._value(depth)
            # An unknown field can be an event of a prototype.
            if is_known and value is not None:
                fields[field] = value
        self._take()
        if prototype is None:
            return Node(kind, tuple(fields.items()), name)
        return self._instance(prototype, fields, depth)

    def _declared(self, access: str, depth: int) -> tuple[str, Value | None]:
        """Parse a part of an interface after its first word; return its name and value."""
        self._take()
        name = self._take()
        has_value = access in FIELD_ACCESS or self._ahead == IS
        return name, self._value(depth) if has_value else None

    def _prototype(self, depth: int) -> None:
        """Parse a declaration after its first word."""
        name = self._new_name()
        defaults: dict[str, Value | None] = {}
        self._expect("[")
        while self._ahead != "]":
            access = self._take()
            if access not in (*EVENT_ACCESS, *FIELD_ACCESS):
                raise self._error(f"{access!r} is not a part of the interface of a prototype")
            field, value = self._declared(access, depth)
            if access in FIELD_ACCESS:
                defaults[field] = value
        self._take()
        self._expect("{")
        prototype = Prototype(self._at, defaults, dict(self._prototypes))
        self._expansion(prototype, {}, depth)
        self._take()
        self._prototypes[name] = prototype

    def _instance(self, prototype: Prototype, fields: Mapping[str, Value], depth: int) -> Node:
        """Return the node for which an instance of ``prototype`` stands."""
        place = self._at, self._next, self._ahead
        self._next = prototype.start
        self._advance()
        self._instances += 1
        node = self._expansion(prototype, fields, depth)
        self._instances -= 1
        self._at, self._next, self._ahead = place
        return node

    def _expansion(self, prototype: Prototype, fields: Mapping[str, Value], depth: int) -> Node:
        """Parse the body of ``prototype`` up to its end; return its first node."""
        outer = self._named, self._prototypes, self._values
        self._named, self._prototypes = {}, dict(prototype.known)
        self._values = {**prototype.defaults, **fields}
        nodes: list[Node | Use] = []
        while self._ahead != "}":
            nodes += self._statement(depth + 1)
        self._named, self._prototypes, self._values = outer
        return next((node for node in nodes if isinstance(node, Node)), Node("NULL"))

    def _value(self, depth: int) -> Value | None:
        """Parse the value of a field; None if the field of a prototype has none."""
        if self._ahead == IS:
            self._take()
            return self._values.get(self._take())
        if self._ahead != "[":
            return self._item(depth)
        row = _ROW.match(self._text, self._next)
        if row is not None:
            self._next = row.end(1)
            self._take()
            self._take()
            return [float(word) for word in row[1].replace(",", " ").split()]
        self._take()
        items: list[Value] = []
        while self._ahead != "]":
            item = self._item(depth)
            if isinstance(item, tuple) and not isinstance(item, Use):
                items += item
            else:
                items.append(item)
        self._take()
        return items

    def _item(self, depth: int) -> Value:
        """Parse a text, a Boolean value, all numbers up to the next word, or a node."""
        if self._ahead.startswith('"'):
            # Other backslashes are in paths of Windows.
            return re.sub(r"\\([\"\\])", r"\1", self._take()[1:-1])
        if self._ahead.upper() in ("TRUE", "FALSE"):
            return self._take().upper() == "TRUE"
        numbers: list[float] = []
        while number := _NUMBER.fullmatch(self._ahead):
            numbers.append(int(number[0], 16) if number["hexadecimal"] else float(number[0]))
            self._take()
        if numbers:
            return tuple(numbers) if len(numbers) > 1 else numbers[0]
        if self._ahead[:1] in ("[", "]", "{", "}"):
            raise self._error(f"expected a value, not {self._ahead!r}")
        return self._node(depth + 1)
