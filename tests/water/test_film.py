"""The film on the wall, against the profile of Jeffreys and the laws of withdrawal."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from katana450.maths.water.flow import VesselMove, WaterFlow
from katana450.maths.water.lip import LANDAU_LEVICH, drained_film, withdrawn_thickness
from katana450.maths.water.units import (
    DENSITY,
    GRAVITY,
    MILLILITRE,
    REST_FLOW,
    SURFACE_TENSION,
    VISCOSITY,
)
from tests.geometry.strategies import repeatable
from tests.water.motions import over_basin, poured

WIDTH, LENGTH = 0.19, 0.1
"""[m] Wall of the cup, unrolled."""


def film_of_age(age: float) -> float:
    """Return the volume [m^3] of Jeffreys' film by quadrature of its profile."""
    z = (np.arange(20_000) + 0.5) * (LENGTH / 20_000)
    h = np.sqrt(VISCOSITY * z / (DENSITY * GRAVITY * age))
    return float(h.mean()) * WIDTH * LENGTH


@repeatable
@given(st.floats(0.1, 20.0), st.floats(0.0, 100.0))
def test_film_drains_as_the_profile_of_jeffreys(age: float, dt: float) -> None:
    left = drained_film(film_of_age(age), WIDTH, LENGTH, GRAVITY, dt)
    assert left == pytest.approx(film_of_age(age + dt), rel=1e-5)


@repeatable
@given(st.floats(0.1, 10.0), st.lists(st.floats(0.0, 5.0), min_size=1, max_size=5))
def test_many_steps_are_as_one(age: float, steps: list[float]) -> None:
    whole = once = film_of_age(age)
    for dt in steps:
        once = drained_film(once, WIDTH, LENGTH, GRAVITY, dt)
    assert once == pytest.approx(drained_film(whole, WIDTH, LENGTH, GRAVITY, sum(steps)), rel=1e-12)


def test_old_film_rests_and_a_covered_wall_has_none() -> None:
    young, old = 60.0, 90.0
    film = film_of_age(old)
    assert drained_film(film, WIDTH, LENGTH, GRAVITY, 10.0) == film
    assert 0.5 * REST_FLOW < 0.5 * film / old < REST_FLOW
    film = film_of_age(young)
    assert drained_film(film, WIDTH, LENGTH, GRAVITY, 10.0) < film
    assert drained_film(1e-6, WIDTH, 0.0, GRAVITY, 0.01) == 0.0
    assert drained_film(0.0, WIDTH, LENGTH, GRAVITY, 0.01) == 0.0


def test_withdrawal_follows_landau_levich_or_derjaguin() -> None:
    slow, fast = 1e-3, 200.0
    length = math.sqrt(SURFACE_TENSION / (DENSITY * GRAVITY))
    capillary = VISCOSITY * slow / SURFACE_TENSION
    thin = withdrawn_thickness(slow, GRAVITY)
    assert thin == pytest.approx(LANDAU_LEVICH * length * capillary ** (2.0 / 3.0))
    # A millimetre per second leaves less than two micrometres of water.
    assert 1e-6 < thin < 2e-6
    thick = withdrawn_thickness(fast, GRAVITY)
    assert thick == pytest.approx(math.sqrt(VISCOSITY * fast / (DENSITY * GRAVITY)))


def test_film_moves_between_wall_and_cup_without_loss(flow: WaterFlow) -> None:
    water = flow.begin(1.5e-4, over_basin(flow.water_environment, 0.0))
    films = []

    def tilt(t: float) -> float:
        """Tilt for four seconds, then stand again."""
        return min(t, 1.3) if t < 4.0 else max(1.3 - 0.5 * (t - 4.0), 0.0)

    for after in poured(flow, water, tilt, 8.0, 0.02):
        assert after.total == water.total
        assert after.cup.film >= 0
        films.append(after.cup.film / MILLILITRE)
        water = after
    # The cup stands again; the film drains into it.
    assert max(films) > films[-1] > 0.0
    assert films[-1] < films[-20]
    assert flow.film_rests(water.cup) is False


def test_carried_cup_has_no_film(flow: WaterFlow) -> None:
    water = flow.begin(1.5e-4, over_basin(flow.water_environment, 0.0))
    for k in range(100):
        pull = (1.5 * math.sin(0.05 * k), 0.0, 0.0)
        water = flow.step(water, {"cup": VesselMove(water.cup.T, pull)}, 0.01)
    assert water.cup.film == 0
