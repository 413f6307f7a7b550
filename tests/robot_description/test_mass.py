"""Inertials: exact integrals, plausible castings, and the numbers in the URDF."""

from __future__ import annotations

import math
import platform
import sys

import numpy as np
import pytest
import trimesh

from katana450.resources import URDF_PATH
from robot_description.cad.build import parts
from robot_description.cad.mass import (
    DENSITY,
    inertials,
    moments,
    moments_of,
    with_inertials,
)
from robot_description.cad.material import ALUMINIUM, MATERIALS, RUBBER
from robot_description.cad.part import Part
from robot_description.cad.solid import block, lathe, rod


def test_moments_agree_with_an_independent_integral() -> None:
    skew = (lathe([(0.0, 20.0, 2.0), (50.0, 12.0, 1.0)]) - rod(8.0, 10.0, 90.0, "+x")).rotate(
        (20.0, 35.0, 50.0)
    )
    moved = skew.translate((40.0, -25.0, 60.0))
    mesh = moved.to_mesh64()
    points = np.asarray(mesh.vert_properties)[:, :3] * 1e-3
    faces = np.asarray(mesh.tri_verts).astype(np.int64)
    other = trimesh.Trimesh(points, faces, process=False)
    other.density = 2700.0
    integral = moments(moved, 2700.0)
    assert integral.mass == pytest.approx(other.mass, rel=1e-9)
    centre = integral.first / integral.mass
    np.testing.assert_allclose(centre, other.center_mass, atol=1e-9)
    second = integral.second - integral.mass * np.outer(centre, centre)
    inertia = np.trace(second) * np.eye(3) - second
    np.testing.assert_allclose(inertia, other.moment_inertia, rtol=1e-6, atol=1e-12)


def test_overlapping_materials_count_once_as_the_denser() -> None:
    part = Part("overlap")
    part.add(ALUMINIUM, block((0.0, 20.0), (0.0, 10.0), (0.0, 10.0)))
    part.add(RUBBER, block((10.0, 40.0), (0.0, 10.0), (0.0, 10.0)))
    assert moments_of(part).mass == pytest.approx((2.0 * 2700.0 + 2.0 * 1200.0) * 1e-6)


def test_every_material_has_a_density() -> None:
    assert set(DENSITY) == set(MATERIALS)
    assert list(DENSITY.values()) == sorted(DENSITY.values(), reverse=True)


def test_castings_are_hollow_with_plausible_walls() -> None:
    for link, inertia in inertials().items():
        assert 0.25 < inertia.fill <= 1.0, f"{link}: {inertia.fill:.2f} of the solid's weight"


def test_centres_of_mass_lie_within_the_links_and_inertias_are_of_bodies() -> None:
    for part in parts():
        inertia = inertials()[part.link]
        boxes = np.array([solid.bounding_box() for _, solid in part.bodies()]) * 1e-3
        low, high = boxes[:, :3].min(axis=0), boxes[:, 3:].max(axis=0)
        assert (low < inertia.centre).all()
        assert (inertia.centre < high).all()
        smallest, middle, largest = np.linalg.eigvalsh(inertia.inertia)
        assert smallest > 0.0
        assert smallest + middle > largest
        reach = math.sqrt(float(((high - low) ** 2).sum()))
        assert largest < inertia.mass * reach * reach / 4.0


def test_fingers_are_mirror_images() -> None:
    by_link = inertials()
    right, left = by_link["finger_right_link"], by_link["finger_left_link"]
    turn = np.diag([1.0, -1.0, -1.0])
    np.testing.assert_allclose(left.centre, turn @ right.centre, atol=1e-9)
    np.testing.assert_allclose(left.inertia, turn @ right.inertia @ turn, atol=1e-12)


def test_the_urdf_holds_what_the_solids_give() -> None:
    if sys.platform != "linux" or platform.machine() != "x86_64":
        pytest.skip("the last digits are those of Linux on x86-64")
    text = URDF_PATH.read_text("utf-8")
    assert with_inertials(text, inertials()) == text, "run python -m robot_description.cad"


def test_a_link_without_inertial_is_named() -> None:
    by_link = {"elbow": inertials()["pan_link"]}
    with pytest.raises(ValueError, match="no <inertial> in link elbow"):
        with_inertials('<link name="elbow"></link><link name="b"><inertial/></link>', by_link)
