"""The committed GLB files: size, closed surfaces, normals, outer sizes of the real arm."""

from __future__ import annotations

import functools

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray
from trimesh.visual.material import PBRMaterial
from trimesh.visual.texture import TextureVisuals

from katana450.resources import URDF_PATH

MESHES = URDF_PATH.parent / "meshes"
TRIANGLE_BUDGET = 60_000
BYTE_BUDGET = 1_500_000
TOLERANCE = 5.0  # mm

# Outer sizes in mm in the link's frame: (x, y, z) ranges. The black covers in the fork slots
# protrude from the bare links in x and z, so the bare metal is measured there. On +y the base and
# the shoulder end with the fittings of the conduit.
EXTENT = {
    "base_link": ((-121.0, 121.0), (-121.0, 121.0), (0.0, 83.0)),
    "arm_base_link": ((-57.0, 55.0), (-55.0, 76.0), (0.0, 138.0)),
    "pan_link": ((-46.0, 46.0), (-67.5, 87.0), (-68.6, 46.1)),
    "upper_arm_link": ((-21.1, 209.1), (-47.4, 71.7), (-21.0, 21.0)),
    "forearm_link": ((-38.3, 157.8), (-63.5, 99.3), (-38.6, 37.8)),
    "wrist_link": ((-37.9, 122.5), (-56.0, 93.6), (-38.3, 38.1)),
    "roll_link": ((-30.0, 36.1), (-25.0, 25.0), (-25.0, 32.0)),
    "gripper_link": ((0.0, 48.5), (-25.0, 25.1), (-25.1, 25.0)),
    "finger_right_link": ((-9.6, 86.7), (-9.5, 46.5), (-12.5, 13.0)),
    "finger_left_link": ((-9.6, 86.7), (-46.5, 9.5), (-13.0, 12.5)),
}


def material(mesh: trimesh.Trimesh) -> PBRMaterial:
    """Return the surface of one primitive."""
    visual = mesh.visual
    assert isinstance(visual, TextureVisuals)
    assert isinstance(visual.material, PBRMaterial)
    return visual.material


@functools.cache
def primitives(link: str) -> dict[str, trimesh.Trimesh]:
    """Return the meshes of ``link`` by material, as stored in the file."""
    scene = trimesh.load(MESHES / f"{link}.glb", process=False)
    assert isinstance(scene, trimesh.Scene)
    meshes = list(scene.geometry.values())
    return {material(mesh).name: mesh for mesh in meshes}


def welded(mesh: trimesh.Trimesh) -> NDArray[np.int64]:
    """Return the triangles with equal vertices merged."""
    _, inverse = np.unique(mesh.vertices, axis=0, return_inverse=True)
    return np.asarray(inverse.reshape(-1)[mesh.faces], dtype=np.int64)


def test_one_file_for_each_link_with_a_shape() -> None:
    assert {path.stem for path in MESHES.glob("*.glb")} == set(EXTENT)


def test_triangles_and_bytes_are_in_budget() -> None:
    triangles = sum(len(mesh.faces) for link in EXTENT for mesh in primitives(link).values())
    size = sum(path.stat().st_size for path in MESHES.glob("*.glb"))
    assert triangles <= TRIANGLE_BUDGET
    assert size <= BYTE_BUDGET


@pytest.mark.parametrize("link", EXTENT)
def test_outer_size(link: str) -> None:
    everything = np.vstack([mesh.vertices for mesh in primitives(link).values()]) * 1e3
    bare = [m.vertices for name, m in primitives(link).items() if name != "black rubber"]
    for axis in range(3):
        points = everything if axis == 1 or "finger" in link else np.vstack(bare) * 1e3
        span = points[:, axis].min(), points[:, axis].max()
        np.testing.assert_allclose(span, EXTENT[link][axis], atol=TOLERANCE)


@pytest.mark.parametrize("link", EXTENT)
def test_every_material_is_a_closed_solid(link: str) -> None:
    for name, mesh in primitives(link).items():
        faces = welded(mesh)
        edges = np.vstack((faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]))
        counted = np.unique(edges, axis=0, return_counts=True)
        back = np.unique(edges[:, ::-1], axis=0, return_counts=True)
        for one, other in zip(counted, back, strict=True):
            np.testing.assert_array_equal(one, other, err_msg=f"{link}: {name} is open")
        assert mesh.volume > 0.0, f"{link}: {name} is inside out"


@pytest.mark.parametrize("link", EXTENT)
def test_normals_are_unit_and_follow_the_faces(link: str) -> None:
    for name, mesh in primitives(link).items():
        normals = np.asarray(mesh.vertex_normals)
        np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0, atol=1e-4)
        triangles = mesh.triangles
        area = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
        size = np.linalg.norm(area, axis=1)
        broad = size > 1e-9
        for corner in range(3):
            cosine = (normals[mesh.faces[broad, corner]] * area[broad]).sum(axis=1) / size[broad]
            # The edges of paint, 0.2 mm high, are shaded with its face.
            widest = 95.0 if name == "blue lettering" else 50.0
            assert cosine.min() > np.cos(np.radians(widest))


def test_metal_is_not_a_mirror() -> None:
    for link in EXTENT:
        for name, mesh in primitives(link).items():
            surface = material(mesh)
            assert surface.metallicFactor <= 0.5, name
            assert surface.roughnessFactor >= 0.3, name
