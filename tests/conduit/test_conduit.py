"""The conduit keeps its fittings, almost its length, and its path at all joint angles."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
import yourdfpy

from katana450.arm.robot.robot import Robot
from katana450.errors import RobotDescriptionError
from katana450.extensions.conduit import (
    CONDUITS,
    PROFILE,
    SIDES,
    ConduitStretch,
    poses,
    ring,
    stretches_of,
)
from katana450.maths.geometry import so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.resources import URDF_PATH

Stretches = tuple[ConduitStretch, ...]

DENSE = 400
SPARSE = 40


@pytest.fixture(scope="module")
def stretches(robot: Robot) -> Stretches:
    return stretches_of(robot)


def test_it_runs_from_the_base_to_the_wrist_over_every_bending_joint(stretches: Stretches) -> None:
    assert [stretch.joint.name for stretch in stretches] == [f"axis_{i}" for i in range(1, 5)]
    assert [stretch.winds for stretch in stretches] == [True, False, False, False]


@pytest.mark.parametrize("number", range(4))
def test_it_leaves_one_fitting_and_arrives_at_the_other(stretches: Stretches, number: int) -> None:
    """Compare with the poses of both links, as yourdfpy reads them from the URDF."""
    stretch = stretches[number]
    urdf = yourdfpy.URDF.load(str(URDF_PATH), load_meshes=False, build_scene_graph=True)
    joint = stretch.joint
    for angle in np.linspace(joint.lower, joint.upper, 13):
        urdf.update_cfg({joint.name: angle})
        T = urdf.get_transform(stretch.end.link, stretch.start.link)
        points, tangents = stretch.course(angle, DENSE)
        end = T[:3, :3] @ stretch.end.point + T[:3, 3]
        assert np.linalg.norm(points[0] - stretch.start.point) < 2e-3
        assert np.linalg.norm(points[-1] - end) < 2e-3
        assert tangents[0] @ stretch.start.tangent > 0.9
        assert tangents[-1] @ (T[:3, :3] @ stretch.end.tangent) > 0.9
        assert np.allclose(np.linalg.norm(tangents, axis=1), 1.0)


@pytest.mark.parametrize("number", range(4))
def test_its_ribs_keep_their_distance_and_it_moves_continuously(
    stretches: Stretches, number: int
) -> None:
    stretch = stretches[number]
    before = None
    for angle in np.linspace(stretch.joint.lower, stretch.joint.upper, 400):
        points, _ = stretch.course(angle, DENSE)
        steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
        length = steps.sum() * DENSE / (DENSE - 1)
        # Its ribs give.
        assert 0.85 < length / stretch.length < 1.25
        # Ribs are drawn at even steps along it.
        assert steps.max() < 1.1 * steps.min()
        if before is not None:
            assert np.linalg.norm(points - before, axis=1).max() < 5e-3
        before = points


FITTED = 0.022
"""[m] Length at stretch end that is inside the fitting or comes out of it."""

POSTURES = (
    (0, -68, 85, 8, 0),
    (-30, -40, 45, 35, 0),
    (40, -92, 12, 20, 60),
    (110, -112, 112, 70, -90),
    (0, 0, 0, 0, 0),
    (170, -60, 90, 40, 0),
    (-170, -60, 90, 40, 0),
    (45, -60, 80, -20, 90),
    (-90, -100, -60, 30, 0),
    (-130, -80, 110, 100, 0),
)
"""[deg] Postures of the pictures, at the limits of axis 1, and folded up in both directions."""


@pytest.mark.parametrize("posture", POSTURES)
def test_it_is_clear_of_every_solid(
    robot: Robot,
    stretches: Stretches,
    surfaces: dict[str, FloatArray],
    posture: tuple[int, ...],
) -> None:
    """Test random points on the visible surfaces of the links, about 5 mm apart."""
    angles = robot.joint_values(np.radians(posture), 0.0)
    T = robot.frames(angles)
    solid = np.concatenate(
        [points @ T[name][:3, :3].T + T[name][:3, 3] for name, points in surfaces.items()]
    )
    for stretch in stretches:
        points, _ = stretch.course(angles[stretch.joint.name], SPARSE)
        along = np.linspace(0.0, 1.0, SPARSE) * stretch.length
        free = points[(along > FITTED) & (along < stretch.length - FITTED)]
        for point in free @ T[stretch.start.link][:3, :3].T + T[stretch.start.link][:3, 3]:
            assert np.linalg.norm(solid - point, axis=1).min() > stretch.radius + 3.5e-3


@pytest.fixture(scope="module")
def surfaces(robot: Robot) -> dict[str, FloatArray]:
    """Return points (n, 3) [m] on each link, in its frame."""
    return {
        body.name: np.concatenate(
            [
                trimesh.sample.sample_surface(visual.mesh, int(4e4 * visual.mesh.area), seed=450)[0]
                for visual in body.visuals
            ]
        )
        for body in robot.links
        if body.visuals
    }


def test_a_rib_is_a_closed_band_seen_from_outside() -> None:
    vertices, faces = ring(0.008)
    assert vertices.shape == (SIDES * len(PROFILE), 3)
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    outward = (a + b + c)[:, 1:] / 3.0
    normal = np.cross(b - a, c - a)[:, 1:]
    assert ((outward * normal).sum(axis=1) > 0.0).all()


@pytest.mark.parametrize(
    "change",
    [
        {"radius": -1.0}, {"length": float("inf")}, {"radius": "thick"}, {"ends": []},
        {"ends": [{"link": "nowhere"}] * 2}, None,
    ],
)  # fmt: skip
def test_a_broken_file_is_refused(
    robot: Robot, tmp_path: Path, change: dict[str, object] | None
) -> None:
    described = json.loads((URDF_PATH.parent / CONDUITS).read_text(encoding="utf-8"))
    described["conduits"][0].update(change or {})
    text = "nonsense" if change is None else json.dumps(described)
    (tmp_path / CONDUITS).write_text(text, encoding="utf-8")
    with pytest.raises(RobotDescriptionError, match=CONDUITS):
        stretches_of(replace(robot, path=tmp_path / URDF_PATH.name))


@pytest.mark.parametrize(
    ("start", "end"),
    [
        ("arm_base_link", "upper_arm_link"),
        ("upper_arm_link", "pan_link"),
        ("roll_link", "flange"),
        ("nowhere", "wrist_link"),
        ("arm_base_link", "nowhere"),
    ],
)
def test_ends_on_links_without_one_joint_between_are_refused(
    robot: Robot, tmp_path: Path, start: str, end: str
) -> None:
    described = json.loads((URDF_PATH.parent / CONDUITS).read_text(encoding="utf-8"))
    for one, link in zip(described["conduits"][0]["ends"], (start, end), strict=True):
        one["link"] = link
    (tmp_path / CONDUITS).write_text(json.dumps(described), encoding="utf-8")
    with pytest.raises(RobotDescriptionError, match=CONDUITS):
        stretches_of(replace(robot, path=tmp_path / URDF_PATH.name))


@pytest.mark.parametrize("number", range(4))
def test_rings_are_square_to_the_conduit(stretches: Stretches, number: int) -> None:
    stretch = stretches[number]
    for angle in np.linspace(stretch.joint.lower, stretch.joint.upper, 25):
        rings = poses(stretch, angle).astype(float)
        points, tangents = stretch.course(angle, len(rings))
        np.testing.assert_allclose(rings[:, 4:], points, atol=1e-6)
        for row, tangent in zip(rings, tangents, strict=True):
            assert so3.from_quaternion(row[:4])[:, 0] @ tangent == pytest.approx(1.0, abs=1e-6)
