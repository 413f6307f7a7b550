"""The committed STL files: reproducible, closed, in metres, in the link's frame."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from katana450.resources import URDF_PATH
from robot_description.cad.build import parts
from robot_description.cad.stl import solid_of

STL = URDF_PATH.parent / "stl"


def load(link: str) -> trimesh.Trimesh:
    mesh = trimesh.load(STL / f"{link}.stl")
    assert isinstance(mesh, trimesh.Trimesh)
    return mesh


def test_each_is_one_closed_solid_of_the_links_size() -> None:
    for part in parts():
        mesh, solid = load(part.link), solid_of(part)
        assert mesh.is_watertight, part.link
        assert mesh.is_winding_consistent, part.link
        assert mesh.volume == pytest.approx(solid.volume() * 1e-9, rel=1e-3)
        bounds = np.array(solid.bounding_box()).reshape(2, 3) * 1e-3
        np.testing.assert_allclose(mesh.bounds, bounds, atol=1e-6)
