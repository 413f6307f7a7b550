"""The swing of the surface, against its equation in very small steps."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.water.cylinder import Cylinder
from katana450.maths.water.slosh import FIRST_MODE, REST_TOLERANCE, Slosh, damping, frequency
from katana450.maths.water.units import GRAVITY
from tests.geometry.strategies import repeatable
from tests.water.motions import steady_acceleration

CUP = Cylinder(0.03, 0.087)
ZETA = damping(CUP)
"""Damping [1] of water."""

numbers = st.floats(-3.0, 3.0)
vectors = st.tuples(numbers, numbers, numbers)
pairs = st.tuples(numbers, numbers)
sloshes = st.builds(Slosh, pairs, pairs)


def apart(a: Slosh, b: Slosh) -> float:
    return float(np.abs(np.array([*a.up, *a.rate]) - [*b.up, *b.rate]).max())


@repeatable
@given(sloshes, vectors, st.floats(2.0, 30.0), st.floats(0.001, 0.1))
def test_one_long_step_is_many_short_ones(
    slosh: Slosh, acceleration: tuple[float, float, float], omega: float, dt: float
) -> None:
    whole = slosh.after(acceleration, omega, ZETA, dt)
    halves = slosh.after(acceleration, omega, ZETA, 0.5 * dt).after(
        acceleration, omega, ZETA, 0.5 * dt
    )
    assert apart(whole, halves) < 2.0 * REST_TOLERANCE * omega
    # The equation itself, by Runge's midpoint rule.
    rest = np.array(acceleration[:2]) / GRAVITY
    x, v = np.array(slosh.lean), np.array(slosh.rate)

    def pulled(x: FloatArray, v: FloatArray) -> FloatArray:
        return -(omega**2) * (x - rest) - 2.0 * ZETA * omega * v

    n = 200
    h = dt / n
    for _ in range(n):
        xm, vm = x + 0.5 * h * v, v + 0.5 * h * pulled(x, v)
        x, v = x + h * vm, v + h * pulled(xm, vm)
    assert np.allclose(whole.lean, x, atol=2e-3)
    assert np.allclose(whole.rate, v, atol=2e-3 * omega)


def test_surface_swings_to_nearly_twice_the_lean_and_comes_to_rest() -> None:
    omega = frequency(CUP, 2e-4)
    slosh, leans = Slosh(), []
    for _ in range(4000):
        slosh = slosh.after((2.0, 0.0, 0.0), omega, ZETA, 0.01)
        leans.append(slosh.up[0] * GRAVITY / 2.0)
    assert max(leans) == pytest.approx(1.0 + math.exp(-math.pi * ZETA), abs=0.01)
    assert slosh == Slosh((2.0 / GRAVITY, 0.0))


def test_vertical_acceleration_acts_at_once() -> None:
    slosh = Slosh().after((0.0, 0.0, -GRAVITY), 24.0, ZETA, 0.01)
    assert slosh == Slosh(weight=0.0)
    assert Slosh().after((0.0, 0.0, 3.0), 24.0, ZETA, 0.01).up == (0.0, 0.0, 1.0 + 3.0 / GRAVITY)


@pytest.mark.parametrize("dt", [1e-6, 0.05, 10.0, 1e4])
def test_slosh_is_stable_for_any_step(dt: float) -> None:
    slosh = Slosh((1.0, -0.5), (3.0, 0.0))
    for _ in range(50):
        slosh = slosh.after((0.0, 0.0, 0.0), 24.0, ZETA, dt)
        assert math.hypot(*slosh.up, *slosh.rate) < 40.0


def test_frequency_agrees_with_the_literature() -> None:
    k = FIRST_MODE / CUP.radius
    deep = math.sqrt(GRAVITY * k)
    assert frequency(CUP, CUP.capacity) == pytest.approx(deep, rel=1e-4)
    depth = 0.02
    volume = math.pi * CUP.radius**2 * depth
    assert frequency(CUP, volume) ** 2 == pytest.approx(GRAVITY * k * math.tanh(k * depth))
    assert 0.0 < frequency(CUP, 0.0) < deep


def test_the_first_mode_has_no_flow_through_the_wall() -> None:
    # J1'(x) = (1 / pi) times the integral over a half turn of sin t sin(t - x sin t).
    t = (np.arange(2000) + 0.5) * (math.pi / 2000.0)
    slope = np.mean(np.sin(t) * np.sin(t - FIRST_MODE * np.sin(t)))
    assert abs(slope) < 1e-5


def test_a_steady_acceleration_lifts_the_surface_to_the_rim() -> None:
    for volume in (4e-5, 1.2e-4, 2e-4):
        lean = math.atan2(steady_acceleration(CUP, volume), GRAVITY)
        level = CUP.level(lean, volume)
        assert CUP.margin(lean, level) == pytest.approx(0.0, abs=1e-9)
    # More than half full: g times the ratio of the free height of the wall to the radius.
    free = CUP.depth - 2e-4 / (math.pi * CUP.radius**2)
    assert steady_acceleration(CUP, 2e-4) == pytest.approx(GRAVITY * free / CUP.radius)


def test_damping_is_that_of_the_wall_and_of_the_viscosity() -> None:
    # The viscous part is 0.006, and in proportion to the root of nu.
    assert damping(CUP) == pytest.approx(0.02, abs=5e-4)
