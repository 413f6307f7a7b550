"""Test worlds that show files of other formats: with their materials, units and axes."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from katana450.errors import InputError
from katana450.extensions.export.vrml_text import HEADER
from katana450.extensions.importers.archive import packed
from katana450.extensions.importers.mesh_file import read_mesh_file
from katana450.extensions.importers.shape_file import Format, ShapeFile, Up, read_shape
from tests.exchange.compressed_gltf import DATA, SQUARE
from tests.exchange.solids import sides
from tests.exchange.test_library_formats import dae

FOREIGN = Path(__file__).parent / "foreign"

PLATE = b"v 0 0 0\nv 30 0 0\nv 30 20 0\nv 0 20 0\nf 1 2 3 4\n"


def read(text: str, files: dict[str, bytes], unit: float | None = 1e-3) -> ShapeFile:
    """Return the shape of a world, z up, with other files of the upload by their paths."""
    data = packed("a.x3dv", {"a.x3dv": f"#X3D V4.0 utf8\n{text}".encode()} | files)
    return read_shape(data, Format.ZIP, "a.zip", unit, Up.Z)


def test_a_mesh_has_its_place_and_its_materials() -> None:
    shape = read(
        'Transform { translation 100 0 0 children Inline { url "parts/plate.obj" } }',
        {
            "parts/plate.obj": b"mtllib a.mtl\nusemtl red\n" + PLATE,
            "parts/a.mtl": b"newmtl red\nKd 1 0 0\n",
        },
    )
    assert sides(shape) == [30.0, 20.0, 0.0]
    assert float(shape.vertices[:, 0].min()) == pytest.approx(0.1)
    assert shape.colours is not None
    assert np.unique(shape.colours, axis=0).tolist() == [[255, 0, 0, 255]]
    assert "Left out" not in shape.text
    assert "Other shapes" not in shape.text


@pytest.mark.parametrize("name", ["vtk.stl", "meshlab.ply", "gmsh.obj", "assimp.glb", "vtk.wrl"])
def test_files_of_other_programs_are_shown(name: str) -> None:
    alone = read_shape((FOREIGN / name).read_bytes(), Format.of(name), name, 1e-3, Up.Z)
    shape = read(f'Inline {{ url "{name}" }}', {name: (FOREIGN / name).read_bytes()})
    assert len(shape.faces) == len(alone.faces)
    assert sides(shape) == pytest.approx(sides(alone))


def test_gltf_is_in_metres_and_needs_its_buffer() -> None:
    document = json.dumps(SQUARE).encode()
    text = 'UNIT length inch 0.0254 Inline { url "b.gltf" }'
    shape = read(text, {"b.gltf": document, "parts/a b.bin": DATA}, None)
    assert shape.unit == 0.0254
    assert sides(shape) == pytest.approx([1000.0, 1000.0, 0.0])
    with pytest.raises(InputError, match=r"has its shapes in another file, 'parts/a%20b\.bin'"):
        read(text, {"b.gltf": document})


def test_collada_has_its_own_unit_and_axis() -> None:
    text = 'UNIT length cm 0.01 Inline { url "l.dae" }'
    shape = read(text, {"l.dae": dae(meter=0.001, up="Z_UP")}, None)
    assert sides(shape) == pytest.approx([60.0, 25.0, 40.0])
    shape = read(text, {"l.dae": dae(meter=0.001, up="Y_UP")}, None)
    assert sides(shape) == pytest.approx([60.0, 40.0, 25.0])


def test_other_files_are_left_out() -> None:
    box = "Shape { geometry Box { } }"
    shape = read(f'{box} Inline {{ url "a.3mf" }}', {"a.3mf": b""})
    assert "Left out: a.3mf, which is not VRML." in shape.text
    with pytest.raises(InputError, match=r"b\.stl is not an STL file: it has less than 84 bytes"):
        read(f'{box} Inline {{ url "b.stl" }}', {"b.stl": b"abc"})


def test_a_folder_is_read_with_what_its_files_name(tmp_path: Path) -> None:
    (tmp_path / "parts").mkdir()
    (tmp_path / "world.wrl").write_text(f'{HEADER}\nInline {{ url "parts/b.gltf" }}')
    document = json.dumps(SQUARE).replace("parts/a%20b.bin", "b.bin")
    (tmp_path / "parts" / "b.gltf").write_text(document)
    (tmp_path / "parts" / "b.bin").write_bytes(DATA)
    mesh = read_mesh_file(tmp_path / "world.wrl", "m")
    assert mesh.solid.size == pytest.approx((1.0, 0.0, 1.0), abs=1e-6)
    assert "not there" not in mesh.text
