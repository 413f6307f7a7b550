"""Tests of shape files: from other programs, from our exports, and invalid ones."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree
from trimesh.exchange.gltf import export_gltf

from katana450.arm.control.state import scene_objects
from katana450.arm.control.state.scene_objects import SceneObject, Shape
from katana450.arm.robot.robot import Robot
from katana450.errors import InputError
from katana450.extensions.convex_body import convex_body
from katana450.extensions.export.glb import glb_files
from katana450.extensions.export.vrml.vrml_files import world_of
from katana450.extensions.export.vrml.vrml_world import world_text
from katana450.extensions.importers import guarded_reading
from katana450.extensions.importers.formats.mesh_file import read_mesh
from katana450.extensions.importers.formats.shape_file import (
    LONGEST_NAME,
    MAX_SIZE,
    MIN_SIZE,
    Format,
    Up,
    label,
    object_name,
    read_shape,
)
from katana450.extensions.importers.guarded_reading import read_shape_guarded
from katana450.maths.geometry import se3, so3
from tests.exchange.conftest import GANTRY_POSE, POSES
from tests.exchange.shape_bytes import ply
from tests.exchange.solids import Numbers, is_closed, sides, triangles, volume

FOREIGN = Path(__file__).parent / "foreign"

FLAT, UPRIGHT = [60.0, 40.0, 25.0], [60.0, 25.0, 40.0]


@pytest.mark.parametrize(
    ("file", "standing", "colour"),
    [
        ("vtk.wrl", UPRIGHT, (255, 128, 0, 255)),
        ("meshlab.wrl", UPRIGHT, (230, 230, 230, 255)),
        ("gmsh.stl", FLAT, None),
        ("vtk.stl", FLAT, None),
        ("meshlab.stl", FLAT, None),
        ("gmsh.obj", FLAT, None),
        ("vtk.obj", FLAT, None),
        ("meshlab.obj", FLAT, None),
        ("vtk.ply", FLAT, None),
        ("meshlab.ply", FLAT, (200, 100, 50, 255)),
        ("assimp.ply", FLAT, None),
        ("vtk.gltf", UPRIGHT, (255, 188, 0, 255)),
        ("assimp.glb", UPRIGHT, (203, 203, 203, 255)),
    ],
)
def test_the_bracket_of_other_programs_is_the_bracket(
    file: str, standing: list[float], colour: tuple[int, ...] | None
) -> None:
    format = Format.of(file)
    # The numbers are millimetres, although glTF demands metres.
    unit = 1e-3 if format in (Format.GLB, Format.GLTF) else None
    shape = read_shape((FOREIGN / file).read_bytes(), format, file, unit)
    assert (shape.unit, sides(shape), is_closed(shape)) == (1e-3, standing, True)
    assert volume(shape) == pytest.approx(35e-6, rel=1e-6)
    if colour is None:
        assert shape.colours is None
    else:
        assert shape.colours is not None
        assert len(shape.colours) == len(shape.faces)
        assert tuple(shape.colours[0].tolist()) == colour


def test_a_whole_world_is_flattened() -> None:
    """Extrusion, Cylinder, USE and Switch, as written by another program."""
    shapes = [
        read_shape((FOREIGN / file).read_bytes(), Format.WRL, file)
        for file in ("castle.wrl", "bracket.wrl")
    ]
    for shape in shapes:
        # A pin is a prism of 32 sides.
        pin = 16.0 * 5e-3**2 * np.sin(np.pi / 16.0) * 40e-3
        assert volume(shape) == pytest.approx(35e-6 + 2.0 * pin, rel=1e-6)
        assert sides(shape) == [110.0, 115.0, 45.0]
        assert shape.text.endswith("Left out: Text.")
        assert shape.colours is not None
        assert np.unique(shape.colours, axis=0).tolist() == [[255, 128, 0, 191]]
    castle, ours = (triangles(shape.vertices * 1e3, shape.faces, 3) for shape in shapes)
    assert castle == ours


def written(mesh: trimesh.Trimesh, kind: str) -> bytes:
    """Return the file as trimesh writes it, independently of our code."""
    if kind == "gltf":
        files = export_gltf(trimesh.Scene(mesh), embed_buffers=True)  # type: ignore[no-untyped-call]
        return bytes(files["model.gltf"])
    kind, _, encoding = kind.partition(" ")
    data = mesh.export(file_type=kind, **({"encoding": encoding} if encoding else {}))
    return data.encode() if isinstance(data, str) else bytes(data)


@pytest.mark.parametrize(
    "kind", ["stl", "stl_ascii", "obj", "ply binary", "ply ascii", "glb", "gltf", "3mf"]
)
def test_every_format_gives_the_same_shape(kind: str) -> None:
    turn = se3.from_rotation_translation(so3.exp((0.2, 0.4, 0.6)), (5.0, 0.0, 0.0))
    mesh = trimesh.creation.annulus(10.0, 30.0, 25.0, transform=turn)
    mesh.visual.face_colors = [0, 255, 0, 128]
    format = Format(kind.split(maxsplit=1)[0].removesuffix("_ascii"))
    shape = read_shape(written(mesh, kind), format, "a", 1e-3, Up.Z)
    assert len(shape.faces) == len(mesh.faces)
    assert is_closed(shape)
    assert volume(shape) == pytest.approx(mesh.volume * 1e-9, rel=1e-5)
    far = cKDTree(mesh.vertices * 1e-3).query(shape.vertices)[0]
    assert len(shape.vertices) == len(mesh.vertices)
    assert far.max() < 1e-8
    if format not in (Format.STL, Format.THREEMF):
        assert shape.colours is not None
        assert set(shape.colours[:, 1]) == {255}
        # Colours of an OBJ have no opacity.
        assert set(shape.colours[:, 3]) == {255 if format is Format.OBJ else 128}


def placed(mechanism: Robot, values: dict[str, float]) -> tuple[Numbers, int]:
    """Return the corners (n, 9) of every triangle in the root's frame, and their number."""
    frames = mechanism.frames(values)
    rows = [
        (shape.vertices @ frames[link.name][:3, :3].T + frames[link.name][:3, 3])[shape.faces]
        for link in mechanism.links
        for shape in link.shapes
    ]
    corners = np.concatenate(rows).reshape(-1, 9)
    return corners, len(corners)


@pytest.mark.parametrize("which", ["arm", "gantry"])
def test_our_exports_are_read_back(which: str, katana: Robot, gantry: Robot) -> None:
    mechanism, pose = (katana, POSES[1]) if which == "arm" else (gantry, GANTRY_POSE)
    values = mechanism.values(pose)
    expected, count = placed(mechanism, values)
    ((_, glb),) = glb_files(mechanism, values).items()
    wrl = world_text(world_of(mechanism, values)).encode()
    for format, data, near in ((Format.WRL, wrl, 1e-5), (Format.GLB, glb, 1e-6)):
        shape = read_shape(data, format, "whole", 1.0)
        rows = shape.vertices[shape.faces].reshape(-1, 9)
        # Only slivers disappear by rounding.
        assert 0.99 * count < len(rows) <= count
        assert cKDTree(expected).query(rows, p=np.inf)[0].max() <= near
        missing = expected[cKDTree(rows).query(expected, p=np.inf)[0] > near].reshape(-1, 3, 3)
        edges = np.linalg.norm(missing - np.roll(missing, 1, axis=1), axis=2)
        assert len(missing) == 0 or edges.min(axis=1).max() < 2.0 * near
        assert shape.colours is not None


TETRAHEDRON = "v 0 0 0\nv {0} 0 0\nv 0 {0} 0\nv 0 0 {0}\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n"


def tetrahedron(size: float) -> bytes:
    return TETRAHEDRON.format(size).encode()


@pytest.mark.parametrize(
    ("size", "stated", "unit", "said"),
    [
        (1.5, None, 1.0, "assumed to be m, since 1.5 mm would be small"),
        (2.5, None, 1e-3, "assumed to be mm, since 2.5 m would be too large"),
        (1500.0, None, 1e-3, "assumed to be mm"),
        (3.0, 0.0254, 0.0254, "the unit is in, as given"),
        (3.0, 0.1, 0.1, "the unit is 0.1 m, as given"),
    ],
)
def test_unit_is_given_or_guessed_and_reported(
    size: float, stated: float | None, unit: float, said: str
) -> None:
    shape = read_shape(tetrahedron(size), Format.OBJ, "a.obj", stated)
    assert shape.unit == unit
    assert volume(shape) == pytest.approx((size * unit) ** 3 / 6.0)
    assert said in shape.text
    assert "4 triangles" in shape.text


@pytest.mark.parametrize(
    ("size", "stated", "said"),
    [
        (1e7, None, "no unit would fit"),
        (5e3, 1.0, "would fit with the unit mm or cm"),
        (1e-9, None, "no unit would fit"),
        (1.0, 0.0, "above 0"),
        (1.0, float("nan"), "above 0"),
        (1.0, float("inf"), "above 0"),
    ],
)
def test_an_invalid_size_is_refused(size: float, stated: float | None, said: str) -> None:
    with pytest.raises(InputError, match=said):
        read_shape(tetrahedron(size), Format.OBJ, "a.obj", stated)


@pytest.mark.parametrize(
    ("size", "stated", "scale", "said"),
    [
        (3000.0, None, 0.5, "3000 mm long, over 2000 mm: place it with the scale 0.5, 1500 mm"),
        (150.0, 1.0, 0.01, "1500 mm long, or read it with the unit mm or cm"),
        (0.5, 1e-3, 20.0, "0.5 mm long, under 1 mm: .* scale 20, 10 mm long.* cm or in or m"),
        (2000.0, None, 1.0, "2000 × 2000 × 2000 mm"),
        (2.0002e3, 1e-3, 0.5, "2000.2 mm long, over 2000 mm"),
    ],
)
def test_a_scale_is_proposed_for_a_size_that_cannot_be_placed(
    size: float, stated: float | None, scale: float, said: str
) -> None:
    shape = read_shape(tetrahedron(size), Format.OBJ, "a.obj", stated)
    assert shape.scale == scale
    assert MIN_SIZE <= scale * np.ptp(shape.vertices, axis=0).max() <= MAX_SIZE
    assert re.search(said, shape.text)


def test_gltf_is_in_metres_even_where_that_is_too_large() -> None:
    shape = read_shape((FOREIGN / "assimp.glb").read_bytes(), Format.GLB, "a.glb")
    assert shape.unit == 1.0
    assert "with the unit mm or cm" in shape.text


def test_the_axis_that_is_up_can_be_given() -> None:
    data = (FOREIGN / "vtk.wrl").read_bytes()
    upright, flat = (read_shape(data, Format.WRL, "vtk.wrl", up=up) for up in (Up.Y, Up.Z))
    assert (sides(upright), sides(flat)) == (UPRIGHT, FLAT)
    x, y, z = flat.vertices.T
    np.testing.assert_array_equal(upright.vertices, np.column_stack((x, -z, y)))
    assert "as given" in flat.text


@pytest.mark.parametrize(
    ("name", "shown", "scene_object"),
    [
        ("cup.wrl", "cup.wrl", "cup"),
        ("../../etc/passwd.stl", "passwd.stl", "passwd"),
        ("C:\\parts\\arm 2.obj", "arm 2.obj", "arm 2"),
        ("a\x00\n\x1b[2Jb.ply", "a[2Jb.ply", "a[2Jb"),
        ("", "The file", "shape"),
        (".stl", ".stl", "shape"),
        ("x" * 300 + ".stl", "x" * 31 + "…xxxx.stl", "x" * 31 + "…xxxx"),
    ],
)
def test_names_of_files_become_names_of_objects(name: str, shown: str, scene_object: str) -> None:
    assert (label(name), object_name(name)) == (shown, scene_object)


@settings(max_examples=15)
@given(st.text(max_size=99))
def test_any_file_name_gives_an_object_name(name: str) -> None:
    SceneObject(object_name(name), Shape.SPHERE, (0.1,), np.eye(4))
    assert len(label(label(name))) <= LONGEST_NAME


def test_bounds_are_those_of_objects() -> None:
    assert (MAX_SIZE, MIN_SIZE) == (scene_objects.MAX_SIZE, scene_objects.MIN_SIZE)
    assert scene_objects.MAX_NAME_LENGTH == LONGEST_NAME


def test_gltf_of_2_m_is_placed_and_a_longer_one_with_a_scale() -> None:
    """In single precision a side of 2 m is longer than 2 m by rounding."""
    side = float(np.nextafter(np.float32(2.0), np.float32(3.0)))

    def cube(side: float) -> bytes:
        return bytes(trimesh.creation.box((side, 0.1, 0.1)).export(file_type="glb"))

    mesh = read_mesh(cube(side), "long.glb")
    assert SceneObject("long", Shape.MESH, (), np.eye(4), solid=mesh.solid).size[0] > 2.0
    longer = read_mesh(cube(2.0002), "long.glb")
    assert longer.scale == 0.5
    assert "It is 2000.2 mm long, over 2000 mm" in longer.text
    with pytest.raises(InputError, match="must be from"):
        SceneObject("long", Shape.MESH, (), np.eye(4), solid=longer.solid)
    SceneObject("long", Shape.MESH, (), np.eye(4), solid=longer.solid, scale=longer.scale)


def test_formats_follow_from_the_suffix() -> None:
    assert [Format.of(f"a.{format.value.upper()}") for format in Format] == list(Format)
    assert Format.of("a.b.WRL") is Format.WRL
    for name in ("wrl", "a.step", "a.x3dv", "a", ""):
        with pytest.raises(InputError, match=r"\.wrl, \.stl"):
            Format.of(name)


def test_a_guarded_reading_is_the_same() -> None:
    for file, unit, up in (("castle.wrl", None, Up.Z), ("gmsh.stl", 1e-3, None)):
        data = (FOREIGN / file).read_bytes()
        shape = read_shape(data, Format.of(file), f"-{file}", unit, up)
        guarded, body = read_shape_guarded(data, Format.of(file), f"-{file}", unit, up)
        assert (guarded.name, guarded.unit, guarded.text) == (shape.name, shape.unit, shape.text)
        np.testing.assert_array_equal(guarded.vertices, shape.vertices)
        np.testing.assert_array_equal(guarded.faces, shape.faces)
        np.testing.assert_array_equal(guarded.colours, shape.colours)
        assert guarded.vertices.dtype == np.float64
        np.testing.assert_array_equal(body.corners, convex_body(shape.vertices).corners)


def test_a_guarded_reading_fails_with_a_message(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(InputError, match=r"hull\.ply is not a PLY file"):
        read_shape_guarded(b"not a ply", Format.PLY, "hull.ply")
    with pytest.raises(InputError, match=r"has 20\.0 MB"):
        read_shape_guarded(bytes(20_000_001), Format.PLY, "hull.ply")
    monkeypatch.setattr(guarded_reading, "SECONDS", 0.01)
    with pytest.raises(InputError, match=r"longer than 0.08 s"):
        read_shape_guarded(b"not a ply", Format.PLY, "hull.ply")
    monkeypatch.setattr(guarded_reading, "SECONDS", 5.0)
    monkeypatch.setattr("sys.executable", "false")
    with pytest.raises(InputError, match="needs more than 5 s of processor time or 1024 MiB"):
        read_shape_guarded(b"not a ply", Format.PLY, "hull.ply")


@pytest.mark.long
@pytest.mark.skipif(sys.platform == "win32", reason="nothing else limits a process there")
def test_limit_of_the_reading_time_counts_processor_time(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A process that waits for its turn on a busy machine reads its file nevertheless."""
    slow = tmp_path / "python"
    slow.write_text(f'#!/bin/sh\nsleep 1.1\nexec "{sys.executable}" "$@"\n')
    slow.chmod(0o700)
    monkeypatch.setattr(guarded_reading, "SECONDS", 1.0)
    monkeypatch.setattr("sys.executable", str(slow))
    shape, _ = read_shape_guarded(ply("3 0 1 2\n"), Format.PLY, "a.ply")
    assert len(shape.faces) == 1
