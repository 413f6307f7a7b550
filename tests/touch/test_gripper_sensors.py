"""The 16 sensor values: their order in the answer of the controller, and their curves."""

from __future__ import annotations

from dataclasses import replace

import pytest

from katana450.arm.control.arm_report import ArmMode, ArmReport
from katana450.arm.control.state import State
from katana450.errors import InputError
from katana450.extensions.touch.gripper_sensors import (
    COUNT,
    HELD_FORCE,
    HELD_VALUE,
    INDICES,
    MAX_DISTANCE,
    MAX_VALUE,
    SATURATION_DISTANCE,
    GripperSensors,
    distance_value,
    force_value,
)
from katana450.extensions.touch.touch_model import TouchModel


def test_each_sensor_has_its_place_in_the_answer() -> None:
    assert len(set(INDICES.values())) == len(INDICES) == COUNT - 2
    assert set(range(COUNT)) - set(INDICES.values()) == {2, 10}
    sensors = GripperSensors.from_bytes(bytes(range(100, 116)))
    assert sensors.right_near_distance == 100
    assert sensors.conductivity == 103
    assert (sensors.right_rear_force, sensors.right_front_force) == (106, 107)
    assert sensors.centre_distance == 111
    assert (sensors.left_rear_force, sensors.left_front_force) == (114, 115)
    written = sensors.to_bytes()
    assert (written[2], written[10]) == (0, 0)
    assert GripperSensors.from_bytes(written) == sensors


def test_wrong_values_are_refused_with_the_reason() -> None:
    with pytest.raises(InputError, match="16 sensor values, not 15"):
        GripperSensors.from_bytes(bytes(15))
    with pytest.raises(
        InputError, match="left_front_force must be a whole number from 0 to 255, not 256"
    ):
        GripperSensors(left_front_force=256)


def test_both_fingers_must_press_to_hold() -> None:
    assert not GripperSensors(right_rear_force=HELD_VALUE, right_front_force=255).holding
    # The last of the sixteen is looked at, too.
    assert GripperSensors(right_front_force=HELD_VALUE, left_front_force=HELD_VALUE).holding


def test_light_falls_with_the_square_of_the_distance() -> None:
    assert distance_value(0.0) == distance_value(SATURATION_DISTANCE) == MAX_VALUE
    assert distance_value(2.0 * SATURATION_DISTANCE) == 64
    assert distance_value(MAX_DISTANCE) == 0


def test_force_is_scaled_to_the_value_of_holding() -> None:
    assert force_value(0.0) == 0
    assert force_value(HELD_FORCE) == HELD_VALUE
    assert force_value(50.0) == MAX_VALUE


def test_sensors_of_a_real_arm_replace_the_simulated_ones(model: TouchModel, around: State) -> None:
    raw = tuple(float(number) for number in range(100, 116))
    report = ArmReport(ArmMode.HOLDING, around.t, around.x, sensors=raw)
    measured = model.report(replace(around, report=report))["sensors"]
    assert measured == GripperSensors.from_bytes(bytes(range(100, 116))).named()
    assert model.report(around)["sensors"] != measured
