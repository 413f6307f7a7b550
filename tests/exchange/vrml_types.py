"""Fields of the VRML nodes that the export writes, with their types: ISO/IEC 14772-1:1997, 6."""

from __future__ import annotations

from collections.abc import Mapping
from enum import Enum
from types import MappingProxyType


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
    }
)
"""Fields of each kind of node that the export writes, with their types."""
