"""Test files of lines and points alone: solid bars; beside a surface they are left out."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

from katana450.errors import InputError
from katana450.extensions.export.vrml_text import HEADER
from katana450.extensions.importers.mesh_file import read_mesh
from katana450.extensions.importers.shape_file import Format, ShapeFile, Up, read_shape
from tests.exchange.solids import is_closed, sides, volume
from tests.exchange.test_broken_shapes import glb

FRAME = "coord Coordinate { point [ 0 0 0, 100 0 0, 0 100 0, 0 0 100 ] }"

NOTE = "It has only lines and points: they are bars, as thick as 1/200 of its length."

TRIAD = 3.0 * np.sqrt(3.0) / 4.0 * 0.25**2
"""[mm^2] Section of a bar of a file that is 100 mm long."""


def read(text: str, header: str = HEADER) -> ShapeFile:
    return read_shape(f"{header}\n{text}".encode(), Format.WRL, "world.wrl", 1e-3, Up.Z)


@pytest.mark.parametrize(
    "geometry",
    [
        f"IndexedLineSet {{ {FRAME} coordIndex [ 1 0 2 -1 0 3 ] }}",
        f"IndexedLineSet {{ {FRAME} coordIndex [ 1 0 2 -1 0 3 -1 0 9 -1 2 ] }}",
        (
            "LineSet { vertexCount [ 3 2 ] coord Coordinate { "
            "point [ 100 0 0, 0 0 0, 0 100 0, 0 0 0, 0 0 100 ] } }"
        ),
    ],
    ids=lambda geometry: geometry.split()[0],
)
def test_lines_are_closed_bars(geometry: str) -> None:
    shape = read(f"Shape {{ geometry {geometry} }}")
    assert is_closed(shape)
    assert len(shape.faces) == 3 * 8
    assert volume(shape) * 1e9 == pytest.approx(300.0 * TRIAD, rel=1e-9)
    assert all(100.0 < side < 100.5 for side in sides(shape))
    assert NOTE in shape.text
    assert "Left out" not in shape.text


def test_points_are_diamonds() -> None:
    shape = read(f"Shape {{ geometry PointSet {{ {FRAME} }} }}")
    assert is_closed(shape)
    assert volume(shape) * 1e9 == pytest.approx(4 * 4.0 / 3.0 * 0.25**3, rel=1e-9)
    assert sides(shape) == [100.5] * 3
    flat = read("Shape { geometry Polypoint2D { point [ 0 0, 40 0, 40 30 ] } }")
    assert sides(flat) == pytest.approx([40.2, 30.2, 0.2])


def test_lines_have_their_colours() -> None:
    def colours(fields: str) -> list[list[int]]:
        shape = read(f"Shape {{ geometry IndexedLineSet {{ {FRAME} {fields} }} }}")
        assert shape.colours is not None
        return [[int(part) for part in row] for row in shape.colours[::8]]

    red, green, middle = [255, 0, 0, 255], [0, 255, 0, 255], [128, 128, 0, 255]
    table = "color Color { color [ 1 0 0, 0 1 0, 0 0 1, 1 1 1 ] }"
    lines = "coordIndex [ 1 0 -1 0 2 -1 ]"
    assert colours(f"{lines} {table} colorPerVertex FALSE") == [red, green]
    assert colours(f"{lines} {table} colorPerVertex FALSE colorIndex [ 1 0 ]") == [green, red]
    assert colours(f"{lines} {table}") == [middle, [128, 0, 128, 255]]
    assert colours(f"{lines} {table} colorIndex [ 0 0 -1 0 1 -1 ]") == [red, middle]
    # A line reflects no light.
    glow = "Appearance { material Material { emissiveColor 0 1 0 } }"
    shape = read(f"Shape {{ geometry IndexedLineSet {{ {FRAME} {lines} }} appearance {glow} }}")
    assert shape.colours is not None
    assert np.unique(shape.colours, axis=0).tolist() == [green]
    dots = "coord Coordinate { point [ 0 0 0 1 0 0 ] } color Color { color [ 1 0 0, 0 1 0 ] }"
    shape = read(f"Shape {{ geometry PointSet {{ {dots} }} }}")
    assert shape.colours is not None
    assert np.unique(shape.colours, axis=0).tolist() == [green, red]
    wrong = read(f"Shape {{ geometry IndexedLineSet {{ {FRAME} {lines} color Color {{ }} }} }}")
    assert "colours that do not match" in wrong.text


def lines_of_gltf(mode: int, indices: list[int] | None = None, paint: bool = False) -> bytes:
    """Return a primitive over the corners of a square of 1 m."""
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], "<f4").tobytes()
    colours = np.array([[1, 0, 0, 1]] * 4, "<f4").tobytes()
    listed = np.array(indices or [0], "<u4").tobytes()
    views = [(0, len(points)), (len(points), len(colours)), (112, len(listed))]
    attributes = {"POSITION": 0} | ({"COLOR_0": 1} if paint else {})
    primitive: dict[str, Any] = {"attributes": attributes, "mode": mode}
    if indices is not None:
        primitive["indices"] = 2
    document = {
        "asset": {"version": "2.0"},
        "buffers": [{"byteLength": 112 + len(listed)}],
        "bufferViews": [
            {"buffer": 0, "byteOffset": at, "byteLength": length} for at, length in views
        ],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5126, "count": 4, "type": "VEC4"},
            {
                "bufferView": 2,
                "componentType": 5125,
                "count": len(indices or [0]),
                "type": "SCALAR",
            },
        ],
        "meshes": [{"primitives": [primitive]}],
        "nodes": [{"mesh": 0}],
        "scenes": [{"nodes": [0]}],
    }
    return glb(json.dumps(document).encode(), points + colours + listed)


@pytest.mark.parametrize(
    ("mode", "indices", "bars"),
    [
        (0, None, 4),
        (0, [0, 2], 2),
        (1, None, 2),
        (1, [0, 1, 1, 2, 3], 2),
        (2, None, 4),
        (3, None, 3),
        (3, [0, 2, 9], 1),
    ],
)
def test_lines_and_points_of_gltf(mode: int, indices: list[int] | None, bars: int) -> None:
    shape = read_shape(lines_of_gltf(mode, indices), Format.GLB, "a.glb")
    assert len(shape.faces) == 8 * bars
    assert is_closed(shape)
    assert NOTE in shape.text
    painted = read_shape(lines_of_gltf(mode, indices, paint=True), Format.GLB, "a.glb")
    assert painted.colours is not None
    assert np.unique(painted.colours, axis=0).tolist() == [[255, 0, 0, 255]]


def test_an_unknown_mode_of_gltf_is_reported() -> None:
    with pytest.raises(InputError, match=r"has no triangles\. It has primitives of mode 9"):
        read_shape(lines_of_gltf(9), Format.GLB, "a.glb")


def test_lines_beside_a_surface_are_left_out() -> None:
    lines = f"Shape {{ geometry IndexedLineSet {{ {FRAME} coordIndex [ 0 1 ] }} }}"
    shape = read(f"{lines} Shape {{ geometry Box {{ }} }}")
    assert len(shape.faces) == 12
    assert shape.text.endswith("Left out: IndexedLineSet.")


@pytest.mark.parametrize(
    ("geometry", "said"),
    [
        ("PointSet { coord Coordinate { point [ 1 2 3 ] } }", "It has PointSet"),
        ("PointSet { coord Coordinate { point [ 1 2 3, 1 2 3 ] } }", "It has PointSet"),
        (f"IndexedLineSet {{ {FRAME} coordIndex [ 1 -1 2 -1 1 7 ] }}", "has no triangles"),
        ("LineSet { vertexCount [ -3 ] }", "has no triangles"),
        (
            "IndexedLineSet { coord Coordinate { point [ 0 0 0, nan 1 1 ] } coordIndex [ 0 1 ] }",
            "has no triangles",
        ),
        (
            f"PointSet {{ coord Coordinate {{ point [ {'0 0 0 1 1 1 ' * 12_501} ] }} }}",
            "has no surface, only 25002 lines and points; at most 25000 can be shown",
        ),
    ],
)  # fmt: skip
def test_lines_without_a_size_or_a_bound_are_refused(geometry: str, said: str) -> None:
    with pytest.raises(InputError, match=said):
        read(f"Shape {{ geometry {geometry} }}")


def test_a_wire_frame_can_be_placed() -> None:
    world = (
        f"{HEADER}\nShape {{ geometry IndexedLineSet {{ {FRAME} coordIndex [ 1 0 2 -1 0 3 ] }} }}"
    )
    mesh = read_mesh(world.encode(), "frame.wrl", "mm")
    assert len(mesh.faces) == 24
    assert mesh.solid.size == pytest.approx((0.1, 0.1, 0.1), abs=5e-4)
    assert "Collision checks use its convex hull" in mesh.text


def test_plane_figures_of_x3d() -> None:
    header = "#X3D V3.3 utf8"
    areas = {
        "Rectangle2D { size 4 3 }": 12.0,
        "Disk2D { outerRadius 2 innerRadius 1 }": 3.0 * 16.0 * np.sin(np.pi / 16.0),
        "Disk2D { outerRadius 2 }": 4.0 * 16.0 * np.sin(np.pi / 16.0),
        "TriangleSet2D { vertices [ 0 0, 2 0, 0 2, 9 9 ] }": 2.0,
        "ArcClose2D { radius 2 endAngle 1.5707963 }": 4.0 * 16.0 * np.sin(np.pi / 64.0),
        'ArcClose2D { radius 2 endAngle 3.1415926 closureType "CHORD" }': (
            4.0 * 16.0 * np.sin(np.pi / 32.0)
        ),
    }
    for geometry, expected in areas.items():
        shape = read(f"Shape {{ geometry {geometry} }}", header)
        a, b, c = np.moveaxis(shape.vertices[shape.faces] * 1e3, 1, 0)
        crossed = np.cross(b - a, c - a)[:, 2]
        assert (crossed > 0.0).all(), geometry
        assert crossed.sum() / 2.0 == pytest.approx(expected, rel=1e-3), geometry
    for geometry, bars in {
        "Circle2D { radius 2 }": 32,
        "Arc2D { radius 2 }": 32,
        "Polyline2D { lineSegments [ 0 0, 3 0, 3 4 ] }": 2,
    }.items():
        assert len(read(f"Shape {{ geometry {geometry} }}", header).faces) == 8 * bars
