"""The simulated plant follows its setpoints with inertia, delay, friction and play, and rests."""

from __future__ import annotations

import math

import numpy as np
import pytest

from katana450.arm.robot.robot import Robot
from katana450.extensions.real_arm.plant.axis import KATANA450, PlantAxis
from katana450.extensions.real_arm.plant.loads import GravityLoads


def axis(**changes: float) -> PlantAxis:
    values = {name: getattr(KATANA450, name) for name in KATANA450.__dataclass_fields__} | changes
    return PlantAxis(type(KATANA450)(**values), 0.0, (-2.0, 2.0), 2.0, 2.0)


def test_axis_droops_under_its_weight_by_the_stated_angle() -> None:
    loaded = axis(coulomb=0.0, backlash=0.0, droop=0.001)
    for _ in range(4000):
        loaded.follow(1.0, 0.0, 1.0)
    assert loaded.position == pytest.approx(0.999, abs=1e-6)


def test_play_delays_the_link_when_the_motor_turns_round() -> None:
    loose = axis(backlash=0.02)
    # 0.2 rad up in 1 s, then down again.
    places = [(loose.position, loose.output)]
    for n in range(1, 801):
        up = n <= 400
        target = 0.2 - abs(n - 400) * 0.2 / 400
        loose.follow(target, 0.5 * (1 if up else -1) * 0.4, 0.0)
        places.append((loose.position, loose.output))
    upwards, downwards = places[350], places[750]
    assert upwards[0] - upwards[1] == pytest.approx(0.01)
    assert downwards[0] - downwards[1] == pytest.approx(-0.01)
    top, held = max(places)
    turning = {
        output
        for position, output in places[places.index((top, held)) :]
        if position > top - 0.0199
    }
    assert turning == {held}, "the link waits until the play is used up"


def test_axis_stays_where_friction_holds_it() -> None:
    rough = axis(coulomb=1.0, backlash=0.0)
    reach = 1.0 / KATANA450.bandwidth**2
    assert not rough.follow(0.9 * reach, 0.0, 0.0)
    assert rough.position == 0.0
    assert rough.follow(1.2 * reach, 0.0, 0.0)


def test_weights_follow_the_posture(robot: Robot) -> None:
    loads = GravityLoads(robot)
    stretched = loads.at(np.zeros(5))
    upright = loads.at(np.array([0.0, -math.pi / 2, 0.0, 0.0, 0.0]))
    # Angles grow downwards, so the motors push towards smaller ones.
    assert stretched[1] == pytest.approx(-1.0)
    assert abs(upright[1]) < 0.1
    assert stretched[0] == 0.0
