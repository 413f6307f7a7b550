"""The volume below a plane, against quadrature and against general properties of volumes."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from katana450.maths.water.cylinder import Cylinder
from tests.geometry.strategies import repeatable
from tests.water.motions import spill_tilt

CUP = Cylinder(0.03, 0.087)

tilts = st.one_of(
    st.floats(0.0, math.pi),
    st.sampled_from([0.0, 0.5 * math.pi, math.pi]),
    st.floats(-14.0, -1.0).map(lambda e: 10.0**e),
    st.floats(-14.0, -1.0).map(lambda e: 0.5 * math.pi - 10.0**e),
    st.floats(-14.0, -1.0).map(lambda e: 0.5 * math.pi + 10.0**e),
    st.floats(-14.0, -1.0).map(lambda e: math.pi - 10.0**e),
)
cylinders = st.builds(Cylinder, st.floats(0.005, 0.5), st.floats(0.005, 0.5))
fractions = st.one_of(st.floats(0.0, 1.0), st.floats(-9.0, 0.0).map(lambda e: 10.0**e))


def level_at(cylinder: Cylinder, tilt: float, fraction: float) -> float:
    low, high = cylinder.span(tilt)
    return low + fraction * (high - low)


@repeatable
@given(cylinders, tilts, fractions)
def test_volumes_of_both_sides_add_up(cylinder: Cylinder, tilt: float, fraction: float) -> None:
    level = level_at(cylinder, tilt, fraction)
    # From the other side the plane faces down.
    rest = cylinder.volume(math.pi - tilt, -level)
    up = cylinder.volume(tilt, level)
    assert up + rest == pytest.approx(cylinder.capacity, rel=1e-12)
    # The mirror image in height exchanges floor and rim.
    mirrored = cylinder.volume(math.pi - tilt, level - cylinder.depth * math.cos(tilt))
    assert mirrored == pytest.approx(up, rel=1e-9, abs=1e-13 * cylinder.capacity)


@repeatable
@given(cylinders, tilts, fractions, fractions)
def test_a_higher_plane_has_more_below(c: Cylinder, tilt: float, a: float, b: float) -> None:
    low, high = sorted((level_at(c, tilt, a), level_at(c, tilt, b)))
    more = c.volume(tilt, high) - c.volume(tilt, low)
    assert more >= -1e-14 * c.capacity
    # It never grows faster than the largest cut of the cylinder allows: there are no leaps.
    widest = 2.0 * c.radius * math.hypot(2.0 * c.radius, c.depth)
    assert more <= widest * (high - low) + 1e-13 * c.capacity


@repeatable
@given(cylinders, tilts, fractions)
def test_the_level_of_a_volume_has_that_volume_below(
    cylinder: Cylinder, tilt: float, fraction: float
) -> None:
    volume = fraction * cylinder.capacity
    level = cylinder.level(tilt, volume)
    assert cylinder.volume(tilt, level) == pytest.approx(volume, abs=4e-15 * cylinder.capacity)
    low, high = cylinder.span(tilt)
    assert low <= level <= high


@repeatable
@given(cylinders, st.floats(0.0, math.pi), st.floats(0.05, 0.95))
def test_surface_is_the_derivative_of_the_volume(
    cylinder: Cylinder, tilt: float, fraction: float
) -> None:
    level = level_at(cylinder, tilt, fraction)
    step = 1e-6 * (cylinder.span(tilt)[1] - cylinder.span(tilt)[0])
    grown = cylinder.volume(tilt, level + step) - cylinder.volume(tilt, level - step)
    scale = cylinder.surface(tilt, level)
    widest = 2.0 * cylinder.radius * math.hypot(2.0 * cylinder.radius, cylinder.depth)
    assert grown / (2.0 * step) == pytest.approx(scale, abs=2e-2 * widest)


def test_capacity_at_a_tilt_ends_at_the_lip() -> None:
    assert CUP.holds(0.0) == CUP.capacity
    assert CUP.holds(0.5 * math.pi) == pytest.approx(0.0, abs=1e-20)
    assert CUP.holds(2.0) == CUP.holds(math.pi) == 0.0
    # While the floor is covered, it is the mean of the volumes up to the highest and lowest wall.
    tilt = math.radians(35.0)
    rest = math.pi * CUP.radius**2 * (CUP.depth - CUP.radius * math.tan(tilt))
    assert CUP.holds(tilt) == pytest.approx(rest, rel=1e-13)
    held = [CUP.holds(tilt) for tilt in np.linspace(0.0, math.pi, 200)]
    assert all(a >= b for a, b in pairwise(held))


@repeatable
@given(cylinders, st.floats(0.001, 0.999))
def test_spilling_begins_where_the_capacity_ends(c: Cylinder, fraction: float) -> None:
    volume = fraction * c.capacity
    tilt = spill_tilt(c, volume)
    assert c.holds(tilt) == pytest.approx(volume, rel=1e-9)
    assert c.margin(tilt, c.level(tilt, volume)) == pytest.approx(0.0, abs=1e-9)
