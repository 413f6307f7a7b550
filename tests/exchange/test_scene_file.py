"""Tests of scene files: read back unchanged, with errors reported at their lines."""

from __future__ import annotations

import io
import re
import textwrap
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from katana450.arm.control.state.scene_objects import SceneObject, Shape, Zone
from katana450.arm.control.state.solid import ObjectAppearance, Solid
from katana450.arm.robot.object_meshes import Mesh, Meshes
from katana450.errors import InputError
from katana450.extensions.importers import archive
from katana450.extensions.importers.formats import scene_file
from katana450.extensions.importers.formats.mesh_file import read_mesh
from katana450.extensions.importers.formats.scene_file import (
    StoredScene,
    read_scene_folder,
    read_scene_zip,
    scene_zip,
    written,
)
from katana450.extensions.importers.formats.shape_file import Up
from katana450.extensions.programs.script.script_scene import MeshFile, Scene, parsed
from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import FloatArray, frozen
from tests.exchange.shape_bytes import zipped

T_PALM_TOOL = frozen(se3.from_rotation_translation(so3.exp((0.1, 0.2, 0.3)), (0.01, -0.02, 0.15)))
NAMES = st.text(
    st.characters(categories=("L", "N", "P", "S"), max_codepoint=0x2FFF), min_size=1, max_size=20
).map(lambda text: f"a{text}")


def ring() -> bytes:
    content: bytes = trimesh.creation.torus(40.0, 12.0, 24, 12).export(file_type="stl")
    return content


@pytest.fixture(scope="module")
def mesh() -> Mesh:
    return read_mesh(ring(), "ring.stl")


def test_directory_of_a_zip_is_counted_before_it_is_read(monkeypatch: pytest.MonkeyPatch) -> None:
    """A million entries fit in 60 MB, and reading them takes seconds."""
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as archive:
        for number in range(scene_file.MAX_ENTRIES + 1):
            archive.writestr(f"{number:x}", "")
    monkeypatch.setattr(zipfile, "ZipFile", None)
    with pytest.raises(InputError, match="more than 64 files"):
        read_scene_zip(packed.getvalue(), None)


SOLID = Solid("ab12", (0.1, 0.2, 0.05), np.random.default_rng(3).normal(size=(20, 3)))


@st.composite
def poses(draw: st.DrawFn) -> FloatArray:
    p = draw(st.tuples(*(st.floats(-1.9, 1.9),) * 3))
    w = draw(st.tuples(*(st.floats(-1.8, 1.8),) * 3))
    return se3.from_rotation_translation(so3.exp(w), p)


@st.composite
def objects(draw: st.DrawFn, name: str) -> SceneObject:
    form = draw(st.sampled_from(Shape))
    colour = draw(st.none() | st.tuples(*(st.integers(0, 255),) * 3))
    look = ObjectAppearance(colour, draw(st.floats(0.05, 1.0)), draw(st.booleans()))
    size = draw(st.lists(st.floats(0.01, 1.0), min_size=form.numbers, max_size=form.numbers))
    zones = {Shape.VESSEL: [Zone.NONE], Shape.PLANE: [Zone.KEEP_OUT, Zone.SLOW]}
    zone = draw(st.sampled_from(zones.get(form, list(Zone))))
    is_zone = zone is not Zone.NONE
    return SceneObject(
        name,
        form,
        tuple(size),
        draw(poses()),
        not is_zone and draw(st.booleans()),
        solid=SOLID if form is Shape.MESH else None,
        scale=draw(st.sampled_from((1.0, 0.5)) | st.floats(0.2, 1.9)),
        appearance=look,
        fixed=not is_zone and draw(st.booleans()),
        zone=zone,
    )


@st.composite
def scenes(draw: st.DrawFn) -> Scene:
    names = draw(st.lists(NAMES, max_size=5, unique=True))
    joints = draw(st.none() | st.lists(st.floats(-3.0, 3.0), min_size=5, max_size=5))
    return Scene(
        tuple(draw(objects(name)) for name in names),
        draw(st.none() | st.floats(0.0, 2e-4)),
        None if joints is None else np.array(joints),
    )


@given(scenes())
@settings(max_examples=60)
def test_a_written_scene_is_read_back(scene: Scene) -> None:
    """Values are equal to a nanometre; their text is equal exactly."""
    file = MeshFile("meshes/it.stl", "mm", None, "0" * 64)
    text = written(scene, {SOLID.key: file}, T_PALM_TOOL)
    back = parsed(text).scene({file: SOLID}, T_PALM_TOOL)
    assert written(back, {SOLID.key: file}, T_PALM_TOOL) == text
    assert (back.water is None) == (scene.water is None)
    assert (back.water or 0.0) == pytest.approx(scene.water or 0.0, abs=1e-12)
    if scene.joints is not None:
        assert back.joints is not None
        np.testing.assert_allclose(back.joints, scene.joints, atol=1e-10)
    assert len(back.objects) == len(scene.objects)
    for one, other in zip(scene.objects, back.objects, strict=True):
        np.testing.assert_allclose(other.T, one.T, atol=3e-9)
        np.testing.assert_allclose(other.size, one.size, atol=1e-9)
        assert other.scale == pytest.approx(one.scale, rel=1e-11)
        assert other.appearance.opacity == pytest.approx(one.appearance.opacity, rel=1e-11)
        for name in ("name", "shape", "can_be_held", "fixed", "held", "zone"):
            assert getattr(one, name) == getattr(other, name)
        assert (other.appearance.colour, other.appearance.hidden) == (
            one.appearance.colour,
            one.appearance.hidden,
        )
        assert (other.solid is None) == (one.solid is None)


def scene_of(mesh: Mesh) -> StoredScene:
    T = se3.from_rotation_translation(so3.rotation_z(0.5), (0.4, 0.1, 0.0))
    stands = SceneObject("ring", Shape.MESH, (), T, solid=mesh.solid)
    camera = SceneObject(
        "camera", Shape.MESH, (), np.eye(4), solid=mesh.solid, scale=0.3, fixed=True
    )
    return StoredScene(Scene((stands, camera), None, np.zeros(5)), (mesh,))


@pytest.mark.parametrize("kind", ["zip", "folder"])
def test_a_scene_is_read_back_with_its_meshes(mesh: Mesh, kind: str, tmp_path: Path) -> None:
    stored = scene_of(mesh)
    data = scene_zip(stored, T_PALM_TOOL)
    if kind == "zip":
        back = read_scene_zip(data, T_PALM_TOOL)
        assert scene_zip(back, T_PALM_TOOL) == data
    else:
        zipfile.ZipFile(io.BytesIO(data)).extractall(tmp_path)
        assert sorted(p.name for p in tmp_path.rglob("*.*")) == ["ring.stl", "scene.yaml"]
        back = read_scene_folder(tmp_path / "scene.yaml", T_PALM_TOOL)
    (again,) = back.meshes
    assert again.key == mesh.key
    assert again.file == mesh.file
    for one, other in zip(stored.scene.objects, back.scene.objects, strict=True):
        np.testing.assert_allclose(other.T, one.T, atol=1e-9)
        assert other.solid is not None
        np.testing.assert_array_equal(other.solid.corners, mesh.solid.corners)


def test_scene_of_a_script_is_read_with_its_meshes(mesh: Mesh, tmp_path: Path) -> None:
    script = tmp_path / "script.yaml"
    zipfile.ZipFile(io.BytesIO(scene_zip(scene_of(mesh), T_PALM_TOOL))).extractall(tmp_path)
    scene = textwrap.indent((tmp_path / "scene.yaml").read_text("utf-8"), "  ")
    script.write_text(f"scene:\n{scene}\nsteps: [home]\n", encoding="utf-8")
    back = read_scene_folder(script, T_PALM_TOOL)
    assert [scene_object.name for scene_object in back.scene.objects] == ["ring", "camera"]
    assert back.meshes[0].key == mesh.key
    script.write_text("steps: [home]\n", encoding="utf-8")
    with pytest.raises(InputError, match="a script without a `scene`"):
        read_scene_folder(script, T_PALM_TOOL)


MESH = """\
scene: 1
objects:
- name: it
  shape: mesh
  mesh: {{file: {file}}}
  pose: [0, 0, 0, 0, 0, 0]
"""


@pytest.mark.parametrize(
    "path",
    ["../ring.stl", "/etc/passwd", "a/../../ring.stl", "C:ring.stl", "..\\ring.stl", "'a\\0.stl'"],
)
def test_no_path_leads_out_of_a_scene(path: str, tmp_path: Path) -> None:
    (tmp_path / "ring.stl").write_bytes(ring())
    inside = tmp_path / "inside"
    inside.mkdir()
    (inside / "scene.yaml").write_text(MESH.format(file=path))
    with pytest.raises(InputError, match=r"line 3.*not a relative path|in the folder"):
        read_scene_folder(inside / "scene.yaml", None)
    with pytest.raises(InputError, match="not a relative path"):
        read_scene_zip(zipped({"scene.yaml": MESH.format(file=path)}), None)


def test_a_link_out_of_the_folder_is_not_followed(tmp_path: Path) -> None:
    (tmp_path / "ring.stl").write_bytes(ring())
    inside = tmp_path / "inside"
    inside.mkdir()
    (inside / "link.stl").symlink_to(tmp_path / "ring.stl")
    (inside / "scene.yaml").write_text(MESH.format(file="link.stl"))
    with pytest.raises(InputError, match="not in the folder"):
        read_scene_folder(inside / "scene.yaml", None)


def ball(*, name: str = "it", size: str = "9", view_options: str = "") -> str:
    return f"- {{name: {name}, shape: sphere, size: [{size}], pose: [0,0,0,0,0,0]{view_options}}}\n"


THINGS = "scene: 1\nobjects:\n"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "line 1, column 1: The scene is empty"),
        ("scene: 2\n", "line 1.*version must be 1"),
        ("objects: []\n", "needs 'scene'"),
        (THINGS + "- {name: it}\n", "line 3.*needs 'shape'"),
        (
            THINGS + "- name: it\n  shape: box\n  size: [1, 2]\n  pose: [0, 0, 0]\n",
            "line 5, column 9.*of 3(.|\n)*line 6, column 9: A pose must be six numbers",
        ),
        (THINGS + ball(size=".nan"), "line 3.*Expected a number"),
        (THINGS + ball(view_options=", colour: red"), "line 3.*A colour must be like"),
        (THINGS + ball(view_options=", coluor: 1"), "line 3.*did you mean 'colour'"),
        (THINGS + ball(size="3000"), "line 3, column 3.*from 0.001 to 2 m"),
        (THINGS + ball() + ball(), "line 4.*two objects called 'it'"),
        (THINGS + ball(view_options=", attach: hand"), "line 3.*no model of a hand"),
        (THINGS + ball() + "# " + "-" * 70_000, "at most 64 KB"),
        ("scene: 1\nobjects: &a []\n", "Anchors"),
        ("scene: 1\nwater: -1\n", "line 2.*not between"),
        (MESH.format(file="gone.stl"), "line 3.*gone.stl"),
        (MESH.format(file="it.exe"), "line 3.*it.exe"),
        (MESH.format(file="scene.yaml"), "line 3.*scene.yaml has an unknown format"),
        (MESH.format(file="it.stl, sha256: abc"), "line 5.*64 digits"),
    ],
)
def test_error_is_reported_with_its_line(text: str, said: str) -> None:
    with pytest.raises(InputError, match=said):
        read_scene_zip(zipped({"scene.yaml": text}), None)


def test_a_mesh_file_that_has_changed_is_refused(mesh: Mesh) -> None:
    text = MESH.format(file=f"ring.stl, sha256: '{mesh.sha256}'")
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as archive:
        archive.writestr("scene.yaml", text)
        archive.writestr("ring.stl", ring() + b"\0")
    with pytest.raises(InputError, match=r"line 3(.|\n)*not the file|cannot|corrupt"):
        read_scene_zip(out.getvalue(), None)


def test_a_corrupt_or_too_large_zip_is_refused(mesh: Mesh, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = scene_zip(scene_of(mesh), T_PALM_TOOL)
    random = np.random.default_rng(0)
    for cut in random.integers(0, len(whole), 40).tolist():
        with pytest.raises(InputError):
            read_scene_zip(whole[:cut], T_PALM_TOOL)
    monkeypatch.setattr(scene_file, "read_mesh", lambda *_, **__: mesh)
    for _ in range(60):
        bent = bytearray(whole)
        bent[int(random.integers(len(bent)))] ^= int(random.integers(1, 256))
        try:
            read_scene_zip(bytes(bent), T_PALM_TOOL)
        except InputError:
            continue
    monkeypatch.setattr(archive, "MAX_ARCHIVE_BYTES", 100_000)
    bomb = zipped({"scene.yaml": MESH.format(file="zeros.stl"), "zeros.stl": bytes(1_000_000)})
    assert len(bomb) < 5000
    with pytest.raises(InputError, match="MB when unpacked"):
        read_scene_zip(bomb, None)
    many = zipped({f"f{i}": b"" for i in range(scene_file.MAX_FILES + 1)})
    with pytest.raises(InputError, match="more than 64 files"):
        read_scene_zip(many, None)
    with pytest.raises(InputError, match=r"no file scene\.yaml"):
        read_scene_zip(zipped({"other": b""}), None)


def made(key: str, size: int) -> Mesh:
    solid = Solid(key, SOLID.size, SOLID.corners)
    none = np.zeros((0, 3))
    return Mesh(bytes(size), "stl", "mm", None, key, none, none.astype(np.int64), None, solid, "")


def test_mesh_store_drops_only_unused_meshes() -> None:
    store = Meshes(maximum=3, max_bytes=100)
    for key in ("a", "b", "c"):
        store.put([made(key, 10)], ())
    store.put([made("d", 10)], {"a"})
    assert store.get("a") is not None
    assert store.get("b") is None
    with pytest.raises(InputError, match="Upload its file again"):
        store.need("b")
    for refused, used in ((made("e", 95), {"a"}), (made("e", 1), {"a", "c", "d"})):
        with pytest.raises(InputError, match="There is room for 3 meshes"):
            store.put([refused], used)
        assert all(store.get(key) is not None for key in "acd")
    store.put([made("e", 95)], ())
    assert [store.get(key) is None for key in "acde"] == [True, True, True, False]


def test_a_mesh_stands_on_its_underside_and_its_key_tells_how_it_was_read(mesh: Mesh) -> None:
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    np.testing.assert_allclose(low[:2], -high[:2], atol=1e-9)
    assert low[2] == 0.0
    np.testing.assert_allclose(high - low, mesh.solid.size, atol=1e-12)
    assert mesh.unit == "mm"
    stated = read_mesh(ring(), "other.stl", "mm")
    assert stated.key == mesh.key
    others: list[Callable[[], Mesh]] = [
        lambda: read_mesh(ring(), "ring.stl", "cm"),
        lambda: read_mesh(ring(), "ring.stl", up=Up.Y),
    ]
    assert all(other().key != mesh.key for other in others)
    with pytest.raises(InputError, match="The unit must be one of mm, cm, in, m"):
        read_mesh(ring(), "ring.stl", "ft")


def test_the_scene_of_the_documents_is_valid() -> None:
    page = Path(__file__).resolve().parents[2] / "docs" / "scenes.md"
    text = page.read_text(encoding="utf-8").partition("```yaml\n")[2].partition("```")[0]
    draft = parsed(re.sub(r".*sha256.*\n", "", text))
    assert [entry.name for entry in draft.entries] == ["cup", "door", "bracket"]
    assert draft.entries[2].mesh == MeshFile("meshes/bracket.stl", "mm", "z", None)
    assert draft.entries[2].fixed
    assert draft.water == pytest.approx(1.5e-4)
