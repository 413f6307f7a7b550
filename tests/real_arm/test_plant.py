"""The simulated plant follows its setpoints with inertia, delay, friction and play, and rests."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from katana450.arm.control.state.arm_report import ArmMode
from katana450.arm.drivers.driver import DriverAnswer
from katana450.arm.robot.loader import load
from katana450.arm.robot.robot import Robot
from katana450.errors import InputError
from katana450.extensions.real_arm.plant.axis import KATANA450, PROFILES, STIFF, PlantAxis
from katana450.extensions.real_arm.plant.driver import GravityLoads, PlantDriver
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.forward import forward

START = np.array([0.0, -1.0, 1.0, 0.5, 0.0])

TICK = 0.01

GANTRY = Path(__file__).parents[1] / "exchange" / "gantry.urdf"


def eased(s: float) -> float:
    s = min(max(s, 0.0), 1.0)
    return s**3 * (10.0 - 15.0 * s + 6.0 * s**2)


def moved(t: float) -> FloatArray:
    """Return a motion of 1 s that respects the limits of the arm."""
    return START + np.array([0.4, 0.2, -0.2, 0.4, 0.4]) * eased(t)


def driven(
    driver: PlantDriver, seconds: float, setpoint: Callable[[float], FloatArray]
) -> list[DriverAnswer]:
    driver.start(0.0)
    ticks = range(1, round(seconds / TICK) + 1)
    return [driver.send(setpoint(n * TICK), 0.0, n * TICK) for n in ticks]


@pytest.mark.parametrize("name", PROFILES)
def test_plant_comes_to_rest_exactly_and_keeps_its_arrays(robot: Robot, name: str) -> None:
    answers = driven(PlantDriver(robot, START, 0.0, PROFILES[name]), 3.0, moved)
    last, before = answers[-1], answers[-20]
    assert last.q is before.q
    assert last.report is not None
    assert before.report is not None
    assert last.report.mode is ArmMode.HOLDING
    assert last.report.expected is before.report.expected
    assert not np.any(last.report.speeds)
    assert np.degrees(np.abs(last.q - moved(9.0)).max()) < 0.15


def test_stiff_plant_follows_its_setpoints(robot: Robot) -> None:
    answers = driven(PlantDriver(robot, START, 0.0, STIFF), 1.2, moved)
    worst = max(np.abs(answer.q - moved((n + 1) * TICK)).max() for n, answer in enumerate(answers))
    assert np.degrees(worst) < 0.01


def test_katana_plant_lags_by_its_delay_and_little_more(robot: Robot) -> None:
    answers = driven(PlantDriver(robot, START, 0.0, KATANA450), 1.2, moved)
    tracked = 0.0
    for n, answer in enumerate(answers, 1):
        assert answer.report is not None
        wanted = moved(n * TICK - KATANA450.delay)
        assert np.allclose(answer.report.expected[:-1], wanted, atol=2e-4)
        tracked = max(tracked, float(np.abs(answer.q - answer.report.expected[:-1]).max()))
    # Far from the 3 degrees at which the session stops the arm.
    assert 0.02 < np.degrees(tracked) < 0.3


def test_stop_brakes_where_the_arm_is_and_is_measured(robot: Robot) -> None:
    driver = PlantDriver(robot, START, 0.0, KATANA450)
    answers = driven(driver, 0.5, moved)
    speed = np.abs(answers[-1].report.speeds).max()  # type: ignore[union-attr,arg-type]
    assert speed > 0.5
    stopped = [driver.send(moved(0.5), 0.0, 0.5 + n * TICK, stopped=True) for n in range(1, 100)]
    report = stopped[-1].report
    assert report is not None
    assert report.measured_stop is not None
    assert 0.02 < report.measured_stop.time < 0.5
    # A constant deceleration would need half the product of speed and time.
    assert 0.2 < report.measured_stop.angle / (speed * report.measured_stop.time) < 0.8
    assert stopped[-1].q is stopped[-20].q
    chain = robot.require_arm().chain
    ends = (forward(chain, q)[:3, 3] for q in (answers[-1].q, stopped[-1].q))
    travel = float(np.linalg.norm(np.subtract(*ends)))
    # From the press on, and not from the last answer before it.
    assert travel > 0.005
    assert report.measured_stop.distance == pytest.approx(travel, abs=2e-3)
    # The session begins again where the arm was measured.
    held = stopped[-1].q
    again = [driver.send(held, 0.0, 1.5 + n * TICK) for n in range(1, 50)]
    assert np.degrees(np.abs(again[-1].q - held).max()) < 0.15


def test_stop_at_rest_measures_nothing(robot: Robot) -> None:
    driver = PlantDriver(robot, START, 0.0, KATANA450)
    driven(driver, 0.2, lambda _t: START)
    answer = driver.send(START, 0.0, 0.3, stopped=True)
    assert answer.report is not None
    assert answer.report.measured_stop is None


def test_setpoints_are_bounded_by_limits_and_speeds(robot: Robot) -> None:
    driver = PlantDriver(robot, START, 0.0, STIFF)
    arm = robot.require_arm()
    driver.start(0.0)
    answer = driver.send(np.full(5, 9.0), 9.0, TICK)
    assert (answer.q - START <= arm.limits.speed * TICK + 1e-9).all()
    answers = driven(PlantDriver(robot, START, 0.0, STIFF), 5.0, lambda _t: np.full(5, 9.0))
    assert np.allclose(answers[-1].q, arm.limits.upper, atol=1e-4)
    with pytest.raises(InputError, match="must be finite"):
        driver.send(np.full(5, math.nan), 0.0, 2 * TICK)
    driver.stop()
    with pytest.raises(InputError, match="not started"):
        driver.send(START, 0.0, 3 * TICK)


def test_short_ticks_without_a_whole_step_lose_no_setpoint(robot: Robot) -> None:
    driver = PlantDriver(robot, START, 0.0, STIFF)
    driven(driver, 1.0, lambda _t: START)
    target = START + 0.001
    driver.send(target, 0.0, 1.001)
    for n in range(1, 30):
        answer = driver.send(target, 0.0, 1.001 + n * TICK)
    assert np.allclose(answer.q, target, atol=1e-5)


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


def test_robot_without_an_arm_has_a_plant_without_weights() -> None:
    gantry = load(GANTRY)
    start = np.zeros(len(gantry.driven))
    driver = PlantDriver(gantry, start, 0.0, KATANA450)
    driver.start(0.0)
    target = np.clip(start + 0.01, gantry.joint_group.lower, gantry.joint_group.upper)
    for n in range(1, 200):
        answer = driver.send(target, 0.0, n * TICK)
    assert np.allclose(answer.q, target, atol=1e-3)
