"""The conduit keeps its fittings, its length and its path at all joint angles."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from katana450.arm.robot.loader import load
from katana450.arm.robot.robot import Robot
from katana450.errors import RobotDescriptionError
from katana450.extensions.conduit import (
    CONDUITS,
    PROFILE,
    SIDES,
    STRETCH_FRACTION,
    ConduitStretch,
    ring,
    rings_along,
    stretches_of,
)
from katana450.maths.geometry import so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.resources import URDF_PATH

Stretches = tuple[ConduitStretch, ...]

numbers = pytest.mark.parametrize("number", range(4))


@pytest.fixture(scope="module")
def stretches(robot: Robot) -> Stretches:
    return stretches_of(robot)


def curve(robot: Robot, stretch: ConduitStretch, angles: dict[str, float]) -> FloatArray:
    """Return the points (n, 3) [m] of a stretch in the base frame."""
    frames = robot.frames(angles)
    T = frames[stretch.start]
    return np.asarray(stretch.curve(robot, angles, frames) @ T[:3, :3].T + T[:3, 3])


def test_it_runs_from_the_base_to_the_wrist_over_every_bending_joint(stretches: Stretches) -> None:
    links = [stretch.start for stretch in stretches] + [stretches[-1].ends[1].link]
    assert links == ["arm_base_link", "pan_link", "upper_arm_link", "forearm_link", "wrist_link"]
    assert [stretch.winds for stretch in stretches] == ["axis_1", None, None, None]


@numbers
def test_it_joins_its_fittings_and_moves_continuously_at_its_length(
    robot: Robot, stretches: Stretches, number: int
) -> None:
    stretch, joint = stretches[number], robot.joints[f"axis_{number + 1}"]
    before = None
    for angle in np.linspace(joint.lower, joint.upper, 400):
        angles = robot.every({joint.name: float(angle)})
        points = curve(robot, stretch, angles)
        steps = np.diff(points, axis=0)
        for end, point, step in zip(stretch.ends, points[[0, -1]], steps[[0, -1]], strict=True):
            T = robot.frames(angles)[end.link]
            np.testing.assert_allclose(point, T[:3, :3] @ end.point + T[:3, 3], atol=1e-9)
            assert step @ (T[:3, :3] @ end.tangent) > 0.95 * np.linalg.norm(step)
        length = np.linalg.norm(steps, axis=1).sum()
        # Around axis 1 its ribs stretch and compress it; elsewhere it hangs.
        give = STRETCH_FRACTION + 0.01 if stretch.winds else 0.01
        assert 1.0 - give < length / stretch.length < 1.0 + give
        if before is not None:
            assert np.linalg.norm(points - before, axis=1).max() < 5e-3
        before = points


@numbers
def test_rings_stand_evenly_and_square_to_the_curve(
    robot: Robot, stretches: Stretches, number: int
) -> None:
    for angle in (-1.0, 0.0):
        points = curve(robot, stretches[number], robot.every({f"axis_{number + 1}": angle}))
        rings = rings_along(points, 40)
        steps = np.diff(rings[:, 4:], axis=0)
        lengths = np.linalg.norm(steps, axis=1)
        assert lengths.max() < 1.1 * lengths.min()
        middle = (steps[1:] + steps[:-1]) / np.linalg.norm(steps[1:] + steps[:-1], axis=1)[:, None]
        for pose, tangent in zip(rings[1:-1], middle, strict=True):
            assert so3.from_quaternion(pose[:4])[:, 0] @ tangent > 0.99


def test_rings_of_a_conduit_that_leads_backwards_are_rotations() -> None:
    poses = rings_along(np.linspace((0.0, 0.0, 0.0), (-1.0, 0.0, 0.0), 5), 3)
    np.testing.assert_allclose([so3.from_quaternion(pose[:4])[0, 0] for pose in poses], -1.0)


FITTED = 0.022
"""[m] Length at each end that is inside the fitting or comes out of it."""

CLEARANCE = 3e-3
"""[m] Least distance of the conduit from every link."""

POSTURES = (
    (0, -68, 85, 8, 0),
    (-30, -40, 45, 35, 0),
    (40, -92, 12, 20, 60),
    (110, -112, 112, 70, -90),
    (0, 0, 0, 0, 0),
    (165, -60, 90, 40, 0),
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
        points = rings_along(curve(robot, stretch, angles), stretch.count)[:, 4:]
        along = (np.arange(stretch.count) + 0.5) * stretch.length / stretch.count
        for point in points[(along > FITTED) & (along < stretch.length - FITTED)]:
            assert np.linalg.norm(solid - point, axis=1).min() > stretch.radius + CLEARANCE


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


DESCRIBED = json.loads((URDF_PATH.parent / CONDUITS).read_text(encoding="utf-8"))["conduits"][0]
START, END = DESCRIBED["ends"]


def described(change: dict[str, Any]) -> str:
    return json.dumps({"conduits": [DESCRIBED | change]})


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("nonsense", "invalid"),
        ("{}", "conduits"),
        ('{"conduits": [{}]}', "ends"),
        ('{"conduits": 3}', "array"),
        (described({"radius": -1.0}), "radius"),
        (described({"radius": 0.3}), "radius 0.3 m is not below the length 0.23 m"),
        (described({"length": float("inf")}), "malformed"),
        (described({"radius": "thick"}), "radius"),
        (described({"ends": []}), "ends"),
        (described({"ends": [START, END | {"tangent": [0.0, 1.0]}]}), "tangent"),
        (described({"ends": [START | {"link": "nowhere"}, END]}), "no link nowhere"),
        (described({"winds": "axis_9"}), "no joint axis_9"),
    ],
)
def test_a_wrong_file_is_refused(tmp_path: Path, text: str, message: str) -> None:
    urdf = tmp_path / URDF_PATH.name
    urdf.write_bytes(URDF_PATH.read_bytes())
    (tmp_path / CONDUITS).write_text(text, encoding="utf-8")
    with pytest.raises(RobotDescriptionError, match=message) as refused:
        stretches_of(load(urdf))
    assert CONDUITS in str(refused.value)
