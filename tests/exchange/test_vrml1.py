"""Test VRML 1.0: shapes, properties in their order, groups that restore them, and materials."""

from __future__ import annotations

import numpy as np
import pytest

from katana450.extensions.importers.shape_file import Format, ShapeFile, Up, read_shape
from tests.exchange.solids import sides, volume

SQUARE = "Coordinate3 { point [ 0 0 0, 1 0 0, 1 1 0, 0 1 0 ] }"


def read(text: str) -> ShapeFile:
    data = f"#VRML V1.0 ascii\n{text}".encode()
    return read_shape(data, Format.WRL, "world.wrl", 1e-3, Up.Z)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("Cube { width 1 height 2 depth 3 }", [1.0, 2.0, 3.0]),
        ("Sphere { radius 2 }", [4.0, 4.0, 4.0]),
        ("Cylinder { parts (SIDES | TOP) radius 2 height 1 }", [4.0, 1.0, 4.0]),
        ("Cone { parts SIDES bottomRadius 1 height 5 }", [2.0, 5.0, 2.0]),
        ("Scale { scaleFactor 2 1 1 } Translation { translation 9 9 9 } Cube { }", [4.0, 2.0, 2.0]),
        ("Rotation { rotation 0 0 1 1.5707963 } Cube { width 8 }", [2.0, 8.0, 2.0]),
        ("MatrixTransform { matrix 2 0 0 0 0 1 0 0 0 0 1 0 5 6 7 1 } Cube { }", [4.0, 2.0, 2.0]),
        ("Transform { scaleFactor 1 1 3 center 1 1 1 } Cube { }", [2.0, 2.0, 6.0]),
    ],
)
def test_shapes_and_transforms(text: str, expected: list[float]) -> None:
    assert sides(read(f"Separator {{ {text} }}")) == pytest.approx(expected, rel=0.01)


def test_groups_restore_what_they_should() -> None:
    step = "Translation { translation 10 0 0 }"
    ends = {"Separator": 2.0, "TransformSeparator": 2.0, "WWWAnchor": 2.0, "Group": 12.0}
    for group, width in ends.items():
        shape = read(f"Cube {{ }} {group} {{ {step} }} Cube {{ }}")
        assert sides(shape)[0] == pytest.approx(width), group
    red = "Material { diffuseColor 1 0 0 }"
    kept = read(f"TransformSeparator {{ {red} }} Cube {{ }}").colours
    assert kept is not None
    assert kept[0].tolist() == [255, 0, 0, 255]
    assert read(f"Separator {{ {red} }} Cube {{ }}").colours is None


@pytest.mark.parametrize(("which", "faces"), [("", 0), ("whichChild 1", 12), ("whichChild -3", 24)])
def test_a_switch_shows_its_choice(which: str, faces: int) -> None:
    far = "Translation { translation 50 0 0 } Cube { }"
    shape = read(f"Switch {{ {which} Cube {{ }} Cube {{ width 5 }} }} {far} LOD {{ Cube {{ }} }}")
    assert len(shape.faces) == faces + 24


def test_nodes_are_used_again_with_the_current_properties() -> None:
    shape = read(
        "DEF C+1 Cube { } Translation { translation 5 0 0 } "
        "Material { diffuseColor 0 0 1 transparency 0.5 } USE C+1"
    )
    assert sides(shape) == pytest.approx([7.0, 2.0, 2.0])
    assert shape.colours is not None
    assert np.unique(shape.colours, axis=0).tolist() == [[0, 0, 255, 128], [204, 204, 204, 255]]


@pytest.mark.parametrize(
    ("binding", "index", "colours"),
    [
        ("OVERALL", "", [[255, 0, 0, 255]]),
        ("PER_FACE", "", [[0, 0, 255, 255], [255, 0, 0, 255]]),
        ("PER_FACE_INDEXED", "materialIndex [ 1, 1 ]", [[0, 0, 255, 255]]),
        ("PER_VERTEX_INDEXED", "materialIndex [ 0, 0, 0, -1, 1, 1, 1 ]",
         [[0, 0, 255, 255], [255, 0, 0, 255]]),
    ],
)  # fmt: skip
def test_materials_are_bound(binding: str, index: str, colours: list[list[int]]) -> None:
    shape = read(
        f"{SQUARE} Material {{ diffuseColor [ 1 0 0, 0 0 1 ] }} MaterialBinding {{ value {binding} "
        f"}} IndexedFaceSet {{ coordIndex [ 0, 1, 2, -1, 0, 2, 3, -1 ] {index} }}"
    )
    assert shape.colours is not None
    assert np.unique(shape.colours, axis=0).tolist() == colours


def test_clockwise_faces_are_turned() -> None:
    faces = "IndexedFaceSet { coordIndex [ 0, 1, 2, 3 ] }"
    for order, up in (("CLOCKWISE", -1.0), ("COUNTERCLOCKWISE", 1.0)):
        shape = read(f"{SQUARE} ShapeHints {{ vertexOrdering {order} }} {faces}")
        a, b, c = np.moveaxis(shape.vertices[shape.faces], 1, 0)
        assert (np.sign(np.cross(b - a, c - a)[:, 2]) == up).all()


def test_other_content_is_reported() -> None:
    shape = read(
        "Info { string \"by { hand\" } Texture2 { filename ../a.jpg image 1 1 3 0xFF00FF } Cube { }"
        " AsciiText { string [ \"a\", \"b\" ] justification CENTER } Wobbler { fields [ SFLong a ]"
        " isA [ \"Cube\" ] a 1 Cube { } } WWWInline { name \"b.wrl\" }"
    )  # fmt: skip
    assert volume(shape) == pytest.approx(8e-9)
    assert "Left out: pictures on the surface, Wobbler." in shape.text
    assert "not there: b.wrl" in shape.text
