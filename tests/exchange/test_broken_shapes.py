"""Test shape files that are corrupt or of another kind: refused with a message, or read."""

from __future__ import annotations

import json
import math
import struct
from typing import Any

import numpy as np
import pytest

from katana450.errors import InputError
from katana450.extensions.importers.formats import surface
from katana450.extensions.importers.formats.shape_file import Format, read_shape
from tests.exchange.shape_bytes import OBJ, PAINTED, ply


def stl(count: int = 1, corners: tuple[float, ...] = (0, 0, 0, 1, 0, 0, 0, 1, 0)) -> bytes:
    return bytes(80) + struct.pack("<I12fH", count, 0.0, 0.0, 1.0, *corners, 0)


FACET = "facet normal 0 0 1 outer loop vertex 0 0 0 vertex 1 0 0 vertex 0 {} 0 endloop endfacet"


def gltf(**changes: Any) -> bytes:
    """Return one triangle as glTF, with parts of the document replaced; None removes a part."""
    numbers = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], "<f4").tobytes()
    document: dict[str, Any] = {
        "asset": {"version": "2.0"},
        "buffers": [{"byteLength": 36}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "nodes": [{"mesh": 0}],
        "scenes": [{"nodes": [0]}],
    } | changes
    return glb(json.dumps(document).encode(), numbers)


def glb(text: bytes, numbers: bytes) -> bytes:
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text
    chunks += struct.pack("<I4s", len(numbers), b"BIN\0") + numbers
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def test_the_unchanged_files_are_read() -> None:
    text = f"solid\n{FACET.format(1)}\nendsolid\n".encode()
    cases = [(Format.PLY, ply()), (Format.STL, stl()), (Format.STL, text), (Format.GLB, gltf())]
    for format, data in cases:
        assert len(read_shape(data, format, "a").faces) == 1


def deep(levels: int) -> bytes:
    return b'{"asset": ' + b"[" * levels + b"]" * levels + b"}"


ACCESSOR = {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}


INVALID: dict[Format, list[tuple[bytes | str, str]]] = {
    Format.STL: [
        (b"", "too short for an STL file"),
        (stl(0), "declares 0 triangles"),
        (stl()[:-1], "declares 1 triangles, which take 134 bytes, but has 133"),
        (stl(2**31), "declares 2147483648 triangles"),
        (stl(corners=(0, 0, 0, 1, 0, 0, 0, math.nan, 0)), "not finite numbers"),
        (stl(corners=(0, 0, 0, 1, 0, 0, 0, math.inf, 0)), "not finite numbers"),
        (stl(corners=(0,) * 9), "has no triangles"),
        (b"solid a\nendsolid a\n", "has no triangles"),
        (
            f"solid\n{FACET.format(1)}\n".encode(),
            "^a.stl is corrupt at line 3: the file ends before 'endsolid'",
        ),
        (f"solid\n\n{FACET.format(1)[:-9]}\nendsolid".encode(), "^a.stl is corrupt at line 3"),
        (f"solid\n{FACET.format('x')}\nendsolid".encode(), "not numbers"),
        (f"solid\n{FACET.format('nan')}\nendsolid".encode(), "not finite numbers"),
        (f"solid\n{FACET.format('1e999')}\nendsolid".encode(), "not finite numbers"),
        (f"solid\nsolid\n{FACET.format(1)}\nendsolid".encode(), "corrupt at line 2"),
    ],
    Format.OBJ: [
        ("", "has no triangles"),
        ("v 0 0 0\np 1\n", "has no triangles. It has points"),
        ("v 1 2", "line 1: a vertex must have three finite coordinates"),
        ("v 1 2 nan", "three finite"),
        ("v 1 2 1e999", "three finite"),
        ("v a b c", "must be numbers"),
        ("v 0 0 0\nf 1 2 3", "vertex 1, counted from 0, but only 1 vertices"),
        ("v 0 0 0\nf 0 0 0", "line 2: there is no vertex 0"),
        ("v 0 0 0\nf -2 -1 -1", "there is no vertex -2"),
        ("v 0 0 0\nf 1 1 99999999999999999999999", "there is no vertex 9999"),
        ("v 0 0 0 1 0 0\nf 1 2 3", "vertex 1, counted from 0"),
        ("f 1/2/3 x/1/1", "'x/1/1' is not a corner"),
        ("hello", "line 1: 'hello' is not an OBJ statement"),
    ],
    Format.PLY: [
        (b"", "must begin with 'ply'"),
        (b"ply\n", "header does not end"),
        (ply(vertices="x"), "'element vertex x' in its header is invalid"),
        (ply(vertices=-3), "invalid"),
        (ply().replace(b"float x", b"quad x"), "'property quad x'"),
        (ply().replace(b"list uchar", b"list float"), "invalid"),
        (ply().replace(b"ascii 1.0", b"ascii 2.0"), "invalid"),
        (ply().replace(b"format ascii 1.0\n", b""), "has no format"),
        (ply().replace(b"float z", b"float w"), "no vertices with x, y and z"),
        (ply(faces=0), "has no triangles"),
        (ply().replace(b"nt face", b"nt tristrips"), r"no triangles\. It has 1 tristrips"),
        (ply(vertices=2**31), "ends too early"),
        (ply("3 0 1 3\n"), "vertex 3, counted from 0, but only 3 vertices"),
        (ply("3 0 1 -1\n"), "vertex -1"),
        (PAINTED.replace(b"3 0 1 2", b"3 0 1 9"), "vertex 9, counted from 0"),
        (ply("4 0 1 2\n"), "ends too early|no length"),
        (ply("-3 0 1 2\n"), "no length"),
        (ply("3.5 0 1 2\n"), "no length"),
        (ply("nan 0 1 2\n"), "no length"),
        (ply("3 0 1 nan\n"), "vertex"),
        (ply("3 0 1 1e999\n"), "vertex"),
        (ply("3 0 1 x\n"), "corrupt"),
        (ply().replace(b"0 1 0\n", b"0 inf 0\n"), "not finite numbers"),
        (ply().replace(b"ascii", b"binary_little_endian"), "ends too early"),
    ],
    Format.GLB: [
        (b"", "corrupt or not glTF"),
        (b"glTF", "not GLB 2.0"),
        (gltf()[:-4], "shorter than its header says"),
        (b"{", "corrupt"),
        (deep(100_000), "corrupt"),
        (gltf(asset=None), "Expected `object`, got `null` - at `\\$.asset`"),
        (gltf(asset={"version": "1.0"}), "is glTF 1.0, which is not read. Export it as glTF 2.0"),
        (gltf().replace(b"glTF\x02", b"glTF\x01"), "is glTF 1, which is not read"),
        (gltf(buffers=[{"byteLength": 36, "uri": "/etc/passwd"}]), "'/etc/passwd'"),
        (gltf(buffers=[{"byteLength": 36, "uri": "http://a/b"}]), "which is not there"),
        (gltf(buffers=[{"byteLength": 36, "uri": "data:;base64,@"}]), "not base64"),
        (gltf(buffers=[{"byteLength": 37}]), "shorter than declared"),
        (gltf(bufferViews=[{"buffer": 1, "byteLength": 36}]), "a part that is missing"),
        (gltf(bufferViews=[{"buffer": 0, "byteLength": 36, "byteOffset": 4}]), "beyond"),
        (gltf(bufferViews=[{"buffer": 0, "byteLength": 36, "byteStride": 4}]), "beyond"),
        (gltf(bufferViews=[{"buffer": -1, "byteLength": 36}]), "Expected `int` >= 0"),
        (gltf(accessors=[ACCESSOR | {"count": 2**31}]), "beyond its buffer"),
        (gltf(accessors=[ACCESSOR | {"count": 2**80}]), "corrupt"),
        (gltf(accessors=[ACCESSOR | {"type": "VEC2"}]), "wrong type"),
        (gltf(accessors=[ACCESSOR | {"componentType": 9}]), "wrong type"),
        (gltf(accessors=[ACCESSOR | {"bufferView": None}]), "has no buffer"),
        (gltf(accessors=[ACCESSOR | {"bufferView": None, "count": 10**9}]), "has no buffer"),
        (gltf(nodes=[{"mesh": 1}]), "a part that is missing"),
        (gltf(nodes=[{"mesh": 0, "children": [0]}]), "more than 40000 nodes"),
        (gltf(nodes=[{"mesh": 0, "rotation": [0, 0, 0, 0]}]), "a pose that is not finite"),
        (gltf(nodes=[{"mesh": 0, "matrix": [1e308] * 16}]), "not finite"),
        (gltf(nodes=[{"mesh": 0, "scale": [1, 1]}]), "length 3"),
        (gltf(scenes=[{"nodes": []}]), "has no triangles"),
        (gltf(scene=7), "a part that is missing"),
        (gltf(meshes=[{"primitives": [{"attributes": {}}]}]), "has no triangles"),
        (
            gltf(meshes=[{"primitives": [{"attributes": {"POSITION": 0}, "indices": 0}]}]),
            "wrong type",
        ),
    ],
}


@pytest.mark.parametrize(
    ("format", "data", "said"), [(format, *case) for format in INVALID for case in INVALID[format]]
)
def test_invalid_shape_is_refused(format: Format, data: bytes | str, said: str) -> None:
    with pytest.raises(InputError, match=said):
        read_shape(data.encode() if isinstance(data, str) else data, format, "a.stl")


@pytest.mark.parametrize(
    ("data", "format"),
    [
        (bytes(80) + struct.pack("<I", 101) + bytes(50 * 101), Format.STL),
        (f"solid\n{FACET.format(1) * 101}\nendsolid".encode(), Format.STL),
        (b"v 0 0 0\n" + b"f" + b" 1" * 103, Format.OBJ),
        (ply("103" + " 1" * 103 + "\n"), Format.PLY),
        (b"#VRML V2.0 utf8\nShape { geometry Sphere { } }", Format.WRL),
    ],
)
def test_too_many_triangles_are_refused(
    monkeypatch: pytest.MonkeyPatch, data: bytes, format: Format
) -> None:
    monkeypatch.setattr(surface, "MAX_TRIANGLES", 100)
    with pytest.raises(InputError, match="has more than 100 triangles, the maximum"):
        read_shape(data, format, "a")


def test_statements_of_obj() -> None:
    shape = read_shape(OBJ, Format.OBJ, "a.obj")
    assert (len(shape.vertices), len(shape.faces)) == (4, 3)
    assert "Left out: lines. It names files that are not there: ../../etc/passwd." in shape.text
    assert shape.colours is not None
    assert shape.colours[0].tolist() == [255, 0, 0, 255]


def test_rows_of_ply_may_differ() -> None:
    """Polygons of several sizes, text and binary, other lists, and colours as numbers 0..1."""
    header = ply(faces=2, vertices=4).decode().partition("0 0 0")[0]
    header = header.replace("z\n", "z\nproperty float red\nproperty float green\n")
    header = header.replace("element face", "property float blue\nelement face")
    header = header.replace("end_h", "property list uint8 float32 extra\nelement edge 1\n"
                            "property int a\nend_h")  # fmt: skip
    square = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
    text = "".join(f"{x} {y} {z} 1 .5 0\n" for x, y, z in square)
    text += "4 0 1 2 3 0\n3 2 1 0 2 7 8\n5\n"
    body = b"".join(struct.pack(">6f", *corner, 1.0, 0.5, 0.0) for corner in square)
    body += struct.pack(">B4iB", 4, 0, 1, 2, 3, 0) + struct.pack(">B3iB2f", 3, 2, 1, 0, 2, 7, 8)
    body += struct.pack(">i", 5)
    binary = header.replace("ascii", "binary_big_endian").encode() + body
    for data in ((header + text).encode(), binary):
        shape = read_shape(data, Format.PLY, "a.ply")
        assert shape.faces.shape == (3, 3)
        assert shape.colours is not None
        assert shape.colours[0].tolist() == [255, 128, 0, 255]
        assert shape.text.endswith("Left out: 1 edge.")


def test_colours_and_places_of_gltf() -> None:
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], "<f4")
    light = np.full((3, 4), 65535, "<u2")
    light[:, 1] = 0
    index = np.arange(3, dtype="u1")
    data = corners.tobytes() + light.tobytes() + index.tobytes()
    views = [(0, 36), (36, 24), (60, 3)]
    kinds = [(5126, "VEC3", 3), (5123, "VEC4", 3), (5121, "SCALAR", 3)]
    primitive = {
        "attributes": {"POSITION": 0, "COLOR_0": 1},
        "indices": 2,
        "material": 0,
    }
    strip = {"attributes": {"POSITION": 0}, "mode": 5}
    gltf = {
        "asset": {"version": "2.0"},
        "buffers": [{"byteLength": len(data)}],
        "bufferViews": [{"buffer": 0, "byteOffset": a, "byteLength": n} for a, n in views],
        "accessors": [
            {"bufferView": i, "componentType": c, "type": t, "count": n, "normalized": i == 1}
            for i, (c, t, n) in enumerate(kinds)
        ],
        "materials": [
            {"pbrMetallicRoughness": {"baseColorFactor": [0.5, 1, 0, 0.5], "baseColorTexture": {}}}
        ],
        "meshes": [{"primitives": [primitive, strip]}],
        "nodes": [
            {"children": [1], "translation": [0, 0, 0.5]},
            {"mesh": 0, "scale": [1, -1, 1], "rotation": [0, 0, math.sqrt(0.5), math.sqrt(0.5)]},
        ],
        "animations": [{}],
    }
    shape = read_shape(glb(json.dumps(gltf).encode(), data), Format.GLB, "a.glb")
    assert len(shape.faces) == 1
    # Mirrored, rotated by 90 degrees about its z, moved, then made upright: x, -z, y.
    assert np.ptp(shape.vertices, axis=0).tolist() == pytest.approx([1.0, 0.0, 1.0])
    assert shape.vertices[:, 1] == pytest.approx(-0.5)
    a, b, c = np.moveaxis(shape.vertices[shape.faces], 1, 0)
    assert (np.cross(b - a, c - a)[:, 1] < 0.0).all()
    assert shape.colours is not None
    assert np.unique(shape.colours, axis=0).tolist() == [[188, 0, 0, 128]]
    assert shape.text.endswith(
        "Left out: pictures on the surface, lines, points and strips, motion."
    )
