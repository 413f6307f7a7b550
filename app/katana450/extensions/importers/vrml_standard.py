"""Nodes of VRML97 that concern surfaces, and nodes that can be ignored.

Fields and types are those of ISO/IEC 14772-1:1997, chapter 6.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from katana450.extensions.export.vrml_node import FIELDS, Type

_BOX = {"bboxCenter": Type.VECTOR, "bboxSize": Type.VECTOR}

_CHILDREN = {"children": Type.NODE_LIST, **_BOX}

_SOLID = {"solid": Type.BOOL}

_FACES = {
    **_SOLID,
    "color": Type.NODE,
    "colorPerVertex": Type.BOOL,
    "ccw": Type.BOOL,
    "creaseAngle": Type.FLOAT,
    "normal": Type.NODE,
    "normalPerVertex": Type.BOOL,
    "texCoord": Type.NODE,
}

STANDARD: Mapping[str, Mapping[str, Type]] = MappingProxyType(
    {
        "Group": _CHILDREN,
        "Collision": {"collide": Type.BOOL, "proxy": Type.NODE, **_CHILDREN},
        "Anchor": {
            "description": Type.STRING,
            "parameter": Type.STRING_LIST,
            "url": Type.STRING_LIST,
            **_CHILDREN,
        },
        "Billboard": {"axisOfRotation": Type.VECTOR, **_CHILDREN},
        "Transform": {
            **FIELDS["Transform"],
            "scale": Type.VECTOR,
            "scaleOrientation": Type.ROTATION,
            **_BOX,
        },
        "Switch": FIELDS["Switch"],
        "LOD": {"level": Type.NODE_LIST, "range": Type.FLOAT_LIST, "center": Type.VECTOR},
        "Inline": {"url": Type.STRING_LIST, **_BOX},
        "Shape": FIELDS["Shape"],
        "Appearance": {
            "material": Type.NODE,
            "texture": Type.NODE,
            "textureTransform": Type.NODE,
        },
        "Material": {**FIELDS["Material"], "emissiveColor": Type.COLOR},
        "IndexedFaceSet": {
            **_FACES,
            "coord": Type.NODE,
            "convex": Type.BOOL,
            "coordIndex": Type.INT_LIST,
            "colorIndex": Type.INT_LIST,
            "normalIndex": Type.INT_LIST,
            "texCoordIndex": Type.INT_LIST,
        },
        "ElevationGrid": {
            **_FACES,
            "height": Type.FLOAT_LIST,
            "xDimension": Type.INT,
            "xSpacing": Type.FLOAT,
            "zDimension": Type.INT,
            "zSpacing": Type.FLOAT,
        },
        "Extrusion": {
            **_SOLID,
            "beginCap": Type.BOOL,
            "endCap": Type.BOOL,
            "ccw": Type.BOOL,
            "convex": Type.BOOL,
            "creaseAngle": Type.FLOAT,
            "crossSection": Type.PAIR_LIST,
            "orientation": Type.ROTATION_LIST,
            "scale": Type.PAIR_LIST,
            "spine": Type.VECTOR_LIST,
        },
        # Later programs write `solid` of solids too.
        "Box": {"size": Type.VECTOR, **_SOLID},
        "Cone": {
            **_SOLID,
            "bottomRadius": Type.FLOAT,
            "height": Type.FLOAT,
            "side": Type.BOOL,
            "bottom": Type.BOOL,
        },
        "Cylinder": {
            **_SOLID,
            "radius": Type.FLOAT,
            "height": Type.FLOAT,
            "side": Type.BOOL,
            "top": Type.BOOL,
            "bottom": Type.BOOL,
        },
        "Sphere": {"radius": Type.FLOAT, **_SOLID},
        "Coordinate": FIELDS["Coordinate"],
        "Color": {"color": Type.COLOR_LIST},
        "Normal": FIELDS["Normal"],
        "TextureCoordinate": {"point": Type.PAIR_LIST},
    }
)
"""Types of the fields of each node that is read, as far as a file can set them."""

TEXTURES = ("ImageTexture", "PixelTexture", "MovieTexture")
"""Kinds of nodes that are textures."""

IGNORED_NODES = frozenset(
    [
        *("NULL", "WorldInfo", "NavigationInfo", "Viewpoint", "Background", "Fog"),
        *("DirectionalLight", "PointLight", "SpotLight", "Sound", "AudioClip", "FontStyle"),
        *("Coordinate", "Color", "Normal", "TextureCoordinate", "TextureTransform"),
        *("Appearance", "Material", "TimeSensor", "TouchSensor", "PlaneSensor", "SphereSensor"),
        *("CylinderSensor", "ProximitySensor", "VisibilitySensor", "Script", "ColorInterpolator"),
        *("CoordinateInterpolator", "NormalInterpolator", "OrientationInterpolator"),
        *("PositionInterpolator", "ScalarInterpolator", *TEXTURES),
    ]
)
"""Nodes without a surface of their own, which are not reported as left out."""
