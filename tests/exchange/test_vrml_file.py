"""Tests of foreign VRML97: geometry nodes, grouping nodes, omitted and refused nodes."""

from __future__ import annotations

import gzip

import numpy as np
import pytest

from katana450.errors import InputError
from katana450.extensions.export.vrml.vrml_world import HEADER
from katana450.extensions.importers.formats.shape_file import Format, ShapeFile, Up, read_shape
from katana450.maths.geometry import so3
from tests.exchange.solids import is_closed, sides, volume

PRISM = 16.0 * np.sin(np.pi / 16.0)
"""Area of the polygon of 32 corners on the unit circle."""


def world(text: str, unit: float = 0.1) -> ShapeFile:
    return read_shape(f"{HEADER}\n{text}".encode(), Format.WRL, "world.wrl", unit, Up.Z)


def shown(geometry: str, unit: float = 0.1) -> ShapeFile:
    return world(f"Shape {{ geometry {geometry} }}", unit)


BOX = "Shape { geometry Box { } }"

SQUARE = "IndexedFaceSet { coord Coordinate { point [ 0 0 0, 1 0 0, 1 1 0, 0 1 0 ] } %s }"


@pytest.mark.parametrize(
    ("geometry", "litres", "size"),
    [
        ("Box { }", 8.0, [200, 200, 200]),
        ("Box { solid FALSE size 1 2 3 }", 6.0, [100, 200, 300]),
        ("Cylinder { radius 2 height 1 }", 4.0 * PRISM, [400, 100, 400]),
        ("Cone { bottomRadius 2 height 3 }", 4.0 * PRISM, [400, 300, 400]),
        ("Extrusion { }", 4.0, [200, 100, 200]),
        ("Extrusion { spine [ 1 0 0, 4 0 0 ] }", 12.0, [300, 200, 200]),
        ("Extrusion { spine [ 0 0 0, 0 1 0, 0 3 0 ] scale [ 1 1, 2 1, 2 1 ] }", 22.0, None),
        ("Extrusion { spine [ 0 4 0, 0 0 0 ] orientation 0 1 0 .5 }", 16.0, None),
    ],
)
def test_solids_have_their_volume(geometry: str, litres: float, size: list[float] | None) -> None:
    shape = shown(geometry)
    assert volume(shape) * 1e3 == pytest.approx(litres, rel=1e-9)
    assert is_closed(shape)
    assert size is None or sides(shape) == size


def test_a_sphere_is_round() -> None:
    shape = shown("Sphere { radius 3 }")
    np.testing.assert_allclose(np.linalg.norm(shape.vertices, axis=1), 0.3)
    assert volume(shape) == pytest.approx(4.0 / 3.0 * np.pi * 0.027, rel=0.03)
    assert is_closed(shape)


def test_a_bent_extrusion_is_a_mitred_tube() -> None:
    """A square frame with four mitres has the square's area times its middle line as volume."""
    shape = shown(
        "Extrusion { crossSection [ -.1 -.1, -.1 .1, .1 .1, .1 -.1, -.1 -.1 ] beginCap FALSE "
        "endCap FALSE spine [ 0 0 0, 2 0 0, 2 2 0, 0 2 0, 0 0 0 ] }"
    )
    assert is_closed(shape)
    # The standard's planes bisect the corners but do not widen the section there.
    assert abs(volume(shape) * 1e3) == pytest.approx(0.04 * 8.0 * np.sqrt(0.5), rel=1e-6)


def test_the_sides_of_solids_can_be_left_out() -> None:
    tube = shown("Cylinder { bottom FALSE top FALSE }")
    disc = shown("Cylinder { side FALSE top FALSE }")
    assert (len(tube.faces), len(disc.faces)) == (64, 32)
    assert sides(disc)[1] == 0.0


@pytest.mark.parametrize(
    ("fields", "colours"),
    [
        ("coordIndex [ 0 1 2 -1 0 2 3 ]", None),
        (
            (
                "coordIndex [ 0 1 2 -1 0 2 3 -1 ] colorPerVertex FALSE "
                "color Color { color [ 1 0 0, 0 1 0 ] }"
            ),
            [[255, 0, 0, 255], [0, 255, 0, 255]],
        ),
        (
            (
                "coordIndex [ 0 1 2 -1 0 2 3 -1 ] colorPerVertex FALSE colorIndex [ 1 0 ] "
                "color Color { color [ 1 0 0, 0 1 0 ] }"
            ),
            [[0, 255, 0, 255], [255, 0, 0, 255]],
        ),
        (
            (
                "coordIndex [ 0 1 2 -1 0 2 3 -1 ] colorIndex [ 0 0 0 -1 1 1 0 -1 ] "
                "color Color { color [ 1 0 0, 0 1 0 ] }"
            ),
            [[255, 0, 0, 255], [85, 170, 0, 255]],
        ),
    ],
)
def test_faces_have_their_colours(fields: str, colours: list[list[int]] | None) -> None:
    shape = shown(SQUARE % fields)
    shape_colours = None if shape.colours is None else shape.colours.tolist()
    assert (len(shape.faces), shape_colours) == (2, colours)


def test_clockwise_faces_are_turned_over() -> None:
    up, down = (shown(SQUARE % f"coordIndex [ 0 1 2 3 ] ccw {ccw}") for ccw in ("TRUE", "FALSE"))
    for shape, side in ((up, 1.0), (down, -1.0)):
        a, b, c = shape.vertices[shape.faces[0]]
        assert np.cross(b - a, c - a)[2] * side > 0.0


def test_transforms_follow_the_standard() -> None:
    """Compute P' = T C R SR S -SR -C P factor by factor."""
    shape = world(
        "Transform { translation 1 2 3 center .5 0 .25 rotation 0 0 2 .7 scale 1 2 -1.5 "
        "scaleOrientation 1 0 0 .4 children Transform { rotation 0 1 0 1 children Shape { geometry "
        + SQUARE % "coordIndex [ 0 1 2 3 ]"
        + " } } }"
    )
    center, SR = np.array((0.5, 0.0, 0.25)), so3.rotation_x(0.4)
    expected = []
    for corner in ((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)):
        p = SR.T @ (so3.rotation_y(1.0) @ corner - center)
        p = so3.rotation_z(0.7) @ SR @ (p * (1.0, 2.0, -1.5))
        expected.append(0.1 * (p + center + (1.0, 2.0, 3.0)))
    for point in expected:
        assert np.abs(shape.vertices - point).max(axis=1).min() < 1e-12


def test_a_mirrored_solid_keeps_its_outside() -> None:
    shape = world("Transform { scale -1 1 1 children Shape { geometry Cone { } } }")
    assert volume(shape) > 0.0


@pytest.mark.parametrize(
    "group",
    [
        "Group { children [ %s NULL ] }",
        'Anchor { url [ "x.wrl" ] children %s }',
        "Billboard { children %s }",
        "Collision { proxy Shape { geometry Sphere { } } children %s }",
        "Switch { whichChoice 1 choice [ Shape { geometry Sphere { } } %s ] }",
        "LOD { range 9 level [ %s Shape { geometry Sphere { } } ] }",
        "DEF a Group { children %s ROUTE a.x TO a.y } ROUTE a.x TO b.set_x",
        "DEF a Group { } DEF a Group { children %s }",
        "Switch { choice DEF b %s } USE b",
        'Script { field SFNode it DEF c Group { } url [ "javascript: {" ] } USE c %s',
        "DEF T TimeSensor { cycleInterval 3 } %s PointLight { location 1 2 3 }",
    ],
)
def test_groups_show_what_is_in_them(group: str) -> None:
    shape = world(group % "Shape { appearance NULL geometry Box { } }")
    assert volume(shape) == pytest.approx(8e-3)
    assert "Left out" not in shape.text


def test_ignored_content_is_reported() -> None:
    shape = world(
        'Inline { url "a.wrl" } Wobbler { speed [ 1 2 ] inner Wobbler { a TRUE b "c" } } '
        "Shape { geometry Text { } } "
        'Shape { geometry Box { } appearance Appearance { texture ImageTexture { url "a" } } }'
    )
    assert volume(shape) == pytest.approx(8e-3)
    for what in (
        "It names files that are not there: a.wrl",
        "Wobbler",
        "Text",
        "pictures on the surface",
    ):
        assert what in shape.text


def test_materials_give_colour_and_opacity() -> None:
    def material(fields: str) -> list[int]:
        look = f"Appearance {{ material Material {{ {fields} }} }}"
        colours = world(f"Shape {{ appearance {look} geometry Box {{ }} }}").colours
        assert colours is not None
        return [int(part) for part in colours[0]]

    assert material("") == [204, 204, 204, 255]
    assert material("diffuseColor 1 .5 0 transparency .5") == [255, 128, 0, 128]
    assert material("diffuseColor 0 0 0 emissiveColor 0 0 1") == [0, 0, 255, 255]
    both = world(
        "Shape { geometry Box { } } Shape { geometry Sphere { } appearance Appearance { "
        "material Material { diffuseColor 1 0 0 } } }"
    )
    assert both.colours is not None
    assert {tuple(row) for row in both.colours.tolist()} == {
        (204, 204, 204, 255),
        (255, 0, 0, 255),
    }


def test_byte_order_mark_is_read() -> None:
    text = f"\ufeff{HEADER} by hand\nShape {{ geometry Box {{ }} }}"
    assert volume(read_shape(text.encode(), Format.WRL, "a.wrl")) == pytest.approx(8.0)


def chain(links: int, fan: int, shape: str = "Shape { geometry Box { } }") -> str:
    """Return nodes of which each uses the one before ``fan`` times."""
    rows = [f"DEF n0 Group {{ children {shape} }}"]
    rows += [f"DEF n{i} Group {{ children [ {f'USE n{i - 1} ' * fan}] }}" for i in range(1, links)]
    return f"Switch {{ choice [ {' '.join(rows[:-1])} ] }} {rows[-1]}"


def test_nodes_that_use_others_can_be_deep() -> None:
    assert volume(world(chain(5000, 1))) == pytest.approx(8e-3)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "has no triangles"),
        (
            "Shape { geometry Text { } }",
            "has no triangles. It has Text. An object needs a surface: save it",
        ),
        (chain(40, 2), "more than 40000 nodes"),
        (chain(40, 2, "Group { }"), "more than 40000 nodes"),
        (chain(14, 2, "Shape { geometry Sphere { } }"), "more than 500000 triangles"),
        ("Group { children " * 300, "line 2: nodes are nested more than 150 deep"),
        ("PROTO Bolt [ ] { Group { } }", "has no triangles"),
        (
            'EXTERNPROTO Bolt [ field SFTime t ] [ "b.wrl" ] Bolt { t 1 }',
            "no triangles. It has Bolt",
        ),
        ("\nGroup { colour }", "line 3: Group has no field 'colour'"),
        ("Shape { geometry 7 }", "Shape.geometry must be a node"),
        ("Collision { collide maybe }", "line 2: expected '{', not '}'"),
        ("Shape { geometry Box { size [ 1 ", "line 2: the file ends too early"),
        ("Group { DEF", "line 2: Group has no field 'DEF'"),
        ("DEF a Group { children USE a }", "'a' is used before it is defined"),
        ("Wobbler { a [ } ]", "expected a value, not '}'"),
        ("Wobbler { a { ", "expected a value, not '{'"),
        ("Wobbler", "expected '{'"),
        ("Shape { geometry Box { size 1 0 0 } }", "has no triangles"),
        ("Shape { geometry Sphere { radius -1 } }", "It has Sphere without a size"),
        ("Shape { geometry Extrusion { spine [ 0 0 0 ] } }", "too few points"),
        ("Shape { geometry ElevationGrid { height [ 1 ] } }", "It has ElevationGrid"),
        ("Shape { geometry Box { size 1 2 } }", "Box.size has 2 numbers, not 3"),
        ("Shape { geometry Box { size TRUE } }", "Box.size must be numbers"),
        ("Shape { geometry Cone { side 1 } }", "Cone.side must be TRUE or FALSE"),
        ("Transform { children Shape { } rotation 0 0 1 }", "Transform.rotation has 3"),
        (f"Shape {{ geometry {SQUARE % 'coordIndex [ 0 1 .5 ]'} }}", "must be whole numbers"),
        ("Shape { geometry Extrusion { spine [ 1 2 3 4 ] } }", "are no rows of 3"),
        (
            f"Shape {{ geometry {SQUARE % 'coordIndex [ 0 1 4 ]'} }}",
            "a face with vertex 4, counted from 0, but only 4 vertices",
        ),
        (
            f"Shape {{ geometry {SQUARE % 'coordIndex [ 0 1 99999999999 ]'} }}",
            "with vertex 99999999999",
        ),
        (
            f"Transform {{ scale 1e9 1 1 children Transform {{ scale 1e300 1 1 children {BOX} }}}}",
            "not finite numbers",
        ),
        ("Shape { geometry Box { size nan 1 1 } }", "not finite numbers"),
    ],
)
def test_invalid_worlds_are_refused(text: str, said: str) -> None:
    with pytest.raises(InputError, match=said):
        world(text)


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (b"", "must begin"),
        (b"Shape { geometry Box { } }", "must begin"),
        (b"#VRML V1.0 ascii\nCube { }", "is VRML 1.0 or X3D, which is not read. Export it"),
        (b'<?xml version="1.0"?><X3D/>', "is VRML 1.0 or X3D, which is not read. Export"),
        (b"#X3D V3.2 utf8\n", "is VRML 1.0 or X3D, which is not read. Export"),
        (gzip.compress(b"#VRML V2.0 utf8\n", mtime=0), "is compressed by gzip. Unpack it"),
    ],
)
def test_invalid_vrml_is_refused(data: bytes, said: str) -> None:
    with pytest.raises(InputError, match=said):
        read_shape(data, Format.WRL, "a.wrl")


@pytest.mark.parametrize(
    ("text", "note"),
    [
        (f"Shape {{ geometry {SQUARE % 'coordIndex [ 0 1 2 ] color Color { }'} }}", "colours that"),
        (f"{BOX} Shape {{ geometry Extrusion {{ spine [ 0 0 0 ] }} }}", "too few points"),
        (f'{BOX} Inline {{ url "..\\parts\\a.wrl" }}', "not there: ../parts/a.wrl"),
        (f"{BOX} Shape {{ geometry IndexedLineSet {{ }} }}", "Left out: IndexedLineSet."),
        (f"{BOX} Box {{ }}", "Left out: Box."),
    ],
)
def test_a_contradiction_leaves_the_rest_of_the_world(text: str, note: str) -> None:
    shape = world(text)
    assert note in shape.text
    assert shape.colours is None


@pytest.mark.parametrize(
    ("geometry", "size"),
    [
        ("Box { size 4 0 2 }", [400.0, 0.0, 200.0]),
        ("Cylinder { radius 2 height 0 }", [400.0, 0.0, 400.0]),
        ("Cone { bottomRadius 2 height 0 }", [400.0, 0.0, 400.0]),
    ],
)
def test_a_solid_without_a_height_is_a_plate(geometry: str, size: list[float]) -> None:
    assert sides(shown(geometry)) == pytest.approx(size)


def test_normals_may_be_no_numbers() -> None:
    shape = shown(SQUARE % "coordIndex [ 0 1 2 3 ] normal Normal { vector [ nan -NaN 1, 0 0 1 ] }")
    assert len(shape.faces) == 2
