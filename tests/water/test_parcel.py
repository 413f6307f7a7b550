"""Flight and landing, against flights in very small steps."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from katana450.maths.water.environment import WaterEnvironment
from katana450.maths.water.flow import VesselMove, WaterFlow
from katana450.maths.water.parcel import Ground, Parcel, landing
from katana450.maths.water.units import GRAVITY
from tests.geometry.strategies import repeatable

speeds = st.floats(-2.0, 2.0)
velocities = st.tuples(speeds, speeds, speeds)


def test_parcel_flies_on_a_parabola() -> None:
    parcel = Parcel(1, (0.0, 0.0, 1.0), (0.5, 0.0, 2.0), 0.0, 0.01)
    up = 2.0 / GRAVITY
    assert parcel.at(up) == pytest.approx((0.5 * up, 0.0, 1.0 + 2.0 / GRAVITY))
    assert parcel.falls_to(1.0) == pytest.approx(2.0 * up)
    assert parcel.falls_to(1.3) is None
    assert parcel._replace(velocity=(0.0, 0.0, -1.0)).falls_to(1.1) is None


@repeatable
@given(st.tuples(st.floats(-0.2, 0.8), st.floats(-0.6, 0.8), st.floats(0.08, 0.6)), velocities)
def test_landing_agrees_with_small_steps(
    environment: WaterEnvironment,
    start: tuple[float, float, float],
    velocity: tuple[float, float, float],
) -> None:
    basin, table = environment.basin, environment.table
    parcel = Parcel(1, start, velocity, 0.0, 0.01)
    level = 0.01
    end = landing(parcel, environment, level)
    (x, y, z), (u, v, w) = start, velocity
    dt, t, ground, off = 1e-4, 0.0, None, math.inf
    while ground is None:
        before = z
        t += dt
        x, y, z, w = x + u * dt, y + v * dt, z + w * dt - 0.5 * GRAVITY * dt * dt, w - GRAVITY * dt
        if before > basin.rim >= z:
            off = math.hypot(x - basin.at[0], y - basin.at[1]) - basin.rim_radius
        if off < 0.0 and z <= basin.floor + level:
            ground = Ground.BASIN
        elif off >= 0.0 and before > 0.0 >= z:
            edges = (x - table.x[0], table.x[1] - x, y - table.y[0], table.y[1] - y)
            off = min(map(abs, edges)) if off == math.inf else min(abs(off), *map(abs, edges))
            ground = Ground.TABLE if min(edges) >= 0.0 else None
        elif z <= table.floor:
            ground = Ground.FLOOR
    # Small steps do not tell on which side of a border it lands.
    if abs(off) > 1e-3:
        assert end.ground is ground
        assert end.age == pytest.approx(t, abs=2e-4)
        assert end.point == pytest.approx((x, y, z), abs=2e-3)


def test_water_that_leaves_inside_the_basin_stays_there(environment: WaterEnvironment) -> None:
    x, y, _ = environment.basin.at
    dipped = Parcel(1, (x, y, 0.03), (0.1, 0.0, 0.0), 0.0, 0.01)
    assert landing(dipped, environment, 0.01).ground is Ground.BASIN
    moved = dipped._replace(start=(x + 0.2, y, 0.03))
    assert landing(moved, environment, 0.01).ground is Ground.TABLE


def test_water_beside_the_table_lands_on_the_floor(environment: WaterEnvironment) -> None:
    (west, _), floor = environment.table.x, environment.table.floor
    end = landing(Parcel(1, (west - 0.1, 0.0, 0.3), (0.0, 0.0, 0.0), 0.0, 0.01), environment, 0.0)
    assert end.ground is Ground.FLOOR
    assert end.point == pytest.approx((west - 0.1, 0.0, floor))
    assert end.age == pytest.approx(math.sqrt(2.0 * (0.3 - floor) / GRAVITY))
    # The start is below all surfaces.
    sunk = Parcel(1, (west - 0.1, 0.0, -0.4), (0.0, 0.0, -1.0), 0.0, 0.01)
    assert landing(sunk, environment, 0.0) == (Ground.FLOOR, 0.0, (west - 0.1, 0.0, floor))


def test_parcel_lands_in_the_basin_if_its_middle_is_inside_the_rim(
    flow: WaterFlow, environment: WaterEnvironment
) -> None:
    basin = environment.basin
    x, y, _ = basin.at
    for offset, caught in ((0.0, True), (-1e-3, True), (1e-3, False)):
        place = x + (basin.rim_radius + offset if offset else 0.0)
        edge = Parcel(10**11 + 1, (place, y, 0.3), (0.0, 0.0, 0.0), 0.0, 0.01)
        water = replace(flow.begin(0.0, np.eye(4)), parcels=(edge,))
        for _ in range(40):
            water = flow.step(water, {"cup": VesselMove(np.eye(4))}, 0.01)
        assert (water.basin, water.spilled) == (caught * edge.volume, (not caught) * edge.volume)
