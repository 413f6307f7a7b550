"""Test shapes of several files: as a .zip, and in scenes."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from katana450.arm.control.state.scene_objects import SceneObject, Shape
from katana450.errors import InputError
from katana450.extensions.export.vrml.vrml_world import HEADER
from katana450.extensions.importers import archive
from katana450.extensions.importers.archive import ChoiceError, packed
from katana450.extensions.importers.formats.mesh_file import read_mesh
from katana450.extensions.importers.formats.scene_file import (
    StoredScene,
    read_scene_folder,
    read_scene_zip,
    scene_zip,
)
from katana450.extensions.importers.formats.shape_file import Format, read_shape
from katana450.extensions.importers.guarded_reading import read_shape_guarded
from katana450.extensions.programs.script.script_scene import Scene
from tests.exchange.shape_bytes import zipped

ROBOT = f'{HEADER}\nInline {{ url "parts/arm.wrl" }} Inline {{ url "parts/tool/grip.wrl" }}'

PARTS = {
    "parts/arm.wrl": f'{HEADER}\nInline {{ url "tool/grip.wrl" }} '
    'Inline { url "../parts/x.wrl" }',
    "parts/tool/grip.wrl": f"{HEADER}\nShape {{ geometry Box {{ size .1 .1 .1 }} }}",
    "parts/x.wrl": f"{HEADER}\nTransform {{ translation .4 0 0 children Shape {{ "
    "geometry Box { size .1 .1 .1 } } }",
}

ARTICULATED = {"robot.wrl": ROBOT} | PARTS


def test_a_zip_is_read_by_the_file_in_the_highest_folder() -> None:
    others: dict[str, str | bytes] = {"a.png": b"x", "__MACOSX/._robot.wrl": b"x", ".b.wrl": b"x"}
    for folder in ("", "models/robot/"):
        data = zipped(PARTS | {"robot.wrl": ROBOT} | others, folder)
        shape = read_shape(data, Format.ZIP, "download.zip")
        assert (shape.name, len(shape.faces)) == ("robot", 36)
        assert np.ptp(shape.vertices[:, 0]) == pytest.approx(0.5)
        again = read_shape(shape.file, shape.format, "other.zip")
        assert (again.name, again.file) == ("robot", shape.file)


def test_a_zip_of_one_file_is_that_file() -> None:
    mesh = read_mesh(zipped({"a/part.wrl": PARTS["parts/x.wrl"]}), "download.ZIP")
    assert (mesh.name, mesh.format) == ("part", "wrl")
    assert mesh.file == PARTS["parts/x.wrl"].encode()


def test_one_of_several_shapes_is_chosen() -> None:
    part = PARTS["parts/x.wrl"]
    data = zipped({"left.wrl": part, "right.wrl": part})
    for read in (read_shape, read_shape_guarded):
        with pytest.raises(ChoiceError, match=r"choose one of left.wrl, right.wrl") as refused:
            read(data, Format.ZIP, "pair.zip")
        assert refused.value.choices == ("left.wrl", "right.wrl")
    shape = read_shape(data, Format.ZIP, "pair.zip", main="right.wrl")
    assert shape.name == "right"
    assert "Other shapes of the .zip were not read: left.wrl." in shape.text
    # A shape with the name of the .zip is the first one.
    assert read_shape(data, Format.ZIP, "LEFT.zip").name == "left"
    with pytest.raises(InputError, match=r"no file 'up.wrl' in pair.zip"):
        read_shape(data, Format.ZIP, "pair.zip", main="up.wrl")


def bomb(method: int) -> bytes:
    """Return a .zip of some hundred bytes with 40 MB, which zipfile would unpack at once."""
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", method) as file:
        file.writestr("a.wrl", bytes(40_000_000))
        file.writestr("scene.yaml", bytes(40_000_000))
    return out.getvalue()


@pytest.mark.parametrize(
    "method", [zipfile.ZIP_BZIP2, pytest.param(zipfile.ZIP_LZMA, marks=pytest.mark.long)]
)
def test_only_deflated_files_are_unpacked(method: int) -> None:
    data = bomb(method)
    assert len(data) < 20_000
    with pytest.raises(InputError, match="a method other than Deflate"):
        read_scene_zip(data, None)
    with pytest.raises(InputError, match="a method other than Deflate"):
        archive.unpacked(data.replace(b"scene.yaml", b"other.obj0"), "a.zip", ("wrl", "obj"))


# Made by the test, not when this file is read.
INVALID: list[tuple[Callable[[], bytes], str]] = [
    (lambda: b"", "cannot be read as a .zip"),
    (lambda: b"PK\x03\x04", "cannot be read as a .zip"),
    (lambda: zipped({}), "no file in a.zip that can be read"),
    (lambda: zipped({"a.txt": "x"}), "no file in a.zip that can be read"),
    (lambda: zipped({"scene.yaml": "scene: 1"}), "is a scene"),
    (lambda: zipped({"../a.wrl": ROBOT}), "no file in a.zip that can be read"),
    (lambda: zipped({"/a.wrl": ROBOT}), "no file in a.zip that can be read"),
    (lambda: zipped({"a.zip": zipped({"a.wrl": ROBOT})}), "no file in a.zip that can be read"),
    (lambda: zipped({"a.bin": bytes(70_000_000)}), "more than 60 MB when unpacked"),
    (lambda: zipped({"a.stl": bytes(20_000_001)}), "has 20.0 MB"),
    (
        lambda: zipped({f"{n}.wrl": "" for n in range(archive.MAX_FILES + 1)}),
        "more than 1000 files",
    ),
    (lambda: zipped(ARTICULATED)[:-40], "cannot be read as a .zip"),
]


@pytest.mark.parametrize(("archive", "said"), INVALID)
def test_invalid_archives_are_refused(archive: Callable[[], bytes], said: str) -> None:
    with pytest.raises(InputError, match=said):
        read_shape(archive(), Format.ZIP, "a.zip")


def test_a_changed_file_of_a_zip_is_refused() -> None:
    data = bytearray(packed("a.wrl", {"a.wrl": PARTS["parts/x.wrl"].encode() * 5}))
    data[60] ^= 255
    with pytest.raises(InputError, match=r"cannot be read as a .zip|corrupt"):
        read_shape(bytes(data), Format.ZIP, "a.zip")


@pytest.mark.long
def test_a_scene_keeps_all_files_of_an_object(tmp_path: Path) -> None:
    text = (
        "scene: 1\nobjects:\n- name: robot\n  shape: mesh\n  mesh: {file: meshes/robot.zip}\n"
        "  pose: [400, 0, 0, 0, 0, 0]\n"
    )
    (tmp_path / "scene.yaml").write_text(text)
    (tmp_path / "meshes").mkdir()
    (tmp_path / "meshes" / "robot.zip").write_bytes(zipped(ARTICULATED))
    stored = read_scene_folder(tmp_path / "scene.yaml", None)
    again = read_scene_zip(scene_zip(stored, None), None)
    assert [mesh.format for mesh in again.meshes] == ["zip"]
    assert len(again.meshes[0].faces) == 36
    np.testing.assert_array_equal(again.meshes[0].vertices, stored.meshes[0].vertices)
    big = read_mesh(f"{HEADER}\nShape {{ geometry Box {{ size 3000 1 1 }} }}".encode(), "big.wrl")
    scaled = SceneObject("big", Shape.MESH, (), np.eye(4), solid=big.solid, scale=big.scale)
    stored_scene = read_scene_zip(scene_zip(StoredScene(Scene((scaled,)), (big,)), None), None)
    assert stored_scene.scene.objects[0].scale == 0.5
