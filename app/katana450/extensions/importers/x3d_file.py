"""X3D in XML, rewritten in the encoding of VRML97, which the reader of VRML reads.

Sources: ISO/IEC 19776-1 (XML) and 19776-2 (the encoding of VRML97). Each node gets into the line of
its element if it can, so that messages name lines of the file.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import Any

from lxml import etree

from katana450.errors import InputError
from katana450.extensions.export.vrml_node import LISTS, Type
from katana450.extensions.importers.library_errors import failures_in_words
from katana450.extensions.importers.vrml_reader import MAX_DEPTH
from katana450.extensions.importers.vrml_shapes import MAKERS
from katana450.extensions.importers.vrml_standard import STANDARD, TEXTURES

FIELD_OF: Mapping[str, str] = {
    **dict.fromkeys(MAKERS, "geometry"),
    **dict.fromkeys(("Material", "PhysicalMaterial", "UnlitMaterial"), "material"),
    **dict.fromkeys(TEXTURES, "texture"),
    **dict.fromkeys(("Coordinate", "CoordinateDouble"), "coord"),
    **dict.fromkeys(("Color", "ColorRGBA"), "color"),
    "Appearance": "appearance",
    "Normal": "normal",
    "TextureCoordinate": "texCoord",
    "FontStyle": "fontStyle",
}
"""Field in which a node of a kind stands if `containerField` does not say; else children."""

NODES = (Type.NODE, Type.NODE_LIST)
"""Types of fields that hold nodes."""

NAME = re.compile(r"[^\s\"'{}\[\],#]+")
"""A name that the encoding of VRML97 can hold."""

TYPES = {kind.value: kind for kind in Type}
"""Types by their names."""

Types = Mapping[str, Type | None]
"""Types of the fields of a node; None for a type without a meaning for surfaces."""


def classic(data: bytes, name: str) -> str:
    """Return the text of the file ``name`` in the encoding of VRML97. Raises InputError.

    No entity is expanded, and no other file is opened.
    """
    parser = etree.XMLParser(
        resolve_entities=False,
        load_dtd=False,
        no_network=True,
        huge_tree=True,
        remove_comments=True,
        remove_pis=True,
    )
    with failures_in_words(name):
        try:
            root = etree.fromstring(data, parser)
        except etree.XMLSyntaxError as error:
            raise InputError(f"{name} is corrupt: {error.msg}.") from error
        own = root.getroottree().docinfo.internalDTD
        if own is not None and any(True for _ in own.iterentities()):
            raise InputError(f"{name} has entities of its own, which are not read.")
        return _Rewriting(name).text(root)


class _Rewriting:
    """The text of a file, and the prototypes that it declares."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._parts = ["#X3D V3.3 utf8\n"]
        self._line = 2
        self._prototypes: dict[str, Types] = {}

    def text(self, root: Any) -> str:
        """Return the text of the document with the element ``root``."""
        for unit in root.iterfind("{*}head/{*}unit"):
            words = [unit.get(key, "") for key in ("category", "name", "conversionFactor")]
            if all(map(NAME.fullmatch, words)):
                self._put(" ".join(("UNIT", *words)), unit)
        scene = next(root.iterfind("{*}Scene"), None)
        if scene is None:
            raise InputError(f"{self._name} is not X3D: it has no Scene.")
        for element in _inside(scene):
            self._node(element, 0)
        return "".join(self._parts)

    def _put(self, text: str, element: Any = None) -> None:
        line = self._line if element is None else element.sourceline or self._line
        self._parts.append("\n" * (line - self._line) + f" {text}")
        self._line = max(line, self._line) + text.count("\n")

    def _node(self, element: Any, depth: int) -> None:
        if depth > MAX_DEPTH:
            raise InputError(
                f"{self._name}, line {element.sourceline}: nodes are nested more than {MAX_DEPTH} "
                "deep."
            )
        kind = _tag(element)
        if kind in ("ProtoDeclare", "ExternProtoDeclare"):
            self._declaration(element, kind == "ExternProtoDeclare", depth)
        elif kind in ("ROUTE", "IMPORT", "EXPORT", "IS") or kind.startswith("Metadata"):
            pass
        elif NAME.fullmatch(element.get("USE", "")):
            self._put(f"USE {element.get('USE')}", element)
        else:
            self._instance(element, kind, depth)

    def _instance(self, element: Any, kind: str, depth: int) -> None:
        name = element.get("DEF", "")
        values = {key: element.get(key) for key in element.attrib}
        children = [each for each in _inside(element) if _tag(each) not in ("IS", "fieldValue")]
        types: Types | None = STANDARD.get(kind)
        if kind == "ProtoInstance":
            kind = element.get("name", "")
            types = self._prototypes.get(kind)
            given = list(element.iterfind("{*}fieldValue"))
            values = {each.get("name"): each.get("value") for each in given}
        if not NAME.fullmatch(kind):
            return
        self._put(f"DEF {name} {kind} {{" if NAME.fullmatch(name) else f"{kind} {{", element)
        if types is not None:
            connected = self._connections(element, types)
            for field, value in values.items():
                type = types.get(field)
                if type is not None and type not in NODES and value and field not in connected:
                    self._put(f"{field} {_value(type, value)}")
            held: dict[str, list[Any]] = {}
            for child in children:
                held.setdefault(_field(child, types), []).append(child)
            if _tag(element) == "ProtoInstance":
                held = {each.get("name"): _inside(each) for each in given if len(each)}
            for field, inside in held.items():
                if field not in connected:
                    self._nodes(field, types, inside, depth)
        self._put("}")

    def _nodes(self, field: str, types: Types, inside: Iterable[Any], depth: int) -> None:
        """Write a field of nodes; without a name if the node has no such field."""
        listed = types.get(field) is Type.NODE_LIST
        if types.get(field) in NODES:
            self._put(f"{field} [" if listed else field)
        for each in inside:
            self._node(each, depth + 1)
        if listed:
            self._put("]")

    def _connections(self, element: Any, types: Types) -> set[str]:
        """Write which fields are those of a prototype; return their names."""
        found = {
            each.get("nodeField", ""): each.get("protoField", "")
            for each in element.iterfind("{*}IS/{*}connect")
        }
        for field, other in found.items():
            if field in types and NAME.fullmatch(other):
                self._put(f"{field} IS {other}")
        return set(found)

    def _declaration(self, element: Any, is_external: bool, depth: int) -> None:
        name = element.get("name", "")
        if not NAME.fullmatch(name):
            return
        self._put(f"EXTERNPROTO {name} [" if is_external else f"PROTO {name} [", element)
        types: dict[str, Type | None] = {}
        for each in element.iterfind("{*}field" if is_external else "{*}ProtoInterface/{*}field"):
            words = [each.get(key, "") for key in ("accessType", "type", "name")]
            if not all(map(NAME.fullmatch, words)):
                continue
            access, kind, field = words
            types[field] = TYPES.get(kind)
            self._put(f"{access} {kind} {field}", each)
            type = types[field]
            if is_external or type is None or not access.startswith(("initialize", "inputOutput")):
                continue
            if type in NODES:
                listed = type is Type.NODE_LIST
                self._put("[" if listed else "" if len(each) else "NULL")
                for node in _inside(each):
                    self._node(node, depth + 1)
                self._put("]" if listed else "")
            elif each.get("value"):
                self._put(_value(type, each.get("value")))
        self._prototypes[name] = types
        if is_external:
            self._put(f"] {_value(Type.STRING_LIST, element.get('url', ''))}")
            return
        self._put("] {")
        for node in element.iterfind("{*}ProtoBody/*"):
            self._node(node, depth + 1)
        self._put("}")


def _inside(element: Any) -> list[Any]:
    """Return the elements in an element, without entities that are not expanded."""
    return [each for each in element if isinstance(each.tag, str)]


def _tag(element: Any) -> str:
    """Return the name of an element without its namespace."""
    return str(element.tag).rpartition("}")[2]


def _field(child: Any, types: Types) -> str:
    """Return the field of its parent in which an element stands."""
    given = child.get("containerField", "")
    return given if types.get(given) in NODES else FIELD_OF.get(_tag(child), "children")


def _value(type: Type, value: str) -> str:
    """Return the value of a field that holds no nodes."""
    if type is Type.BOOL:
        return value.strip().upper()
    if type is Type.STRING or (type is Type.STRING_LIST and '"' not in value):
        return '"' + value.replace("\\", "\\\\").replace('"', '\\"') + '"'
    return f"[ {value} ]" if type in LISTS else value
