"""Carrying, spilling, pouring and stopping: no water is lost, and it lands in the right places."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from katana450.errors import InputError
from katana450.extensions.programs.steps.pouring import flow_at, tilt_for
from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.water.environment import Basin, WaterEnvironment
from katana450.maths.water.flow import (
    DISCHARGE,
    DROP_VOLUME,
    VesselMove,
    Water,
    WaterFlow,
    left_over,
    weir_flow,
)
from katana450.maths.water.parcel import Parcel
from katana450.maths.water.units import (
    FEMTOLITRE,
    GRAVITY,
    MILLILITRE,
    ML,
    counted,
)
from katana450.maths.water.vectors import Vector
from tests.conftest import LONG
from tests.geometry.strategies import points, repeatable, rotation_vectors
from tests.water.motions import (
    carried,
    over_basin,
    placed,
    poured,
    spill_tilt,
    steady_acceleration,
    turned_to,
)

FULL = 2e-4
"""A filling [m^3]."""

Motion = tuple[FloatArray, Vector, FloatArray, float]
"""A rotation vector, a place, an acceleration and a time."""

moves = st.lists(
    st.tuples(
        rotation_vectors,
        st.tuples(st.floats(-0.3, 0.8), st.floats(-0.8, 0.8), st.floats(-0.1, 0.6)),
        points.map(lambda p: 8.0 * p),
        st.sampled_from([0.0, 0.001, 0.01, 0.02, 0.05]),
    ),
    min_size=1,
    max_size=40,
)


def checked(before: Water, after: Water, flow: WaterFlow) -> None:
    assert after.total == before.total
    assert min(after.cup.volume, after.basin) >= 0
    assert all(parcel.volume > 0 for parcel in after.parcels)
    assert all(puddle.volume > 0 for puddle in after.puddles)
    assert after.cup.volume <= counted(flow.water_environment.cup.inside.capacity)
    assert after.basin <= counted(flow.water_environment.basin.capacity)


@repeatable
@given(st.floats(0.0, 2.4e-4), moves)
def test_no_motion_makes_or_loses_water(
    flow: WaterFlow, volume: float, moves: list[Motion]
) -> None:
    water = flow.begin(volume, placed(0.3, 0.0, 0.2))
    assert abs(water.total * FEMTOLITRE - volume) <= FEMTOLITRE + 1e-9 * volume
    for turn, place, acceleration, dt in moves:
        T = se3.from_rotation_translation(so3.exp(turn), place)
        after = flow.step(water, {"cup": VesselMove(T, acceleration)}, dt)
        checked(water, after, flow)
        water = after


@settings(repeatable, max_examples=25 if LONG else 10)
@given(st.floats(0.5, 6.0), st.floats(0.0, math.pi), st.sampled_from([0.01, 0.05]))
def test_tilted_cup_keeps_its_capacity_and_the_basin_catches_the_rest(
    flow: WaterFlow, rate: float, final: float, dt: float
) -> None:
    water = flow.begin(FULL, over_basin(flow.water_environment, 0.0))
    for after in poured(flow, water, turned_to(final, rate), final / rate + 3.5, dt):
        checked(water, after, flow)
        assert after.cup.volume <= water.cup.volume
        water = after
    over = water.cup.volume - counted(flow.water_environment.cup.inside.holds(final))
    # At the lip hangs less than a drop.
    assert over < DROP_VOLUME
    assert over >= 0 or water.cup.volume == counted(FULL)
    assert water.spilled == 0


def test_stopped_pour_flows_down_to_the_lip(flow: WaterFlow) -> None:
    tilt = math.radians(65.0)
    water = flow.begin(FULL, over_basin(flow.water_environment, 0.0))
    runs = list(poured(flow, water, turned_to(tilt, 1.0), 8.0, 0.01))
    at_stop = round(tilt / 0.01)
    held = counted(flow.water_environment.cup.inside.holds(tilt))
    # The flow continues while the arm rests, ever more slowly, and ends within two seconds.
    flowing = [a.cup.volume - b.cup.volume for a, b in pairwise(runs[at_stop:])]
    assert flowing[0] > 0
    assert all(a >= b for a, b in pairwise(flowing[:100]))
    after = runs[at_stop + 200]
    assert 0 <= after.cup.volume - held < DROP_VOLUME
    assert after.parcels == ()
    assert flow.margin_to_rim(after.cup) == pytest.approx(0.0, abs=2e-5)
    last = runs[-1]
    assert 0 <= last.cup.volume - held < DROP_VOLUME
    assert (last.basin, last.spilled) == (last.total - last.cup.volume, 0)


def test_the_size_of_the_steps_hardly_matters(flow: WaterFlow) -> None:
    left = []
    for dt in (0.0025, 0.01, 0.05):
        water = flow.begin(FULL, over_basin(flow.water_environment, 0.0))
        *_, water = poured(flow, water, turned_to(2.0, 1.0), 1.2, dt)
        left.append(water.cup.volume / MILLILITRE)
    assert left == pytest.approx([left[0]] * 3, abs=6.0)


def carry(flow: WaterFlow, distance: float, duration: float) -> tuple[Water, float]:
    water, least = flow.begin(FULL, placed(0.2, -0.3, 0.15)), math.inf
    for T, acceleration in carried(0.2, distance, duration, 0.01):
        water = flow.step(water, {"cup": VesselMove(T, acceleration)}, 0.01)
        least = min(least, flow.margin_to_rim(water.cup))
    for _ in range(200):
        water = flow.step(water, {"cup": VesselMove(water.cup.T)}, 0.01)
        least = min(least, flow.margin_to_rim(water.cup))
    return water, least


def test_a_smooth_carry_spills_nothing_and_a_hasty_one_does(flow: WaterFlow) -> None:
    water, least = carry(flow, 0.4, 2.0)
    assert (water.cup.volume, water.spilled) == (water.total, 0)
    at_rest = flow.water_environment.cup.inside.depth - FULL / (
        math.pi * flow.water_environment.cup.inside.radius**2
    )
    assert 0.7 * at_rest < least < at_rest
    water, least = carry(flow, 0.4, 0.45)
    assert least < 0.0
    assert water.spilled > MILLILITRE
    assert water.cup.volume + water.spilled == water.total


def test_the_steady_acceleration_is_where_spilling_begins(flow: WaterFlow) -> None:
    T = placed(0.2, -0.3, 0.15)
    limit = steady_acceleration(flow.water_environment.cup.inside, FULL)
    for fraction, spills in ((0.98, False), (1.02, True)):
        water = flow.begin(FULL, T)
        # The acceleration rises slowly, over many swings.
        for k in range(3000):
            pull = fraction * limit * min(k / 2500.0, 1.0)
            water = flow.step(water, {"cup": VesselMove(T, (0.0, pull, 0.0))}, 0.01)
        assert (water.spilled > 0) is spills


def test_the_surface_leans_against_the_acceleration(flow: WaterFlow) -> None:
    water = flow.begin(1e-4, placed(0.2, -0.3, 0.15))
    upright = flow.surface(water.cup)
    assert upright.tilt == 0.0
    assert upright.level == pytest.approx(
        1e-4 / (math.pi * flow.water_environment.cup.inside.radius**2)
    )
    for _ in range(3000):
        water = flow.step(water, {"cup": VesselMove(water.cup.T, (1.0, 0.0, 0.0))}, 0.01)
    surface = flow.surface(water.cup)
    # In a cup that is pulled to +x, the water rises on the other side.
    assert surface.downhill == pytest.approx((-1.0, 0.0, 0.0), abs=1e-6)
    assert surface.tilt == pytest.approx(math.atan2(1.0, 9.81), abs=1e-6)


def test_water_leaves_with_the_velocity_of_the_lip(flow: WaterFlow) -> None:
    T = placed(0.2, -0.3, 0.3, math.radians(80.0))
    water = flow.begin(1.5e-4, T)
    moved = T.copy()
    moved[0, 3] += 0.005
    water = flow.step(water, {"cup": VesselMove(moved)}, 0.01)
    (parcel,) = water.parcels
    lip = moved[:3, :3] @ (0.0, -0.03, 0.09) + moved[:3, 3]
    assert parcel.start == pytest.approx(tuple(lip))
    assert parcel.velocity[0] == pytest.approx(0.5)
    assert parcel.velocity[1] < 0.0
    assert parcel.velocity[2] == pytest.approx(0.0, abs=1e-9)
    again = flow.step(water, {"cup": VesselMove(moved)}, 0.01)
    assert again.parcels[0] == parcel._replace(age=0.01)


def test_the_cup_catches_what_falls_into_its_mouth(flow: WaterFlow) -> None:
    water = flow.begin(1e-4, placed(0.2, -0.3, 0.1))
    drop = Parcel(MILLILITRE, (0.21, -0.3, 0.192), (0.0, 0.0, -1.0), 0.0, 0.01)
    for offset, caught in ((0.0, True), (0.03, False)):
        start = (0.21 + offset, -0.3, 0.192)
        flying = Water(water.vessels, parcels=(drop._replace(start=start),))
        after = flow.step(flying, {"cup": VesselMove(water.cup.T)}, 0.01)
        assert (after.cup.volume == water.cup.volume + MILLILITRE) is caught
        checked(flying, after, flow)


def test_a_full_basin_spills_onto_the_table(environment: WaterEnvironment) -> None:
    small = Basin(environment.basin.at, 0.004, 0.04, 0.05, 0.01, 0.06)
    flow = WaterFlow(WaterEnvironment(environment.vessels, small, environment.table))
    water = flow.begin(FULL, over_basin(flow.water_environment, 0.0))
    *_, water = poured(flow, water, turned_to(2.0, 1.0), 4.0, 0.01)
    assert water.basin == counted(small.capacity)
    assert water.basin + water.spilled + water.cup.volume == water.total
    x, y, _ = small.at
    for puddle in water.puddles:
        assert math.hypot(puddle.at[0] - x, puddle.at[1] - y) < 0.08


def test_water_stays_in_free_fall_but_not_upside_down(flow: WaterFlow) -> None:
    T = placed(0.2, -0.3, 0.3)
    water = flow.begin(FULL, T)
    for _ in range(400):
        water = flow.step(water, {"cup": VesselMove(T, (0.0, 0.0, -9.81))}, 0.01)
    assert water.cup.volume == water.total
    *_, water = poured(flow, water, lambda _: math.pi, 3.0, 0.01)
    assert water.cup.volume < MILLILITRE


def test_step_of_zero_time_only_moves_the_cup(flow: WaterFlow) -> None:
    water = flow.begin(FULL, placed(0.2, -0.3, 0.15))
    after = flow.step(water, {"cup": VesselMove(placed(0.3, -0.3, 0.15, 2.0))}, 0.0)
    assert after.cup.volume == water.cup.volume
    assert after.cup.T[0, 3] == 0.3


def test_the_puddles_stay_few(flow: WaterFlow) -> None:
    water = flow.begin(2.4e-4, placed(-0.2, -0.5, 0.2, 0.3))
    for k in range(600):
        T = placed(-0.2 + k * 1.5e-3, -0.5, 0.2, 0.3 + k * 3e-3)
        after = flow.step(water, {"cup": VesselMove(T)}, 0.01)
        checked(water, after, flow)
        water = after
    assert 4 <= len(water.puddles) <= 8


def test_overfull_cup_is_refused(flow: WaterFlow) -> None:
    for volume in (-1e-6, 1e-3, math.nan):
        with pytest.raises(InputError, match="ml"):
            flow.begin(volume, np.eye(4))


RADIUS, TILT, HEAD = 0.03, 1.0, 0.002


def test_flow_is_the_integral_over_the_lip() -> None:
    rule = 2.0 / 3.0 * DISCHARGE * np.sqrt(2.0 * GRAVITY)
    x = (np.arange(200_000) + 0.5) * (RADIUS / 200_000)
    head = np.maximum(HEAD - x**2 * np.sin(TILT) / (2.0 * RADIUS), 0.0)
    weir = 2.0 * RADIUS * rule * float((head**1.5).mean())
    assert weir_flow(RADIUS, TILT, HEAD, GRAVITY) == pytest.approx(weir, rel=1e-4)


@repeatable
@given(st.floats(1e-8, 1e-4), st.integers(1, 40))
def test_many_steps_leave_what_one_leaves(weir: float, count: int) -> None:
    """The flow falls with the square of the volume."""
    start, dt = 20 * MILLILITRE, 0.01
    once = left_over(start, weir, count * dt)
    left = start
    for _ in range(count):
        if left:
            left = left_over(left, weir * (left / start) ** 2, dt)
    assert left == pytest.approx(once, rel=1e-6, abs=MILLILITRE // 10)


@repeatable
@given(st.floats(0.1, 20.0), st.floats(20.0, 220.0))
def test_tilt_for_a_flow_has_that_flow(flow: WaterFlow, rate: float, volume: float) -> None:
    cup = flow.water_environment.cup.inside
    tilt = tilt_for(rate * ML, volume * ML, cup)
    assert flow_at(tilt, volume * ML, cup) == pytest.approx(rate * ML, rel=1e-5)
    assert tilt > spill_tilt(cup, volume * ML) - 1e-9
