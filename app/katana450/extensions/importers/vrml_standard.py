"""Nodes of VRML97 and X3D that concern surfaces, and nodes that can be ignored.

Fields, types and defaults are those of ISO/IEC 14772-1:1997, chapter 6, and of ISO/IEC 19775-1:2023
for the nodes of X3D that VRML97 does not have.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from katana450.extensions.export.vrml_node import FIELDS, Type

_BOX = {"bboxCenter": Type.VECTOR, "bboxSize": Type.VECTOR}

_CHILDREN = {"children": Type.NODE_LIST, **_BOX}

_SOLID = {"solid": Type.BOOL}

_PAINTED = {"color": Type.NODE, "colorPerVertex": Type.BOOL}

_FACES = {
    **_PAINTED,
    "ccw": Type.BOOL,
    "solid": Type.BOOL,
    "creaseAngle": Type.FLOAT,
    "normal": Type.NODE,
    "normalPerVertex": Type.BOOL,
    "texCoord": Type.NODE,
}

_SET = {**_FACES, "coord": Type.NODE}

_INDEX = {"index": Type.INT_LIST}

_TRANSFORM = {
    **FIELDS["Transform"],
    "scale": Type.VECTOR,
    "scaleOrientation": Type.ROTATION,
    **_BOX,
}

_ARC = {"startAngle": Type.FLOAT, "endAngle": Type.FLOAT, "radius": Type.FLOAT}

_SETS: Mapping[str, Mapping[str, Type]] = {
    "TriangleSet": {},
    "TriangleFanSet": {"fanCount": Type.INT_LIST},
    "TriangleStripSet": {"stripCount": Type.INT_LIST},
    "QuadSet": {},
    "IndexedTriangleSet": _INDEX,
    "IndexedTriangleFanSet": _INDEX,
    "IndexedTriangleStripSet": _INDEX,
    "IndexedQuadSet": _INDEX,
}
"""Own fields of the sets of triangles and quadrangles of X3D."""

STANDARD: Mapping[str, Mapping[str, Type]] = MappingProxyType(
    {
        "Group": _CHILDREN,
        "StaticGroup": _CHILDREN,
        "Collision": {"collide": Type.BOOL, "proxy": Type.NODE, **_CHILDREN},
        "Anchor": {
            "description": Type.STRING,
            "parameter": Type.STRING_LIST,
            "url": Type.STRING_LIST,
            **_CHILDREN,
        },
        "Billboard": {"axisOfRotation": Type.VECTOR, **_CHILDREN},
        "Transform": _TRANSFORM,
        "HAnimHumanoid": {
            "skeleton": Type.NODE_LIST,
            "skin": Type.NODE_LIST,
            **{name: kind for name, kind in _TRANSFORM.items() if name != "children"},
        },
        "HAnimJoint": _TRANSFORM,
        "HAnimSegment": _CHILDREN,
        "HAnimSite": _TRANSFORM,
        "CADLayer": _CHILDREN,
        "CADAssembly": _CHILDREN,
        "CADPart": _TRANSFORM,
        "CADFace": {"shape": Type.NODE, **_BOX},
        # X3D has children in the place of choice and level.
        "Switch": {"choice": Type.NODE_LIST, "whichChoice": Type.INT, **_CHILDREN},
        "LOD": {
            "level": Type.NODE_LIST,
            "range": Type.FLOAT_LIST,
            "center": Type.VECTOR,
            **_CHILDREN,
        },
        "Inline": {"url": Type.STRING_LIST, **_BOX},
        "Shape": FIELDS["Shape"],
        "Appearance": {
            "material": Type.NODE,
            "texture": Type.NODE,
            "textureTransform": Type.NODE,
        },
        "Material": {
            **FIELDS["Material"],
            "emissiveColor": Type.COLOR,
            "transparency": Type.FLOAT,
        },
        "PhysicalMaterial": {
            "baseColor": Type.COLOR,
            "emissiveColor": Type.COLOR,
            "transparency": Type.FLOAT,
            "metallic": Type.FLOAT,
            "roughness": Type.FLOAT,
        },
        "UnlitMaterial": {"emissiveColor": Type.COLOR, "transparency": Type.FLOAT},
        **{name: {**_SET, **own} for name, own in _SETS.items()},
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
            "beginCap": Type.BOOL,
            "endCap": Type.BOOL,
            "ccw": Type.BOOL,
            "convex": Type.BOOL,
            "creaseAngle": Type.FLOAT,
            "solid": Type.BOOL,
            "crossSection": Type.PAIR_LIST,
            "orientation": Type.ROTATION_LIST,
            "scale": Type.PAIR_LIST,
            "spine": Type.VECTOR_LIST,
        },
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
        "IndexedLineSet": {
            **_PAINTED,
            "coord": Type.NODE,
            "coordIndex": Type.INT_LIST,
            "colorIndex": Type.INT_LIST,
        },
        "LineSet": {"coord": Type.NODE, "color": Type.NODE, "vertexCount": Type.INT_LIST},
        "PointSet": {"coord": Type.NODE, "color": Type.NODE},
        "Arc2D": _ARC,
        "ArcClose2D": {"closureType": Type.STRING, **_ARC, **_SOLID},
        "Circle2D": {"radius": Type.FLOAT},
        "Disk2D": {"innerRadius": Type.FLOAT, "outerRadius": Type.FLOAT, **_SOLID},
        "Polyline2D": {"lineSegments": Type.PAIR_LIST},
        "Polypoint2D": {"point": Type.PAIR_LIST},
        "Rectangle2D": {"size": Type.PAIR, **_SOLID},
        "TriangleSet2D": {"vertices": Type.PAIR_LIST, **_SOLID},
        "Text": {
            "string": Type.STRING_LIST,
            "fontStyle": Type.NODE,
            "length": Type.FLOAT_LIST,
            "maxExtent": Type.FLOAT,
            **_SOLID,
        },
        "FontStyle": {
            "family": Type.STRING_LIST,
            "horizontal": Type.BOOL,
            "justify": Type.STRING_LIST,
            "language": Type.STRING,
            "leftToRight": Type.BOOL,
            "size": Type.FLOAT,
            "spacing": Type.FLOAT,
            "style": Type.STRING,
            "topToBottom": Type.BOOL,
        },
        "Coordinate": FIELDS["Coordinate"],
        "CoordinateDouble": FIELDS["Coordinate"],
        "Color": {"color": Type.COLOR_LIST},
        "ColorRGBA": {"color": Type.RGBA_LIST},
        "Normal": FIELDS["Normal"],
        "TextureCoordinate": {"point": Type.PAIR_LIST},
    }
)
"""Types of the fields of each node, as far as a file can set them."""

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
        *("PositionInterpolator", "ScalarInterpolator", "CoordinateDouble", "ColorRGBA"),
        *("PhysicalMaterial", "UnlitMaterial", "KeySensor", "StringSensor", "LoadSensor"),
        *("BooleanFilter", "BooleanSequencer", "BooleanToggle", "BooleanTrigger", "TimeTrigger"),
        *("IntegerSequencer", "IntegerTrigger", "ViewpointGroup", "TextureBackground"),
    ]
)
"""Nodes without a surface of their own, which are not reported as left out."""
