"""Test OBJ with materials and in UTF-16, and PLY with unusual headers."""

from __future__ import annotations

import numpy as np
import pytest

from katana450.extensions.importers.archive import packed
from katana450.extensions.importers.formats.shape_file import Format, ShapeFile, read_shape
from tests.exchange.shape_bytes import ply

OBJ = """mtllib my paints.mtl
v 0 0 0
v 1 0 0
v 1 1 0
v 0 1 0
usemtl red
f 1 2 3
usemtl see through
f 1 3 4
usemtl unknown
f 1 2 4
"""

MTL = b"""# paints
Kd 9 9 9
newmtl red
Kd 1 0 0
map_Kd a.png
newmtl see through
Kd 0 1 0
Tr 0.75
d -halo 0.25
newmtl
"""


def read(obj: str, **materials: bytes) -> ShapeFile:
    files = {f"{name}.mtl": content for name, content in materials.items()}
    return read_shape(packed("a.obj", {"a.obj": obj.encode()} | files), Format.ZIP, "a.zip")


def test_faces_have_the_colours_of_their_materials() -> None:
    shape = read(OBJ, **{"my paints": MTL})
    assert shape.colours is not None
    assert shape.colours.tolist() == [[255, 0, 0, 255], [0, 255, 0, 64], [204, 204, 204, 255]]
    assert shape.text.endswith("Left out: pictures on the surface.")
    listed = read(OBJ.replace("my paints.mtl", "a.mtl b.mtl"), a=b"newmtl x", b=MTL)
    np.testing.assert_array_equal(listed.colours, shape.colours)


def test_a_missing_or_broken_library_leaves_the_surface() -> None:
    missing = read(OBJ)
    assert missing.colours is None
    assert "not there: my paints.mtl. Add them" in missing.text
    for broken in (b"", bytes(range(256)), b"newmtl red\nKd x y\nd nan\nKd 1e999"):
        assert read(OBJ, **{"my paints": broken}).colours is None


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-le", "utf-16-be", "utf-8-sig"])
def test_byte_order_marks_and_ends_of_lines_of_obj(encoding: str) -> None:
    mark = "\ufeff" if encoding.endswith("e") else ""
    for text in (OBJ, OBJ.replace("\n", "\r"), OBJ.replace("\n", "\r\n")):
        shape = read_shape(f"{mark}{text}".encode(encoding), Format.OBJ, "a.obj")
        assert len(shape.faces) == 3


@pytest.mark.parametrize(
    "data",
    [
        ply().replace(b"format", b"\nCreated by a program, source file: a\nformat"),
        ply().replace(b"ply\n", b"ply \n"),
        ply().replace(b"\n", b"\r"),
        ply().replace(b"\n", b"\r\n"),
        ply().replace(b"end_header\n", b"element material 1\nproperty uchar red\nend_header\n"),
        ply().replace(b"ply\n", b"ply\ncomment end_header is below\n"),
    ],
)
def test_unusual_headers_of_ply(data: bytes) -> None:
    assert len(read_shape(data, Format.PLY, "a.ply").faces) == 1


def test_degenerate_triangles_are_reported() -> None:
    shape = read_shape(b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 1 2 2\nf 3 3 3", Format.OBJ, "a.obj")
    assert len(shape.faces) == 1
    assert shape.text.endswith("Left out: 2 degenerate triangles.")
