"""The convex body of a mesh contains all of it, and not much more."""

from __future__ import annotations

import functools

import numpy as np
import pytest
import trimesh
import yourdfpy
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from manifold3d import Manifold

from katana450.arm.control.state.solid import MAX_CORNERS
from katana450.arm.robot.robot import Robot
from katana450.errors import InputError
from katana450.extensions.convex_body import MIN_THICKNESS_FRACTION, ConvexBody, convex_body
from katana450.extensions.importers.formats.shape_file import MIN_SIZE
from katana450.maths.collision.linkage import GROUND
from katana450.maths.collision.shape import hull
from katana450.maths.collision.world import CollisionWorld
from katana450.maths.geometry import so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.resources import URDF_PATH
from robot_description.cad.build import PARTS
from robot_description.cad.hulls import whole
from tests.conftest import LONG


def check_holds(body: ConvexBody, points: FloatArray) -> None:
    """Check with the planes of another hull: that of trimesh, which uses qhull."""
    assert 4 <= len(body.corners) <= MAX_CORNERS
    mesh = trimesh.Trimesh(body.corners).convex_hull
    heights = np.einsum("ij,ij->i", mesh.face_normals, mesh.triangles[:, 0])
    assert (points @ mesh.face_normals.T - heights).max() <= 1e-6 * np.ptp(points, axis=0).max()
    # It has a volume.
    hull(body.corners)


@given(
    st.integers(4, 300),
    st.integers(0, 2**32 - 1),
    st.tuples(*(st.sampled_from((0.0, 1e-4, 0.01, 0.3, 1.0)),) * 3).filter(any),
    st.floats(0.01, 100.0),
)
@settings(max_examples=25 if LONG else 12)
def test_random_points_are_contained(
    count: int, seed: int, stretch: tuple[float, ...], scale: float
) -> None:
    random = np.random.default_rng(seed)
    points = random.normal(size=(count, 3)) * stretch * scale
    # Smaller objects are refused before a body is made of them.
    assume(np.ptp(points, axis=0).max() >= MIN_SIZE)
    points = points @ so3.exp(random.normal(size=3)).T + random.normal(size=3)
    check_holds(convex_body(points), points)


@pytest.mark.parametrize("count", [300, pytest.param(30_000, marks=pytest.mark.long)])
def test_points_on_a_sphere_are_contained(count: int) -> None:
    """Every point is a corner of the true hull, and there are more than the search takes."""
    points = np.random.default_rng(3).normal(size=(count, 3))
    points = 0.1 * points / np.linalg.norm(points, axis=1, keepdims=True)
    body = convex_body(points)
    check_holds(body, points)
    assert body.off < 0.02
    assert body.volume == pytest.approx(4.0 / 3.0 * np.pi * 0.1**3, rel=0.07)


def test_a_box_of_many_triangles_is_a_box() -> None:
    box = trimesh.creation.box((0.1, 0.2, 0.3)).subdivide().subdivide()
    points = box.vertices @ so3.exp((0.3, -0.2, 0.5)).T
    body = convex_body(points)
    check_holds(body, points)
    assert len(body.corners) == 8
    assert body.off == 0.0
    assert not body.thickened
    assert body.volume == pytest.approx(0.006, rel=1e-9)


@pytest.mark.parametrize(
    ("mesh", "max_excess"),
    [
        (trimesh.creation.icosphere(3, radius=0.05), 0.1 * 0.05),
        (trimesh.creation.cylinder(0.05, 0.2, sections=64), 0.02 * 0.05),
        (trimesh.creation.torus(0.1, 0.03, 40, 30), 0.1 * 0.13),
    ],
    ids=["ball", "cylinder", "ring"],
)
def test_round_mesh_has_a_small_excess(mesh: trimesh.Trimesh, max_excess: float) -> None:
    body = convex_body(mesh.vertices)
    check_holds(body, mesh.vertices)
    assert 0.0 < body.off < max_excess
    assert body.volume == pytest.approx(mesh.convex_hull.volume, rel=0.02)
    # The excess is measured again with the hull of trimesh.
    true = mesh.convex_hull
    heights = np.einsum("ij,ij->i", true.face_normals, true.triangles[:, 0])
    assert (body.corners @ true.face_normals.T - heights).max() >= body.off - 1e-9


@pytest.mark.parametrize("flat", [(1.0, 1.0, 0.0), (1.0, 0.0, 0.0)], ids=["sheet", "wire"])
def test_flat_mesh_is_thickened(flat: tuple[float, ...]) -> None:
    points = np.random.default_rng(0).uniform(-1.0, 1.0, (50, 3)) * flat
    body = convex_body(points @ so3.exp((0.3, 0.4, 0.5)).T)
    assert body.thickened
    spread = np.linalg.svd(body.corners - body.corners.mean(axis=0))[1]
    assert spread[-1] > 0.1 * MIN_THICKNESS_FRACTION


@pytest.mark.parametrize("points", [np.zeros((0, 3)), np.ones((7, 3)), [[np.nan, 0.0, 0.0]]])
def test_invalid_body_is_refused(points: FloatArray) -> None:
    with pytest.raises(InputError):
        convex_body(points)


ROUNDING = 1e-3  # mm
LOOK = 30.0  # mm


@functools.cache
def solid(link: str) -> Manifold:
    """Return the solid of ``link``, in mm."""
    return whole(next(make() for make in PARTS if make.__name__ == link))


def placed(world: CollisionWorld, number: int, T_base_mover: FloatArray) -> Manifold:
    part = world.parts[number]
    T = T_base_mover[part.mover] @ part.T_mover_shape[0]
    T[:3, 3] *= 1e3
    return solid(part.name).transform(T[:3])


def test_no_solids_touch_where_the_bodies_are_clear(
    bare: CollisionWorld, limits: tuple[FloatArray, FloatArray]
) -> None:
    rng = np.random.default_rng(11)
    looked_at = 0
    while looked_at < (40 if LONG else 8):
        x = rng.uniform(*limits)
        contact = bare.nearest(x)
        assert contact is not None
        if not 0.0 < contact.distance < 1e-3 * LOOK:
            continue
        looked_at += 1
        T = bare.linkage.poses(x)
        posed = bare.at(x)
        pairs, _ = posed.nearer_than(1e-3 * LOOK)
        parts = {
            (int(bare.part_of[bare.first[pair]]), int(bare.part_of[bare.second[pair]]))
            for pair in pairs.tolist()
        }
        for a, b in parts:
            gap = placed(bare, a, T).min_gap(placed(bare, b, T), LOOK)
            assert gap >= 1e3 * contact.distance - ROUNDING


def test_poses_agree_with_the_description(
    robot: Robot, bare: CollisionWorld, postures: FloatArray
) -> None:
    urdf = yourdfpy.URDF.load(str(URDF_PATH), load_meshes=False)
    for x in postures[:20]:
        urdf.update_cfg(robot.joint_values(x[:-1], float(x[-1])))
        T = bare.linkage.poses(x)
        for part in bare.parts:
            expected = urdf.get_transform(part.name, "base_link")
            np.testing.assert_allclose(T[part.mover] @ part.T_mover_shape[0], expected, atol=1e-12)


def test_variables_between_two_groups(bare: CollisionWorld) -> None:
    mover = {part.name: part.mover for part in bare.parts}

    def between(a: str, b: str) -> frozenset[int]:
        return bare.linkage.variables_between(mover[a], mover[b])

    assert mover["base_link"] == mover["arm_base_link"] == GROUND
    assert between("base_link", "arm_base_link") == frozenset()
    assert between("pan_link", "wrist_link") == {1, 2, 3}
    assert between("wrist_link", "pan_link") == {1, 2, 3}
    assert between("roll_link", "gripper_link") == frozenset()
    # One slider drives both fingers.
    assert between("finger_left_link", "finger_right_link") == {5}
