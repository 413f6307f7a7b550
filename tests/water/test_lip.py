"""The flow over the lip: its laws, their limits, and the volume that is left."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from katana450.extensions.programs.steps.pouring import flow_at, spill_tilt, tilt_for
from katana450.maths.water.flow import WaterFlow
from katana450.maths.water.lip import DISCHARGE, left_over, viscous_flow, weir_flow
from katana450.maths.water.units import DENSITY, GRAVITY, MILLILITRE, ML, VISCOSITY
from tests.geometry.strategies import repeatable

RADIUS, TILT, HEAD = 0.03, 1.0, 0.002


def along_the_lip(rule: float, power: float) -> float:
    """Return the flow [m^3/s] by quadrature: ``rule`` times the local head to ``power``."""
    x = (np.arange(200_000) + 0.5) * (RADIUS / 200_000)
    height = np.maximum(HEAD - x**2 * np.sin(TILT) / (2.0 * RADIUS), 0.0)
    return 2.0 * RADIUS * rule * float((height**power).mean())


def test_flows_are_the_integrals_over_the_lip() -> None:
    weir = along_the_lip(2.0 / 3.0 * DISCHARGE * np.sqrt(2.0 * GRAVITY), 1.5)
    assert weir_flow(RADIUS, TILT, HEAD, GRAVITY) == pytest.approx(weir, rel=1e-4)
    film = along_the_lip(DENSITY * GRAVITY / (3.0 * VISCOSITY), 3.0)
    assert viscous_flow(RADIUS, TILT, HEAD, GRAVITY) == pytest.approx(film, rel=1e-4)


@repeatable
@given(st.floats(1e-8, 1e-4), st.floats(1e-8, 1e-4), st.integers(1, 40))
def test_many_steps_leave_what_one_leaves(weir: float, viscous: float, count: int) -> None:
    """One of the two laws holds alone, and its flow falls with the volume."""
    start, dt = 20 * MILLILITRE, 0.01
    for flows, power in (((weir, 1e3), 2.0), ((1e3, viscous), 3.5)):
        once = left_over(start, *flows, count * dt)
        left = start
        for _ in range(count):
            fallen = (left / start) ** power
            if left:
                left = left_over(left, flows[0] * fallen, flows[1] * fallen, dt)
        assert left == pytest.approx(once, rel=1e-6, abs=MILLILITRE // 10)


@repeatable
@given(st.floats(0.1, 20.0), st.floats(20.0, 220.0))
def test_tilt_for_a_flow_has_that_flow(flow: WaterFlow, rate: float, volume: float) -> None:
    cup = flow.water_environment.cup.inside
    tilt = tilt_for(rate * ML, volume * ML, cup)
    assert flow_at(tilt, volume * ML, cup) == pytest.approx(rate * ML, rel=1e-5)
    assert tilt > spill_tilt(cup, volume * ML) - 1e-9
