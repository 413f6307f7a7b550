"""The meshes are closed, seen from outside, and contain the right amount of water."""

from __future__ import annotations

import math

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.water.cylinder import Cylinder
from katana450.maths.water.flow import WaterFlow, WaterSurface
from katana450.maths.water.parcel import Parcel, landing
from katana450.maths.water.surface import (
    BODY_FACES,
    SIDES,
    STREAM_FACES,
    Faces,
    body,
    disc,
    stream,
)
from tests.geometry.strategies import repeatable
from tests.water.motions import over_basin, poured, turned_to

CUP = Cylinder(0.03, 0.087)
NOTHING = 1e-12
"""Tolerance [m] for coincident corners."""


def closed(corners: FloatArray, faces: Faces) -> trimesh.Trimesh:
    """Return the mesh with coincident corners merged, and without faces of zero area."""
    mesh = trimesh.Trimesh(corners, faces, process=False)
    mesh.merge_vertices(merge_tex=True, merge_norm=True)
    mesh.update_faces(mesh.nondegenerate_faces(height=1e-9))
    mesh.remove_unreferenced_vertices()
    return mesh


@repeatable
@given(
    st.one_of(st.floats(0.0, math.pi), st.sampled_from([0.0, 0.5 * math.pi, math.pi])),
    st.floats(0.02, 0.98),
    st.floats(0.0, math.tau),
)
def test_body_has_the_volume_of_the_water(tilt: float, fraction: float, turn: float) -> None:
    volume = fraction * CUP.capacity
    surface = WaterSurface(tilt, CUP.level(tilt, volume), (math.cos(turn), math.sin(turn), 0.0))
    corners = body(CUP, surface)
    mesh = trimesh.Trimesh(corners, BODY_FACES, process=False)
    # Twenty chords for half an arc: up to half a percent less than the circle.
    assert mesh.volume == pytest.approx(volume, rel=0.012, abs=2e-3 * CUP.capacity)
    # All of it is in the cup and under the plane.
    normal = np.array((*(-math.sin(tilt) * np.array(surface.downhill[:2])), math.cos(tilt)))
    assert (corners @ normal).max() <= surface.level + 1e-9
    assert np.hypot(corners[:, 0], corners[:, 1]).max() <= CUP.radius + 1e-12
    assert -1e-12 <= corners[:, 2].min() <= corners[:, 2].max() <= CUP.depth + 1e-12


@pytest.mark.parametrize("degrees", [0.0, 20.0, 50.0, 75.0, 89.9, 90.0, 100.0, 150.0, 180.0])
def test_the_body_is_closed(degrees: float) -> None:
    tilt = math.radians(degrees)
    for fraction in (0.05, 0.4, 0.9):
        level = CUP.level(tilt, fraction * CUP.capacity)
        assert closed(
            body(CUP, WaterSurface(tilt, level, (1.0, 0.0, 0.0))), BODY_FACES
        ).is_watertight


def test_the_stream_runs_from_the_lip_to_the_water(flow: WaterFlow) -> None:
    water = flow.begin(2e-4, over_basin(flow.water_environment, 0.0))
    *_, water = poured(flow, water, turned_to(2.0, 1.0), 1.2, 0.01)
    end = landing(water.parcels[0], flow.water_environment, 0.0)
    corners = stream(water.parcels, 0.03, end.age)
    assert np.isfinite(corners).all()
    rings = corners.reshape(-1, SIDES, 3)
    middles = rings.mean(axis=1)
    assert middles[0] == pytest.approx(water.parcels[-1].start, abs=1e-9)
    assert middles[-1, 2] == pytest.approx(end.point[2], abs=0.012)
    # A falling stream gets thinner, and its ends are closed.
    spread = np.linalg.norm(rings - middles[:, None], axis=2).max(axis=1)
    assert max(spread[0], spread[-1]) < NOTHING
    assert spread[2] > 1.5 * spread[-2] > 0.0
    mesh = closed(corners, STREAM_FACES)
    assert mesh.is_watertight
    # About as much water as flies: the sheet at the lip is thinner than a jet would be.
    assert 0.5 * water.air * 1e-18 < mesh.volume < 1.1 * water.air * 1e-18


def test_interrupted_stream_has_zero_width_there() -> None:
    def parcel(age: float) -> Parcel:
        return Parcel(10**12, (0.0, 0.0, 1.0), (0.3, 0.0, 0.0), age, 0.01)

    ages = [*np.arange(0.3, 0.2, -0.01), *np.arange(0.1, 0.0, -0.01)]
    corners = stream([parcel(age) for age in ages], 0.03, 1.0).reshape(-1, SIDES, 3)
    middle = corners.mean(axis=1)
    spread = np.linalg.norm(corners - middle[:, None], axis=2).max(axis=1)
    age = middle[:, 0] / 0.3
    assert (spread[(age > 0.115) & (age < 0.205)] < NOTHING).all()
    assert (spread[1:-1][(age[1:-1] < 0.1) | (age[1:-1] > 0.21)] > 0.0).all()


def test_disc_has_its_stated_size() -> None:
    assert trimesh.Trimesh(*disc(), process=False).area == pytest.approx(math.pi, rel=0.005)
