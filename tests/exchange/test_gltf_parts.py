"""Test glTF with buffers in other files, quantized numbers, and compression."""

from __future__ import annotations

import base64
import json
from typing import Any

import pytest

from katana450.errors import InputError
from katana450.extensions.importers.archive import packed
from katana450.extensions.importers.formats.shape_file import Format, ShapeFile, read_shape
from tests.exchange.compressed_gltf import DATA, POINTS, SQUARE, draco, quantized
from tests.exchange.solids import sides
from tests.exchange.test_broken_shapes import glb


def read(document: dict[str, Any], **files: bytes) -> ShapeFile:
    """Return the shape of a document, with other files of its folder by their names."""
    content = json.dumps(document).encode()
    others = {name.replace("__", "/").replace("_bin", ".bin"): part for name, part in files.items()}
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


def test_sparse_numbers_are_refused_with_a_remedy() -> None:
    document: dict[str, Any] = json.loads(json.dumps(SQUARE))
    document["accessors"][0]["sparse"] = {"count": 1}
    with pytest.raises(InputError, match="sparse numbers, which are not read: save it dense"):
        read(document, **{"a b_bin": DATA})
    del document["accessors"][0]["sparse"], document["accessors"][0]["bufferView"]
    with pytest.raises(InputError, match="accessor 0 has no buffer"):
        read(document, **{"a b_bin": DATA})


def test_draco_is_decompressed() -> None:
    document, data = draco(3.0 * POINTS)
    shape = read_shape(glb(json.dumps(document).encode(), data), Format.GLB, "a.glb")
    assert len(shape.faces) == 2
    assert sides(shape) == pytest.approx([3e3, 0.0, 3e3], abs=1.0)
    assert shape.scale == 0.5
    for broken in (data[:20], b"", b"DRACO"):
        content = broken + bytes(len(data) - len(broken))
        with pytest.raises(InputError, match="corrupt"):
            read_shape(glb(json.dumps(document).encode(), content), Format.GLB, "a.glb")


def test_normalized_integers_are_read() -> None:
    document, data = quantized()
    shape = read_shape(glb(json.dumps(document).encode(), data), Format.GLB, "a.glb")
    assert sides(shape) == pytest.approx([1e3, 0.0, 1e3])
    assert len(shape.faces) == 2


def test_meshopt_is_refused_with_a_remedy() -> None:
    for name in ("EXT_meshopt_compression", "KHR_meshopt_compression"):
        with pytest.raises(InputError, match="without compression, or with Draco"):
            read(SQUARE | {"extensionsRequired": [name]}, **{"a b_bin": DATA})


def test_an_unknown_extension_is_reported() -> None:
    shape = read(SQUARE | {"extensionsRequired": ["EXT_smell"]}, **{"a b_bin": DATA})
    assert "Left out: the extension EXT_smell." in shape.text


def test_a_node_may_be_shown_at_two_places() -> None:
    document = json.loads(json.dumps(SQUARE))
    document["scenes"] = [{"nodes": [1, 2]}]
    document["nodes"] = [
        document["nodes"][0],
        {"children": [0]},
        {"children": [0], "translation": [0, 0, 1]},
    ]
    assert len(read(document, **{"parts__a b_bin": DATA}).faces) == 4
