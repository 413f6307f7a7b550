"""Test glTF with buffers in other files, sparse numbers, compression and repeated meshes."""

from __future__ import annotations

import base64
import json
from typing import Any

import DracoPy
import meshopt
import numpy as np
import pytest

from katana450.errors import InputError
from katana450.extensions.importers.archive import packed
from katana450.extensions.importers.shape_file import Format, ShapeFile, read_shape
from tests.exchange.solids import sides

POINTS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], "<f4")

FACES = np.array([[0, 1, 2], [0, 2, 3]], "<u2")

DATA = POINTS.tobytes() + FACES.tobytes()

SQUARE: dict[str, Any] = {
    "asset": {"version": "2.0"},
    "buffers": [{"byteLength": 60, "uri": "parts/a%20b.bin"}],
    "bufferViews": [
        {"buffer": 0, "byteLength": 48},
        {"buffer": 0, "byteOffset": 48, "byteLength": 12},
    ],
    "accessors": [
        {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"},
        {"bufferView": 1, "componentType": 5123, "count": 6, "type": "SCALAR"},
    ],
    "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
    "nodes": [{"mesh": 0}],
    "scenes": [{"nodes": [0]}],
}


def read(document: dict[str, Any], **files: bytes) -> ShapeFile:
    """Return the shape of a document, with other files of its folder by their names."""
    content = json.dumps(document).encode()
    others = {name.replace("__", "/").replace("_bin", ".bin"): each for name, each in files.items()}
    data = packed("a.gltf", {"a.gltf": content} | others)
    return read_shape(data, Format.ZIP, "a.zip")


def test_a_buffer_in_another_file_is_read() -> None:
    for name in ("parts__a b_bin", "a b_bin", "A B_bin"):
        assert sides(read(SQUARE, **{name: DATA})) == pytest.approx([1e3, 0.0, 1e3])
    with pytest.raises(InputError, match=r"another file, 'parts/a%20b.bin', which is not there"):
        read(SQUARE)
    with pytest.raises(InputError, match="shorter than declared"):
        read(SQUARE, **{"a b_bin": DATA[:-1]})


@pytest.mark.parametrize("uri", ["../a.bin", "/etc/passwd", "http://a/a.bin", "file:///a.bin"])
def test_no_buffer_outside_of_the_upload_is_read(uri: str) -> None:
    with pytest.raises(InputError, match="not there"):
        read(SQUARE | {"buffers": [{"byteLength": 60, "uri": uri}]}, x_bin=DATA)


@pytest.mark.parametrize(
    "uri",
    [
        "data:application/octet-stream;base64," + base64.b64encode(DATA).decode(),
        "data:application/gltf-buffer," + "".join(f"%{byte:02x}" for byte in DATA),
    ],
)
def test_a_buffer_in_the_document_is_read(uri: str) -> None:
    data = json.dumps(SQUARE | {"buffers": [{"byteLength": 60, "uri": uri}]}).encode()
    assert len(read_shape(data, Format.GLTF, "a.gltf").faces) == 2


def sparse(base: int | None, places: list[int], count: int | None = None) -> dict[str, Any]:
    """Return the square with another height of the vertices ``places``."""
    document: dict[str, Any] = json.loads(json.dumps(SQUARE))
    n = len(places)
    data = np.array(places, "<u4").tobytes() + np.full((n, 3), 2.0, "<f4").tobytes()
    uri = "data:;base64," + base64.b64encode(data).decode()
    document["buffers"].append({"byteLength": len(data), "uri": uri})
    document["bufferViews"] += [
        {"buffer": 1, "byteLength": 4 * n},
        {"buffer": 1, "byteOffset": 4 * n, "byteLength": 12 * n},
    ]
    document["accessors"][0]["sparse"] = {
        "count": n if count is None else count,
        "indices": {"bufferView": 2, "componentType": 5125},
        "values": {"bufferView": 3},
    }
    if base is None:
        del document["accessors"][0]["bufferView"]
    return document


def test_sparse_numbers_replace_others() -> None:
    files = {"a b_bin": DATA}
    assert sides(read(sparse(0, [2]), **files)) == pytest.approx([2e3] * 3)
    # Without a buffer all others are 0.
    with pytest.raises(InputError, match="2 degenerate triangles"):
        read(sparse(None, [1, 3]), **files)
    with pytest.raises(InputError, match="a place beyond its end"):
        read(sparse(0, [4]), **files)
    with pytest.raises(InputError, match="beyond its buffer"):
        read(sparse(0, [2], count=3), **files)


def test_draco_is_decompressed() -> None:
    shift = POINTS * 3.0
    data = DracoPy.encode(shift.astype("f4"), FACES.astype("u4"), quantization_bits=14)
    document = SQUARE | {
        "extensionsRequired": ["KHR_draco_mesh_compression"],
        "buffers": [{"byteLength": len(data), "uri": "a.bin"}],
        "bufferViews": [{"buffer": 0, "byteLength": len(data)}],
        "accessors": [
            {"componentType": 5126, "count": 4, "type": "VEC3"},
            {"componentType": 5123, "count": 6, "type": "SCALAR"},
        ],
        "meshes": [
            {
                "primitives": [
                    {
                        "attributes": {"POSITION": 0},
                        "indices": 1,
                        "extensions": {
                            "KHR_draco_mesh_compression": {
                                "bufferView": 0,
                                "attributes": {"POSITION": 0},
                            }
                        },
                    }
                ]
            }
        ],
    }
    shape = read(document, a_bin=data)
    assert len(shape.faces) == 2
    assert sides(shape) == pytest.approx([3e3, 0.0, 3e3], abs=1.0)
    assert shape.scale == 0.5
    for broken in (data[:20], bytes(len(data)), b"DRACO" + bytes(200)):
        with pytest.raises(InputError, match=r"corrupt|beyond"):
            read(document, a_bin=broken + bytes(max(0, len(data) - len(broken))))


@pytest.mark.parametrize("name", ["EXT_meshopt_compression", "KHR_meshopt_compression"])
def test_meshopt_is_decompressed(name: str) -> None:
    # Quantized to a step of 1/100: normalized 16-bit integers need 4 bytes a row, so 8 for three.
    rows = np.zeros((4, 4), "<u2")
    rows[:, :3] = POINTS * 65535
    vertices = meshopt.encode_gltf_buffer(rows, "ATTRIBUTES")
    faces = meshopt.encode_gltf_buffer(FACES.ravel().astype("<u4"), "TRIANGLES")
    data = vertices + faces

    def document(count: int = 4) -> dict[str, Any]:
        views = [(0, len(vertices), count, 8, "ATTRIBUTES")]
        views += [(len(vertices), len(faces), 6, 2, "TRIANGLES")]
        return SQUARE | {
            "extensionsRequired": [name, "KHR_mesh_quantization"],
            # The second buffer is a fallback that no file holds.
            "buffers": [
                {"byteLength": len(data), "uri": "a.bin"},
                {"byteLength": 60, "extensions": {name: {"fallback": True}}},
            ],
            "bufferViews": [
                {
                    "buffer": 1,
                    "byteLength": n * stride,
                    "extensions": {
                        name: {
                            "buffer": 0,
                            "byteOffset": at,
                            "byteLength": length,
                            "count": n,
                            "byteStride": stride,
                            "mode": mode,
                        }
                    },
                }
                for at, length, n, stride, mode in views
            ],
            "accessors": [
                {
                    "bufferView": 0,
                    "componentType": 5123,
                    "normalized": True,
                    "count": 4,
                    "type": "VEC3",
                },
                SQUARE["accessors"][1],
            ],
        }

    shape = read(document(), a_bin=data)
    assert sides(shape) == pytest.approx([1e3, 0.0, 1e3])
    assert len(shape.faces) == 2
    with pytest.raises(InputError, match="over 64 MB in one part"):
        read(document(10_000_000), a_bin=data)
    with pytest.raises(InputError, match="corrupt"):
        read(document(), a_bin=bytes(len(data)))


def test_a_mesh_is_repeated_at_instances() -> None:
    places = np.array([[0, 0, 0], [0, 0, 4]], "<f4").tobytes()
    document: dict[str, Any] = json.loads(json.dumps(SQUARE))
    document["buffers"].append({"byteLength": 24, "uri": "p.bin"})
    document["bufferViews"].append({"buffer": 1, "byteLength": 24})
    document["accessors"].append(
        {"bufferView": 2, "componentType": 5126, "count": 2, "type": "VEC3"}
    )
    document["nodes"][0]["extensions"] = {
        "EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": 2}}
    }
    shape = read(document, p_bin=places, **{"a b_bin": DATA})
    assert len(shape.faces) == 4
    assert sides(shape) == pytest.approx([1e3, 4e3, 1e3])


def test_an_unknown_extension_is_reported() -> None:
    shape = read(SQUARE | {"extensionsRequired": ["EXT_smell"]}, **{"a b_bin": DATA})
    assert "Left out: the extension EXT_smell." in shape.text
