"""Tests of cup and basin: their sizes, and the level and volume of the water in the basin."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from katana450.arm.robot.props import BASIN_AT, load_props, water_environment
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.water.environment import Basin, WaterEnvironment
from katana450.maths.water.flow import VesselMove, VesselWater, Water, WaterFlow
from katana450.maths.water.units import FEMTOLITRE, MILLILITRE, ML
from tests.geometry.strategies import repeatable
from tests.water.motions import placed

radii = st.floats(0.01, 0.3)
basins = st.builds(
    lambda a, b, depth: Basin((0.0, 0.0, 0.0), 0.004, a, b, depth, max(a, b) + 0.01),
    radii,
    radii,
    st.floats(0.01, 0.2),
)


def test_cup_and_basin_have_the_sizes_of_the_props(environment: WaterEnvironment) -> None:
    props = load_props()
    assert environment.cup.inside.radius == props.cup.inner_radius
    assert environment.cup.floor + environment.cup.inside.depth == pytest.approx(props.cup.height)
    assert environment.basin.rim == pytest.approx(props.basin.height)
    assert environment.basin.radius(0.0) == props.basin.floor_radius < props.basin.inner_radius
    assert environment.basin.at == BASIN_AT
    assert water_environment(props, (0.3, 0.1, 0.0)).basin.at == (0.3, 0.1, 0.0)


@repeatable
@given(basins, st.floats(0.0, 1.0))
def test_basin_level_is_the_inverse_of_its_volume(basin: Basin, fraction: float) -> None:
    level = fraction * basin.depth
    z = (np.arange(2000) + 0.5) / 2000.0 * level
    slice_radii = np.array([basin.radius(height) for height in z])
    integral = float((math.pi * slice_radii**2).mean()) * level
    assert basin.volume(level) == pytest.approx(integral, rel=1e-6, abs=1e-18)
    assert basin.level(basin.volume(level)) == pytest.approx(level, rel=1e-11, abs=1e-15)


def test_nearly_straight_basin_fills_like_a_straight_one(environment: WaterEnvironment) -> None:
    straight = replace(environment.basin, rim_radius=environment.basin.floor_radius)
    nearly_straight = replace(straight, rim_radius=straight.floor_radius * (1.0 + 1e-12))
    assert nearly_straight.level(2e-4) == pytest.approx(straight.level(2e-4), rel=1e-10)


ENVIRONMENT = water_environment(load_props())
GLASS = ENVIRONMENT.cup.sized(0.03, 0.06)
FLOW = WaterFlow(replace(ENVIRONMENT, vessels={"cup": ENVIRONMENT.cup, "glass": GLASS}))


def above_glass(tilt: float) -> FloatArray:
    """Return the pose of a cup that is tilted about its lip, 15 mm before the glass's middle."""
    T = placed(0.0, 0.0, 0.0, tilt)
    lip = T[:3, :3] @ (0.0, -ENVIRONMENT.cup.inside.radius, ENVIRONMENT.cup.mouth)
    T[:3, 3] = (0.3, -0.285, GLASS.mouth + 0.11) - lip
    return T


def with_glass(volume: float, glass: int = 0) -> Water:
    """Return ``volume`` [m^3] in the cup, and ``glass`` [fl] in the glass below its lip."""
    water = FLOW.begin(volume, above_glass(0.0))
    return replace(water, vessels=(water.cup, VesselWater("glass", glass, placed(0.3, -0.3, 0.0))))


def poured(water: Water, final: float, duration: float) -> Water:
    """Tilt the cup over the glass at 0.3 rad/s; check in each step that no water is lost."""
    total = water.total
    for k in range(1, round(duration / 0.01) + 1):
        T = above_glass(min(0.003 * k, final))
        water = FLOW.step(water, {"cup": VesselMove(T)}, 0.01)
        assert water.total == total
    return water


def test_vessel_has_the_form_of_the_cup() -> None:
    cup = ENVIRONMENT.cup
    assert cup.sized(cup.outer_radius, cup.mouth) == cup
    assert GLASS.mouth == pytest.approx(0.06)
    assert GLASS.inside.radius < 0.03 < 1.1 * GLASS.inside.radius


def test_water_lands_in_the_glass_below() -> None:
    water = poured(with_glass(150 * ML), 1.1, 8.0)
    (glass,) = water.others
    assert glass.volume > 50 * MILLILITRE
    assert glass.volume + water.cup.volume == water.total
    level = FLOW.surface(glass).level
    area = math.pi * GLASS.inside.radius**2
    assert level == pytest.approx(glass.volume * FEMTOLITRE / area)


def test_full_glass_spills_what_it_cannot_hold() -> None:
    capacity = round(GLASS.inside.capacity / FEMTOLITRE)
    water = poured(with_glass(150 * ML, capacity - 20 * MILLILITRE), 1.1, 8.0)
    assert 0 <= capacity - water.others[0].volume < 2 * MILLILITRE
    assert water.spilled > 30 * MILLILITRE


def test_lying_glass_catches_nothing_and_runs_empty() -> None:
    water = with_glass(0.0, 50 * MILLILITRE)
    lying = VesselMove(placed(0.3, -0.3, 0.05, 0.6 * math.pi))
    for _ in range(300):
        water = FLOW.step(water, {"glass": lying}, 0.01)
    assert water.others[0].volume < MILLILITRE
    assert water.spilled > 49 * MILLILITRE


@repeatable
@given(
    st.floats(0.0, 2.4e-4),
    st.integers(0, 100 * MILLILITRE),
    st.lists(
        st.tuples(st.floats(-0.05, 0.05), st.floats(0.0, 3.0), st.floats(0.0, 3.0)), max_size=6
    ),
)
def test_no_motion_of_two_vessels_makes_or_loses_water(
    volume: float, glass: int, moves: list[tuple[float, float, float]]
) -> None:
    water = with_glass(volume, glass)
    total = water.total
    for offset, tilt, other in moves:
        T = above_glass(tilt)
        T[0, 3] += offset
        for _ in range(5):
            motions = {"cup": VesselMove(T), "glass": VesselMove(placed(0.3, -0.3, 0.0, other))}
            water = FLOW.step(water, motions, 0.02)
            assert water.total == total
            assert min(vessel.volume for vessel in water.vessels) >= 0
