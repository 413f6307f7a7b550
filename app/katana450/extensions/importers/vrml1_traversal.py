"""The visible surfaces of a VRML 1.0 world, by a traversal that keeps the current properties.

Source: G. Bell, A. Parisi, M. Pesce, The Virtual Reality Modeling Language, version 1.0 (1996).
Nodes of shapes become nodes of VRML97, whose surfaces are then the same.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from katana450.errors import InputError
from katana450.extensions.export.vrml_node import Node, Value
from katana450.extensions.importers.surface import MAX_COPIES, MeshBuilder, MeshSurface
from katana450.extensions.importers.vrml1_reader import Node1
from katana450.extensions.importers.vrml_flattening import Shown, placed
from katana450.extensions.importers.vrml_lines import LINES
from katana450.extensions.importers.vrml_shapes import surface_of
from katana450.maths.geometry.arrays import FloatArray

ALL, NONE = -3, -1
"""Values of `whichChild`."""

IGNORED = frozenset(
    [
        *(
            "Info",
            "NavigationInfo",
            "Background",
            "Fog",
            "Normal",
            "NormalBinding",
            "TextureCoordinate2",
        ),
        *("Texture2Transform", "OrthographicCamera", "PerspectiveCamera", "DirectionalLight"),
        *("PointLight", "SpotLight", "BaseColor", "Complexity", "LightModel", "DrawStyle"),
    ]
)
"""Nodes that change no surface, or whose effect the traversal has read already."""


@dataclass(frozen=True, eq=False)
class State:
    """The properties that apply to the next shape.

    Attributes:
        T: (4, 4) pose of its frame.
        points: coordinates of the vertices, flat.
        material: the latest Material.
        binding: parts of a shape to which materials belong.
        clockwise: whether faces are clockwise seen from outside.
        font: the latest FontStyle.
    """

    T: FloatArray = field(default_factory=lambda: np.eye(4))
    points: tuple[float, ...] = ()
    material: Node1 | None = None
    binding: str = "OVERALL"
    clockwise: bool = False
    font: Node1 = field(default_factory=lambda: Node1("FontStyle"))


class Traversal:
    """A traversal of all nodes in their order."""

    def __init__(self, name: str, left_out: Counter[str], shown: Shown) -> None:
        """Prepare the file ``name``; see ``Flattening``."""
        self._name, self._left_out, self._shown = name, left_out, shown
        self._builder = MeshBuilder(name)
        self._surfaces: dict[object, MeshSurface | None] = {}
        self._state = State()
        self._visits = 0

    def surface(self, nodes: list[Node1]) -> MeshSurface:
        """Return the surface of all nodes of a file."""
        for node in nodes:
            self._visit(node)
        return self._builder.surface()

    def _visit(self, node: Node1) -> None:
        self._visits += 1
        if self._visits > MAX_COPIES:
            raise InputError(
                f"{self._name} shows more than {MAX_COPIES} nodes, each counted as often as it is "
                "used."
            )
        state = self._state
        match node.kind:
            case "Separator" | "WWWAnchor":
                self._visit_all(node.children)
                self._state = state
            case "TransformSeparator":
                self._visit_all(node.children)
                self._state = replace(self._state, T=state.T)
            case "Group":
                self._visit_all(node.children)
            case "LOD":
                self._visit_all(node.children[:1])
            case "Switch":
                chosen = int(_number(node, "whichChild", NONE))
                last = len(node.children) if chosen == ALL else max(chosen, NONE) + 1
                self._visit_all(node.children[0 if chosen == ALL else max(chosen, 0) : last])
            case "WWWInline":
                found = self._shown(node.words("name"))
                if found is not None:
                    self._builder.add(found.moved(state.T))
            case kind if kind in PROPERTIES:
                with np.errstate(over="ignore", invalid="ignore"):
                    self._state = PROPERTIES[kind](node, state)
            case kind if kind in SHAPES:
                self._shape(node)
            case "Texture2":
                if node.fields.keys() & {"filename", "image"}:
                    self._left_out["pictures on the surface"] += 1
            case kind if kind not in IGNORED:
                self._left_out[kind] += 1

    def _visit_all(self, nodes: list[Node1]) -> None:
        for node in nodes:
            self._visit(node)

    def _shape(self, node: Node1) -> None:
        state = self._state
        # The same shape with other properties is another surface.
        key = (node, state.points, state.material, state.binding, state.clockwise, state.font)
        mark = tuple(each if isinstance(each, str | bool) else id(each) for each in key)
        if mark not in self._surfaces:
            shape = SHAPES[node.kind](node, state)
            self._surfaces[mark] = surface_of(shape, self._name, self._left_out)
        surface = self._surfaces[mark]
        if surface is not None:
            colour = _colour(state.material, glows=node.kind in LINES)
            self._builder.add(surface.painted(colour).moved(state.T))


def _number(node: Node1, name: str, default: float) -> float:
    return next(iter(node.numbers(name, (default,))), default)


def _row(node: Node1, name: str, default: tuple[float, ...]) -> tuple[float, ...]:
    """Return a field of as many numbers as ``default`` has."""
    found = node.numbers(name, default)
    return found if len(found) == len(default) else default


def _moved(node: Node1, state: State) -> State:
    """Return the state after a Transform, Translation, Rotation or Scale."""
    fields: tuple[tuple[str, Value], ...] = (
        ("translation", _row(node, "translation", (0.0,) * 3)),
        ("center", _row(node, "center", (0.0,) * 3)),
        ("scale", _row(node, "scaleFactor", (1.0,) * 3)),
        ("rotation", _row(node, "rotation", (0.0, 0.0, 1.0, 0.0))),
        ("scaleOrientation", _row(node, "scaleOrientation", (0.0, 0.0, 1.0, 0.0))),
    )
    return replace(state, T=state.T @ placed(Node("Transform", fields)))


def _by_matrix(node: Node1, state: State) -> State:
    # A point is a row that is multiplied from the left.
    matrix = np.array(_row(node, "matrix", tuple(np.eye(4).ravel().tolist()))).reshape(4, 4)
    return replace(state, T=state.T @ matrix.T)


PROPERTIES: dict[str, Callable[[Node1, State], State]] = {
    **dict.fromkeys(("Transform", "Translation", "Rotation", "Scale"), _moved),
    "MatrixTransform": _by_matrix,
    "Coordinate3": lambda node, state: replace(state, points=node.numbers("point", ())),
    "Material": lambda node, state: replace(state, material=node),
    "MaterialBinding": lambda node, state: replace(
        state, binding=next(iter(node.words("value")), "OVERALL")
    ),
    "FontStyle": lambda node, state: replace(state, font=node),
    "ShapeHints": lambda node, state: replace(
        state, clockwise="CLOCKWISE" in node.words("vertexOrdering")
    ),
}
"""The state after a node, by its kind."""


def _cube(node: Node1, _state: State) -> Node:
    sides = tuple(_number(node, name, 2.0) for name in ("width", "height", "depth"))
    return Node("Box", (("size", sides),))


def _cone(node: Node1, _state: State) -> Node:
    parts = set(node.words("parts") or ("ALL",))
    return Node(
        "Cone",
        (
            ("bottomRadius", _number(node, "bottomRadius", 1.0)),
            ("height", _number(node, "height", 2.0)),
            ("side", bool(parts & {"ALL", "SIDES"})),
            ("bottom", bool(parts & {"ALL", "BOTTOM"})),
        ),
    )


def _cylinder(node: Node1, _state: State) -> Node:
    parts = set(node.words("parts") or ("ALL",))
    return Node(
        "Cylinder",
        (
            ("radius", _number(node, "radius", 1.0)),
            ("height", _number(node, "height", 2.0)),
            ("side", bool(parts & {"ALL", "SIDES"})),
            ("top", bool(parts & {"ALL", "TOP"})),
            ("bottom", bool(parts & {"ALL", "BOTTOM"})),
        ),
    )


def _sphere(node: Node1, _state: State) -> Node:
    return Node("Sphere", (("radius", _number(node, "radius", 1.0)),))


def _faces(node: Node1, state: State) -> Node:
    points = state.points[: len(state.points) // 3 * 3]
    fields: list[tuple[str, Value]] = [
        ("coord", Node("Coordinate", (("point", points),))),
        ("coordIndex", _index(node, "coordIndex")),
        ("ccw", not state.clockwise),
    ]
    colours = () if state.material is None else state.material.numbers("diffuseColor", ())
    if state.binding.startswith(("PER_FACE", "PER_VERTEX")) and len(colours) > 3:
        by_vertex = state.binding.startswith("PER_VERTEX")
        table = Node("Color", (("color", colours[: len(colours) // 3 * 3]),))
        fields += [("color", table), ("colorPerVertex", by_vertex)]
        index = _index(node, "materialIndex")
        if not state.binding.endswith("_INDEXED"):
            # The materials are used in turn, for each corner of each face.
            index = _in_turn(_index(node, "coordIndex")) if by_vertex else ()
        fields.append(("colorIndex", index))
    return Node("IndexedFaceSet", tuple(fields))


def _line_set(node: Node1, state: State) -> Node:
    points = state.points[: len(state.points) // 3 * 3]
    coord = Node("Coordinate", (("point", points),))
    return Node("IndexedLineSet", (("coord", coord), ("coordIndex", _index(node, "coordIndex"))))


def _point_set(node: Node1, state: State) -> Node:
    count = len(state.points) // 3
    first = int(np.clip(_number(node, "startIndex", 0.0), 0.0, count))
    last = int(np.clip(_number(node, "numPoints", -1.0), -1.0, count - first)) + first
    points = state.points[3 * first : 3 * (count if last < first else last)]
    return Node("PointSet", (("coord", Node("Coordinate", (("point", points),))),))


def _text(node: Node1, state: State) -> Node:
    style = " ".join(state.font.words("style"))
    justify = next(iter(node.words("justification")), "LEFT")
    font = Node(
        "FontStyle",
        (
            ("family", state.font.words("family")),
            ("size", _number(state.font, "size", 10.0)),
            ("style", style),
            ("spacing", _number(node, "spacing", 1.0)),
            ("justify", ({"CENTER": "MIDDLE", "RIGHT": "END"}.get(justify, "BEGIN"),)),
        ),
    )
    rows = node.words("string")
    return Node(
        "Text", (("string", rows), ("fontStyle", font), ("length", node.numbers("width", ())))
    )


def _index(node: Node1, name: str) -> tuple[float, ...]:
    """Return a field of indices, those beyond any vertex as one bound."""
    return tuple(np.clip(node.numbers(name, ()), -1.0, 2.0**31).tolist())


def _in_turn(index: tuple[float, ...]) -> tuple[float, ...]:
    """Return 0, 1, 2 ... for the corners of an index of polygons, with -1 where that has it."""
    corner = np.array(index) >= 0.0
    return tuple(np.where(corner, np.cumsum(corner) - 1, -1).tolist())


SHAPES: dict[str, Callable[[Node1, State], Node]] = {
    "Cube": _cube,
    "Cone": _cone,
    "Cylinder": _cylinder,
    "Sphere": _sphere,
    "IndexedFaceSet": _faces,
    "IndexedLineSet": _line_set,
    "PointSet": _point_set,
    "AsciiText": _text,
}
"""The node of VRML97 with the same surface, by the kind of a shape."""


def _colour(material: Node1 | None, glows: bool) -> tuple[float, ...] | None:
    """Return the first colour (4,) 0..1 of a material; None without a material.

    With ``glows``, as lines do, the shape reflects no light.
    """
    if material is None:
        return None
    diffuse = material.numbers("diffuseColor", (0.8,) * 3)[:3]
    glow = material.numbers("emissiveColor", (0.0,) * 3)[:3]
    is_glow = len(glow) == 3 and any(glow) and (glows or not any(diffuse))
    shown = glow if is_glow else diffuse
    shown = shown if len(shown) == 3 else (0.8,) * 3
    return (*shown, 1.0 - _number(material, "transparency", 0.0))
