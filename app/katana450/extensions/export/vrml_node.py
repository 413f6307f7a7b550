"""A VRML97 world as immutable values: nodes with their fields, and routes between their events.

Only the nodes that the export writes are listed. Their field names and types are those of ISO/IEC
14772-1:1997, chapter 6.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from enum import Enum
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from katana450.maths.geometry import so3
from katana450.maths.geometry.arrays import FloatArray


class Type(Enum):
    """The VRML type of a field: SF types have a single value, MF types a list of values."""

    BOOL = "SFBool"
    INT = "SFInt32"
    INT_LIST = "MFInt32"
    FLOAT = "SFFloat"
    FLOAT_LIST = "MFFloat"
    TIME = "SFTime"
    PAIR = "SFVec2f"
    PAIR_LIST = "MFVec2f"
    VECTOR = "SFVec3f"
    VECTOR_LIST = "MFVec3f"
    COLOR = "SFColor"
    COLOR_LIST = "MFColor"
    ROTATION = "SFRotation"
    ROTATION_LIST = "MFRotation"
    STRING = "SFString"
    STRING_LIST = "MFString"
    NODE = "SFNode"
    NODE_LIST = "MFNode"


WIDTHS: Mapping[Type, int] = MappingProxyType(
    {
        Type.INT: 1,
        Type.INT_LIST: 1,
        Type.FLOAT: 1,
        Type.FLOAT_LIST: 1,
        Type.TIME: 1,
        Type.PAIR: 2,
        Type.PAIR_LIST: 2,
        Type.VECTOR: 3,
        Type.VECTOR_LIST: 3,
        Type.COLOR: 3,
        Type.COLOR_LIST: 3,
        Type.ROTATION: 4,
        Type.ROTATION_LIST: 4,
    }
)
"""Count of numbers in a single value of each numeric type."""

LISTS = frozenset(kind for kind in Type if kind.value.startswith("MF"))
"""Types whose value is a list of any length."""

_CHILDREN = {"children": Type.NODE_LIST}

FIELDS: Mapping[str, Mapping[str, Type]] = MappingProxyType(
    {
        "WorldInfo": {"title": Type.STRING, "info": Type.STRING_LIST},
        "NavigationInfo": {
            "type": Type.STRING_LIST,
            "headlight": Type.BOOL,
            "speed": Type.FLOAT,
        },
        "Background": {"skyColor": Type.COLOR_LIST},
        "Viewpoint": {
            "position": Type.VECTOR,
            "orientation": Type.ROTATION,
            "fieldOfView": Type.FLOAT,
            "description": Type.STRING,
        },
        "DirectionalLight": {
            "direction": Type.VECTOR,
            "intensity": Type.FLOAT,
            "ambientIntensity": Type.FLOAT,
        },
        "Group": _CHILDREN,
        "Switch": {"whichChoice": Type.INT, "choice": Type.NODE_LIST},
        "Transform": {
            "translation": Type.VECTOR,
            "center": Type.VECTOR,
            "rotation": Type.ROTATION,
            **_CHILDREN,
        },
        "Shape": {"appearance": Type.NODE, "geometry": Type.NODE},
        "Appearance": {"material": Type.NODE},
        "Material": {
            "diffuseColor": Type.COLOR,
            "specularColor": Type.COLOR,
            "ambientIntensity": Type.FLOAT,
            "shininess": Type.FLOAT,
            "transparency": Type.FLOAT,
        },
        "IndexedFaceSet": {
            "solid": Type.BOOL,
            "coord": Type.NODE,
            "normal": Type.NODE,
            "coordIndex": Type.INT_LIST,
        },
        "Coordinate": {"point": Type.VECTOR_LIST},
        "Normal": {"vector": Type.VECTOR_LIST},
        "TimeSensor": {
            "cycleInterval": Type.TIME,
            "loop": Type.BOOL,
            "startTime": Type.TIME,
        },
        "OrientationInterpolator": {"key": Type.FLOAT_LIST, "keyValue": Type.ROTATION_LIST},
        "PositionInterpolator": {"key": Type.FLOAT_LIST, "keyValue": Type.VECTOR_LIST},
    }
)
"""Fields of each kind of node that the export writes, with their types."""

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

    The value of a field is a bool, float, str, Node or Use, or a tuple of these. A list of vectors
    is one flat tuple of numbers.

    Attributes:
        kind: type name of the node, such as ``Transform``; a key of FIELDS.
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
            for part in value if isinstance(value, tuple) else (value,):
                if isinstance(part, Node):
                    yield from part.walk()


Value = bool | float | str | Node | Use | tuple["float | str | Node | Use", ...]
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
