"""Test X3D in the encoding of VRML: its statements, its nodes, and files of another program."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from katana450.cli.main import main
from katana450.errors import InputError
from katana450.extensions.importers.archive import packed
from katana450.extensions.importers.mesh_file import read_mesh_file
from katana450.extensions.importers.shape_file import Format, ShapeFile, Up, read_shape
from tests.exchange.solids import sides, triangles
from tests.exchange.tools import needs, run

FOREIGN = Path(__file__).parent / "foreign"

STATEMENTS = """\
#X3D V3.3 utf8 by hand
PROFILE Immersive
COMPONENT Geometry3D:2
META "title" "plates"
"""

POINTS = "coord Coordinate { point [ 0 0 0, 1 0 0, 1 1 0, 0 1 0 ] }"

SET = (
    "TriangleStripSet { stripCount [ 4 ] coord DEF C "
    "Coordinate { point [ 0 0 0 1 0 0 0 1 0 1 1 0 ] } }"
)

SETS = (
    STATEMENTS
    + f"""UNIT length centimetre 0.01
Shape {{ geometry {SET} }}
Transform {{ metadata MetadataString {{ value "a" }} children [
  Shape {{ geometry IndexedTriangleFanSet {{ index [ 0 1 3 2 -1 ] coord USE C }}
    appearance Appearance {{ material PhysicalMaterial {{ baseColor 1 0 0 }} }} }}
  Switch {{ whichChoice 0 children [
    Shape {{ geometry QuadSet {{ color ColorRGBA {{ color [ 1 0 0 1 0 1 0 1 0 0 1 1 1 1 1 .5 ] }}
      coord CoordinateDouble {{ point [ 0 0 0 1 0 0 1 1 0 0 1 0 ] }} }} }} ] }}
] }}
IMPORT Other.Part AS P
EXPORT C AS Corners
"""
)


def read(text: str, unit: float | None = 1e-2, **others: str) -> ShapeFile:
    """Return the shape of a world, z up, with other files of the upload by their names."""
    files = {"a.x3dv": f"{STATEMENTS}{text}"} | {f"{k}.x3dv": v for k, v in others.items()}
    data = packed("a.x3dv", {name: content.encode() for name, content in files.items()})
    return read_shape(data, Format.ZIP, "a.zip", unit, Up.Z)


@pytest.mark.parametrize(
    "geometry",
    [
        f"QuadSet {{ {POINTS} }}",
        f"IndexedQuadSet {{ index [ 0 1 2 3 ] {POINTS} }}",
        f"TriangleFanSet {{ fanCount [ 4 ] {POINTS} }}",
        f"IndexedTriangleFanSet {{ index [ 0 1 2 3 -1 ] {POINTS} }}",
        f"IndexedTriangleSet {{ index [ 0 1 2 0 2 3 ] {POINTS} }}",
        "TriangleSet { coord CoordinateDouble { point [ 0 0 0 1 0 0 1 1 0 0 0 0 1 1 0 0 1 0 ] } }",
        SET,
        f"IndexedTriangleStripSet {{ index [ 0 1 3 2 ] {POINTS} }}",
        f"IndexedTriangleStripSet {{ ccw FALSE index [ 0 3 1 2 ] {POINTS} }}",
        f"IndexedTriangleStripSet {{ index [ 0 1 3 -1 1 2 3 -1 ] {POINTS} }}",
    ],
    ids=lambda geometry: " ".join(geometry.split()[::2][:3]),
)
def test_each_set_is_the_square_and_faces_forwards(geometry: str) -> None:
    shape = read(f"Shape {{ geometry {geometry} }}")
    assert len(shape.faces) == 2
    assert sides(shape) == [10.0, 10.0, 0.0]
    a, b, c = np.moveaxis(shape.vertices[shape.faces], 1, 0)
    # Two halves of the square, both seen from the front.
    np.testing.assert_allclose(np.cross(b - a, c - a), [[0.0, 0.0, 1e-4]] * 2, atol=1e-15)
    assert shape.text.endswith("z is up, as given.")


def test_counts_beyond_the_points_are_cut() -> None:
    for count in ("9", "4 4000000000 -7", "-1 4"):
        fan = f"TriangleFanSet {{ fanCount [ {count} ] {POINTS} }}"
        assert len(read(f"Shape {{ geometry {fan} }}").faces) == 2
    quads = f"IndexedQuadSet {{ index [ 0 1 2 3 0 1 2 9 -1 1 2 3 ] {POINTS} }}"
    shape = read(f"Shape {{ geometry {quads} }}")
    assert len(shape.faces) == 2
    assert shape.text.endswith("Left out: faces whose vertices are missing.")


def test_colours_of_sets_and_of_new_materials() -> None:
    shape = read_shape(SETS.encode(), Format.of("a.x3dv"), "a.x3dv", up=Up.Z)
    assert shape.unit == 1e-2
    assert sides(shape) == [10.0, 10.0, 0.0]
    assert "the unit is cm, as in the file" in shape.text
    assert "Left out" not in shape.text
    assert shape.colours is not None
    assert shape.colours.tolist() == [
        *[[204, 204, 204, 255]] * 2,
        *[[255, 0, 0, 255]] * 2,
        [85, 85, 85, 255],
        [170, 85, 170, 212],
    ]
    glow = "Appearance { material UnlitMaterial { emissiveColor 0 0 1 } }"
    shape = read(f"Shape {{ geometry Sphere {{ solid FALSE }} appearance {glow} }}")
    assert shape.colours is not None
    assert np.unique(shape.colours, axis=0).tolist() == [[0, 0, 255, 255]]


def test_first_level_and_static_groups_are_shown() -> None:
    near = "Shape { geometry Box { } }"
    shape = read(f"LOD {{ children [ StaticGroup {{ children {near} }} Group {{ }} ] }}")
    assert len(shape.faces) == 12
    hidden = f"Switch {{ children [ {near} ] }} Shape {{ geometry {SET} }}"
    assert len(read(hidden).faces) == 2


def test_humans_and_assemblies_are_shown() -> None:
    box = "Shape { geometry Box { size 1 1 1 } }"
    human = (
        "HAnimHumanoid { translation 0 0 4 skeleton DEF R HAnimJoint { children [ HAnimSegment {"
        f" children {box} }} HAnimJoint {{ translation 2 0 0 rotation 0 0 1 1.570796 "
        f"children [ HAnimSite {{ translation 2 0 0 children {box} }} ] }} ] }} joints USE R "
        f"skin Transform {{ translation 0 -2 0 children {box} }} }}"
    )
    shape = read(human)
    assert len(shape.faces) == 3 * 12
    assert sides(shape) == pytest.approx([30.0, 50.0, 10.0])
    parts = (
        f"CADLayer {{ children CADAssembly {{ children [ CADPart {{ translation 5 0 0 children "
        f"CADFace {{ shape {box} }} }} CADFace {{ shape {box} }} ] }} }}"
    )
    shape = read(parts)
    assert (len(shape.faces), sides(shape)) == (24, [60.0, 10.0, 10.0])


def test_units_of_inlined_worlds_are_converted() -> None:
    box = "Shape { geometry Box { size 1 1 1 } }"
    text = (
        f"UNIT length inch 0.0254 {box} Transform {{ translation 30 0 0 children "
        'Inline { url "cm.x3dv" } } Inline { url "m.x3dv" }'
    )
    centimetres = f"{STATEMENTS} UNIT length cm 0.01 {box}"
    shape = read(
        text, None, cm=centimetres, m="#X3D V4.0 utf8\nShape { geometry Box { size 1 .1 .1 } }"
    )
    assert shape.unit == 0.0254
    # Half a metre to the left, thirty inches and half a centimetre to the right.
    assert sides(shape)[0] == pytest.approx(500.0 + 762.0 + 5.0)
    turned = read(f"UNIT angle degree 0.017453 {box}")
    assert "Left out: the unit of angles" in turned.text
    for factor in ("0", "-1", "1e-30", "1e300"):
        with pytest.raises(InputError, match=r"line 5: the unit 'x' of .* m is not possible"):
            read(f"UNIT length x {factor} {box}")


@needs("tovrmlx3d")
def test_files_of_another_program_are_read(tmp_path: Path) -> None:
    bracket = tmp_path / "bracket.x3dv"
    bracket.write_text(run("tovrmlx3d", "--force-x3d", FOREIGN / "bracket.wrl"))
    assert bracket.read_text().startswith("#X3D V3")
    found, expected = (
        read_shape(path.read_bytes(), Format.of(path.name), path.name, 1e-3)
        for path in (bracket, FOREIGN / "bracket.wrl")
    )
    assert triangles(found.vertices * 1e3, found.faces, 3) == triangles(
        expected.vertices * 1e3, expected.faces, 3
    )
    assert found.colours is not None
    assert [255, 128, 0, 191] in found.colours.tolist()


@pytest.mark.long
@needs("tovrmlx3d")
def test_our_x3d_is_read_as_another_program_writes_it(tmp_path: Path) -> None:
    arm = tmp_path / "arm.x3dv"
    for kind in ("x3d", "vrml"):
        assert main(["export", kind, "--no-objects", "--out", str(tmp_path)]) == 0
    arm.write_text(run("tovrmlx3d", tmp_path / "katana450.x3d"))
    assert arm.read_text().startswith("#X3D V3")
    ours, theirs = (read_mesh_file(path, "m") for path in (tmp_path / "katana450.wrl", arm))
    assert len(theirs.faces) == len(ours.faces)
    np.testing.assert_allclose(theirs.solid.size, ours.solid.size, atol=2e-5)
