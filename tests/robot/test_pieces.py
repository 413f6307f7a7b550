"""Concave shapes are divided into convex bodies that contain their whole surface."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from katana450.arm.robot.loader import load
from katana450.errors import InputError
from katana450.extensions.bodies.pieces import MAX_PIECES, divided_mesh
from katana450.extensions.bodies.robot_world import robot_world
from katana450.maths.geometry.arrays import FloatArray


def box(size: tuple[float, float, float], place: tuple[float, float, float]) -> Any:
    mesh = trimesh.creation.box(size)
    mesh.apply_translation(place)
    return mesh


def fork() -> Any:
    """Return two prongs on a bridge: a notch of 40 mm between them."""
    parts = [
        box((0.01, 0.02, 0.1), (-0.025, 0.0, 0.06)),
        box((0.01, 0.02, 0.1), (0.025, 0.0, 0.06)),
        box((0.06, 0.02, 0.01), (0.0, 0.0, 0.005)),
    ]
    return trimesh.util.concatenate(parts)


def hull_of(points: FloatArray) -> Any:
    """Return the convex hull of ``points`` (n, 3) as another program makes it."""
    cloud: Any = trimesh.PointCloud
    return cloud(points).convex_hull


def outside(corners: FloatArray, points: FloatArray) -> FloatArray:
    """Return how far each point (n,) is outside the hull of ``corners`` [m]; below 0 is inside."""
    hull = hull_of(corners)
    heights = np.einsum("ij,ij->i", hull.face_normals, hull.triangles[:, 0])
    return np.asarray((points @ hull.face_normals.T - heights).max(axis=1))


def test_the_notch_of_a_fork_is_free_and_its_surface_is_covered() -> None:
    mesh = fork()
    bodies = divided_mesh(mesh.vertices, mesh.faces)
    assert 2 <= len(bodies) <= MAX_PIECES
    points = trimesh.sample.sample_surface(mesh, 5000, seed=1)[0]
    covered = np.min([outside(body, points) for body in bodies], axis=0)
    assert covered.max() <= 1e-6
    notch = np.array([(0.0, 0.0, 0.06), (0.01, 0.0, 0.08), (-0.012, 0.0, 0.03)])
    assert np.min([outside(body, notch) for body in bodies], axis=0).min() > 5e-3


@pytest.mark.parametrize(
    "mesh",
    [
        trimesh.creation.icosphere(subdivisions=4, radius=0.05),
        trimesh.creation.box((0.02, 0.03, 0.1)),
        trimesh.creation.cylinder(0.02, 0.1),
    ],
    ids=["ball", "box", "cylinder"],
)
def test_a_convex_shape_stays_one_body(mesh: Any) -> None:
    (body,) = divided_mesh(mesh.vertices, mesh.faces)
    assert outside(body, mesh.vertices).max() <= 1e-6
    assert hull_of(body).volume <= 1.15 * mesh.volume


def test_a_flat_sheet_and_a_point_cloud_have_bodies_and_one_point_is_refused() -> None:
    sheet = np.array([(0, 0, 0), (0.1, 0, 0), (0.1, 0.1, 0), (0, 0.1, 0)])
    faces = np.array([(0, 1, 2), (0, 2, 3)])
    (body,) = divided_mesh(sheet, faces)
    assert np.ptp(body[:, 2]) > 0.0
    assert len(divided_mesh(sheet, faces[:0])) == 1
    with pytest.raises(InputError, match="no size"):
        divided_mesh(np.zeros((3, 3)), np.array([(0, 1, 2)]))


def test_a_bar_moves_in_a_fork_and_stops_at_its_prong(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    fork().export(tmp_path / "fork.stl")
    path = tmp_path / "robot.urdf"
    path.write_text("""<robot name="fork"><link name="base"/>
<link name="fork"><collision><geometry><mesh filename="fork.stl"/></geometry></collision></link>
<link name="bar"><collision><geometry><box size="0.01 0.1 0.01"/></geometry></collision></link>
<joint name="lift" type="prismatic"><parent link="base"/><child link="fork"/><axis xyz="0 0 1"/>
<limit lower="-0.1" upper="0.1" velocity="1" effort="1"/></joint>
<joint name="across" type="prismatic"><parent link="base"/><child link="bar"/>
<origin xyz="0 0 0.07"/><axis xyz="1 0 0"/>
<limit lower="-0.05" upper="0.05" velocity="1" effort="1"/></joint></robot>""")
    robot = load(path)
    world, notes, _ = robot_world(robot)
    # As one hull, fork and bar would overlap at rest and never be checked.
    assert notes == ("Not checked against the table, which they touch: fork.",)
    assert world is not None
    gap = world.gap(np.zeros(3), "fork", "bar")
    assert gap == pytest.approx(0.015, abs=1e-6)
    assert world.gap(np.array((0.0, 0.01, 0.0)), "fork", "bar") == pytest.approx(0.005, abs=1e-6)
    # The division is kept on the disk by the content of the file.
    monkeypatch.setattr(
        "katana450.extensions.bodies.pieces.divided_mesh", lambda *_: pytest.fail("divided again")
    )
    again, _, _ = robot_world(load(path))
    assert again is not None
    assert again.fingerprint.differs_by(world.fingerprint) == 0.0


def test_cone_with_many_sides_is_a_part() -> None:
    cone = trimesh.creation.cone(radius=0.02, height=0.06, sections=300)
    (corners,) = divided_mesh(np.asarray(cone.vertices), np.asarray(cone.faces))
    np.testing.assert_allclose(np.ptp(corners, axis=0), (0.04, 0.04, 0.06), atol=2e-4)
