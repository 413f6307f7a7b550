"""Test shapes of several files: as a .zip, from a folder, and in scenes."""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from katana450.arm.control.state.scene_objects import SceneObject, Shape
from katana450.arm.robot.object_meshes import Mesh
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
from tests.exchange.compressed_gltf import DATA, SQUARE
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


def written(folder: Path, files: dict[str, str]) -> Path:
    for name, content in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(content)
    return folder / next(iter(files))


def test_a_zip_is_read_by_the_file_that_no_other_names() -> None:
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


def flooded() -> bytes:
    return zipped({f"{number}.wrl": "" for number in range(archive.MAX_FILES + 1)})


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
    (flooded, "more than 1000 files"),
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


def in_folder(path: Path) -> Mesh:
    """Return the mesh of a file with those of its folder, as a scene in the folder reads it."""
    scene = path.with_name("scene.yaml")
    entry = f"{{name: a, shape: mesh, mesh: {{file: {path.name}}}, pose: [400, 0, 0, 0, 0, 0]}}"
    scene.write_text(f"scene: 1\nobjects: [{entry}]\n")
    (mesh,) = read_scene_folder(scene, None).meshes
    return mesh


def test_a_file_takes_others_of_its_folder(tmp_path: Path) -> None:
    mesh = in_folder(written(tmp_path / "robot", ARTICULATED))
    assert (mesh.name, mesh.format, len(mesh.faces)) == ("robot", "zip", 36)
    assert sorted(zipfile.ZipFile(io.BytesIO(mesh.file)).namelist()) == sorted(ARTICULATED)
    assert read_mesh(mesh.file, "again.zip").key == mesh.key
    alone = in_folder(tmp_path / "robot" / "parts" / "x.wrl")
    assert alone.format == "wrl"


def test_no_file_outside_of_the_folder_is_read(tmp_path: Path) -> None:
    secret = tmp_path / "secret.wrl"
    secret.write_text(PARTS["parts/x.wrl"])
    folder = tmp_path / "robot"
    folder.mkdir()
    (folder / "link.wrl").symlink_to(secret)
    for url in ("../secret.wrl", str(secret), f"file://{secret}", "link.wrl", "", "."):
        (folder / "a.wrl").write_text(f'{HEADER}\nInline {{ url "{url}" }}')
        with pytest.raises(InputError, match="no triangles"):
            in_folder(folder / "a.wrl")


def test_files_of_a_folder_are_bounded(tmp_path: Path) -> None:
    document = SQUARE | {"buffers": [{"byteLength": 60, "uri": "a.bin"}]}
    (tmp_path / "a.gltf").write_text(json.dumps(document))
    (tmp_path / "a.bin").write_bytes(DATA + bytes(20_000_000))
    with pytest.raises(InputError, match="and the files that it names have over 20 MB"):
        in_folder(tmp_path / "a.gltf")


def test_files_beyond_the_limit_are_not_read() -> None:
    """Each file alone is small enough; together they would be 9 GB."""
    names, reads = [f"{number}.wrl" for number in range(450)], []

    def beside(name: str, maximum: int) -> bytes:
        reads.append((name, maximum))
        return bytes(min(8_000_000, maximum + 1))

    world = HEADER + "".join(f'\nInline {{ url "{name}" }}' for name in names)
    with pytest.raises(InputError, match="and the files that it names have over 20 MB"):
        read_mesh(world.encode(), "a.wrl", companion=beside)
    left = 20_000_000 - len(world)
    assert reads == [(names[0], left), (names[1], left - 8_000_000), (names[2], left - 16_000_000)]


@pytest.mark.long
def test_a_scene_keeps_all_files_of_an_object(tmp_path: Path) -> None:
    text = (
        "scene: 1\nobjects:\n- name: robot\n  shape: mesh\n  mesh: {file: meshes/robot.wrl}\n"
        "  pose: [400, 0, 0, 0, 0, 0]\n"
    )
    (tmp_path / "scene.yaml").write_text(text)
    written(tmp_path / "meshes", ARTICULATED)
    stored = read_scene_folder(tmp_path / "scene.yaml", None)
    again = read_scene_zip(scene_zip(stored, None), None)
    assert [mesh.format for mesh in again.meshes] == ["zip"]
    np.testing.assert_array_equal(again.meshes[0].vertices, stored.meshes[0].vertices)
    archive = zipped({"scene.yaml": text} | {f"meshes/{n}": c for n, c in ARTICULATED.items()})
    assert len(read_scene_zip(archive, None).meshes[0].faces) == 36
    big = read_mesh(f"{HEADER}\nShape {{ geometry Box {{ size 3000 1 1 }} }}".encode(), "big.wrl")
    scaled = SceneObject("big", Shape.MESH, (), np.eye(4), solid=big.solid, scale=big.scale)
    stored_scene = read_scene_zip(scene_zip(StoredScene(Scene((scaled,)), (big,)), None), None)
    assert stored_scene.scene.objects[0].scale == 0.5
