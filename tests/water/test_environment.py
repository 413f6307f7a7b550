"""Tests of cup and basin: their sizes, and the level and volume of the water in the basin."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from katana450.arm.robot.props import BASIN_AT, load_props, water_environment
from katana450.errors import InputError
from katana450.maths.water.environment import Basin, WaterEnvironment
from tests.geometry.strategies import repeatable

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


def test_basin_without_finite_size_and_place_is_refused(environment: WaterEnvironment) -> None:
    with pytest.raises(InputError, match="depth"):
        replace(environment.basin, depth=math.nan)
    with pytest.raises(InputError, match="stands at"):
        replace(environment.basin, at=(0.2, math.inf, 0.0))
