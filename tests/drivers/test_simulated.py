"""The simulated arm follows its setpoints, and refuses motions that a real arm cannot do."""

from __future__ import annotations

import numpy as np
import pytest

from katana450.arm.control.arm import ArmModel
from katana450.arm.drivers.driver import SimulatedDriver
from katana450.errors import InputError

START = np.array([0.0, -1.0, 1.0, 0.5, 0.0])


@pytest.fixture
def driver(arm: ArmModel) -> SimulatedDriver:
    driver = SimulatedDriver(arm, START, 0.0)
    driver.start(0.0)
    return driver


def test_setpoint_within_speed_is_followed_exactly(driver: SimulatedDriver) -> None:
    wanted = START + 0.01
    sent = driver.send(wanted, 0.005, 0.01)
    assert np.allclose(sent.q, wanted, atol=1e-15)
    assert sent.gripper == 0.005


def test_leap_is_clipped_to_the_joint_speed(arm: ArmModel, driver: SimulatedDriver) -> None:
    sent = driver.send(START + 1.0, 0.3, 0.01)
    assert np.allclose(sent.q - START, arm.chain.speed * 0.01)
    assert sent.gripper == pytest.approx(arm.gripper.speed * 0.01)


def test_setpoint_is_clipped_to_the_limits(arm: ArmModel, driver: SimulatedDriver) -> None:
    for tick in range(1, 500):
        sent = driver.send(np.full(5, 9.0), 9.0, tick * 0.01)
    assert np.allclose(sent.q, arm.chain.upper)
    assert sent.gripper == arm.gripper.upper


def test_nothing_moves_while_time_runs_back(driver: SimulatedDriver) -> None:
    driver.send(START, 0.0, 1.0)
    sent = driver.send(START + 0.1, 0.0, 0.5)
    assert (sent.q == START).all()


@pytest.mark.parametrize(("q", "gripper"), [(np.full(5, np.nan), 0.0), (START, np.inf)])
def test_non_finite_command_is_refused(
    driver: SimulatedDriver, q: np.ndarray, gripper: float
) -> None:
    with pytest.raises(InputError, match="must be finite"):
        driver.send(q, gripper, 0.01)
    assert (driver.send(START, 0.0, 0.02).q == START).all()


def test_setpoint_before_start_or_after_stop_is_refused(arm: ArmModel) -> None:
    driver = SimulatedDriver(arm, START, 0.0)
    with pytest.raises(InputError, match="is not started"):
        driver.send(START, 0.0, 0.0)
    driver.start(0.0)
    driver.stop()
    driver.stop()
    with pytest.raises(InputError, match="is not started"):
        driver.send(START, 0.0, 0.0)
