"""Water in several vessels: it lands in the one below, flows on, and none is lost."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from katana450.arm.robot.props import load_props, water_environment
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.water.flow import VesselMove, Water, WaterFlow
from katana450.maths.water.units import FEMTOLITRE, MILLILITRE, ML
from tests.geometry.strategies import repeatable
from tests.water.motions import placed

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
    return replace(water, vessels=(water.cup, FLOW.rest("glass", glass, placed(0.3, -0.3, 0.0))))


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
    assert GLASS.wall == pytest.approx(GLASS.inside.wetted(0.0, GLASS.inside.depth))


def test_water_lands_in_the_glass_below() -> None:
    water = poured(with_glass(150 * ML), 1.1, 8.0)
    (glass,) = water.others
    assert glass.volume > 50 * MILLILITRE
    assert glass.volume + water.cup.kept == water.total
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
