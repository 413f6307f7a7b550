"""The build of the design: reproducible bytes, no link through another, errors that help."""

from __future__ import annotations

import functools
import math
import platform
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import yourdfpy
from manifold3d import Manifold

from katana450.resources import URDF_PATH
from robot_description.cad.build import MESHES, PARTS, build
from robot_description.cad.outline import circle, inset, rectangle, rounded
from robot_description.cad.part import Part
from robot_description.cad.shading import shade, weld
from robot_description.cad.solid import Axis, block, lathe, prism, rod

JOINTS = (
    "axis_1",
    "axis_2",
    "axis_3",
    "axis_4",
    "axis_5",
    "finger_right_joint",
    "finger_left_joint",
)


@functools.cache
def solid(link: str) -> Manifold:
    """Return all bodies of ``link`` as one solid, mm."""
    part = next(make() for make in PARTS if make.__name__ == link)
    return functools.reduce(lambda a, b: a + b, (body for _, body in part.bodies()))


@functools.cache
def robot() -> yourdfpy.URDF:
    return yourdfpy.URDF.load(str(URDF_PATH), load_meshes=False)


def test_rebuild_gives_the_committed_bytes(tmp_path: Path) -> None:
    if sys.platform != "linux" or platform.machine() != "x86_64":
        pytest.skip("the committed bytes are those of Linux on x86-64")
    for built in build(tmp_path):
        committed = MESHES / built.path.name
        assert built.path.read_bytes() == committed.read_bytes(), (
            f"{committed} is not what the code makes: run python -m robot_description.cad"
        )


@pytest.mark.parametrize("name", JOINTS)
def test_no_link_cuts_its_neighbour_over_the_joint_range(name: str) -> None:
    joint = robot().joint_map[name]
    offset = tuple(np.zeros(3) if joint.origin is None else joint.origin[:3, 3] * 1e3)
    parent, child = solid(joint.parent), solid(joint.child)
    for angle in np.linspace(joint.limit.lower, joint.limit.upper, 9):
        turned = child.rotate(tuple(np.degrees(angle) * np.asarray(joint.axis)))
        assert (parent ^ turned.translate(offset)).volume() < 1.0, f"at {angle:.2f} rad"


@pytest.mark.parametrize("make", PARTS, ids=lambda make: make.__name__)
def test_each_part_is_connected(make: Callable[[], Part]) -> None:
    assert len(solid(make.__name__).decompose()) == 1


def test_primitives_have_the_volume_of_their_formulas() -> None:
    assert block((0, 2), (0, 3), (0, 4)).volume() == pytest.approx(24.0)
    assert rod(20.0, 0.0, 5.0).volume() == pytest.approx(500.0 * math.pi, rel=0.03)
    cone = lathe([(0.0, 10.0, 0.0), (9.0, 5.0, 0.0)], segments=400)
    assert cone.volume() == pytest.approx(math.pi * 9.0 / 3.0 * (100 + 50 + 25), rel=1e-3)


@pytest.mark.parametrize(
    ("axis", "extent"),
    [
        ("x", (5.0, 0.0, 0.0, 6.0, 2.0, 3.0)),
        ("y", (0.0, 5.0, 0.0, 2.0, 6.0, 3.0)),
        ("z", (0.0, 0.0, 5.0, 2.0, 3.0, 6.0)),
    ],
)
def test_prism_stands_along_its_axis(axis: Axis, extent: tuple[float, ...]) -> None:
    made = prism(rectangle((0, 2), (0, 3)), 5.0, 6.0, 0.2, axis)
    np.testing.assert_allclose(made.bounding_box(), extent, atol=1e-9)
    assert 5.0 < made.volume() < 6.0


def test_fillet_and_edge_that_do_not_fit_are_refused() -> None:
    with pytest.raises(ValueError, match="overlap: make one radius smaller"):
        rounded([(0, 0, 3.0), (4, 0, 3.0), (4, 4, 3.0), (0, 4, 3.0)])
    with pytest.raises(ValueError, match="make the radius smaller"):
        lathe([(0.0, 5.0, 0.0), (9.0, 5.0, 6.0)])
    with pytest.raises(ValueError, match="does not fit this outline"):
        inset(circle(3.0), 3.5)


def test_shading_keeps_a_box_sharp_and_a_cylinder_smooth() -> None:
    for made, sharp in ((block((0, 1), (0, 1), (0, 1)), True), (rod(20.0, 0.0, 9.0), False)):
        mesh = made.to_mesh64()
        corners = np.asarray(mesh.vert_properties)
        triangles = np.asarray(mesh.tri_verts).astype(np.int64)
        positions, normals, _ = shade(*weld(corners, triangles))
        np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0, atol=1e-4)
        if sharp:
            assert len(positions) == 24
            assert np.abs(normals).max(axis=1) == pytest.approx(1.0)
        else:
            side = np.abs(normals[:, 2]) < 0.5
            radial = positions[side, :2] / 10.0
            np.testing.assert_allclose(normals[side, :2], radial, atol=1e-4)
            assert len(positions) == 2 * len(corners)
