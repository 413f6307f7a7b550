"""Shapes of the ghost have less detail and the same outline."""

from __future__ import annotations

import numpy as np
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from katana450.arm.robot.robot import Robot
from katana450.server.view.scene import COAT_THICKNESS, DETAIL, coarse, surface


@settings(max_examples=30)
@given(st.floats(5e-3, 0.05), st.integers(0, 4))
def test_coarse_shape_is_near_the_fine_one(cell: float, subdivisions: int) -> None:
    ball = trimesh.creation.icosphere(subdivisions=subdivisions, radius=0.1)
    vertices, faces = coarse(ball.vertices, ball.faces, cell)
    assert len(faces) <= len(ball.faces)
    assert (np.abs(np.linalg.norm(vertices, axis=1) - 0.1) < np.sqrt(3.0) * cell).all()
    # Every face has three different corners, and no two faces coincide.
    corners = np.sort(faces, axis=1)
    assert (np.diff(corners, axis=1) > 0).all()
    assert len(np.unique(corners, axis=0)) == len(faces)
    assert faces.max(initial=0) < len(vertices)


def test_distant_corners_are_unchanged() -> None:
    cube = trimesh.creation.box((0.1, 0.2, 0.3))
    vertices, faces = coarse(cube.vertices, cube.faces, 1e-3)
    assert sorted(map(tuple, vertices.round(12))) == sorted(map(tuple, cube.vertices.round(12)))
    assert trimesh.Trimesh(vertices, faces).volume == cube.volume


def test_ghost_keeps_the_outline_of_the_arm(robot: Robot) -> None:
    before = after = 0
    for body in robot.links:
        for visual in body.visuals:
            vertices, faces = surface(visual)
            fine = visual.mesh
            before += len(fine.faces)
            after += len(faces)
            for end in (np.min, np.max):
                gap = end(vertices, axis=0) - end(fine.vertices, axis=0)
                assert np.abs(gap).max() < DETAIL + 2.0 * COAT_THICKNESS
    assert after < 0.7 * before
