"""The committed STL files: reproducible, closed, in metres, in the link's frame."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from katana450.resources import URDF_PATH
from robot_description.cad.build import parts
from robot_description.cad.stl import solid_of

STL = URDF_PATH.parent / "stl"
BYTE_BUDGET = 3_000_000


def load(link: str) -> trimesh.Trimesh:
    mesh = trimesh.load(STL / f"{link}.stl")
    assert isinstance(mesh, trimesh.Trimesh)
    return mesh


def test_bytes_are_in_budget() -> None:
    assert sum(path.stat().st_size for path in STL.iterdir()) <= BYTE_BUDGET


def test_each_is_one_closed_solid_of_the_links_size() -> None:
    for part in parts():
        mesh, solid = load(part.link), solid_of(part)
        assert mesh.is_watertight, part.link
        assert mesh.is_winding_consistent, part.link
        assert mesh.volume == pytest.approx(solid.volume() * 1e-9, rel=1e-3)
        bounds = np.array(solid.bounding_box()).reshape(2, 3) * 1e-3
        np.testing.assert_allclose(mesh.bounds, bounds, atol=1e-6)


def test_stored_normals_are_those_of_the_triangles() -> None:
    rows = np.frombuffer(
        (STL / "gripper_link.stl").read_bytes()[84:],
        dtype=[("normal", "<f4", 3), ("corner", "<f4", (3, 3)), ("attribute", "<u2")],
    )
    corner = rows["corner"].astype(np.float64)
    area = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    size = np.linalg.norm(area, axis=1)
    broad = size > 1e-12
    aligned = (area[broad] * rows["normal"][broad]).sum(axis=1) / size[broad]
    np.testing.assert_allclose(aligned, 1.0, atol=1e-4)
