"""The 16 sensors of the emulated gripper, and the object between its fingers.

Sensors read as those of the simulation, whose zero and scale are assumed.
"""

from __future__ import annotations

from bisect import bisect_right

from katana450.extensions.touch.gripper_sensors import (
    GripperSensors,
    distance_value,
    force_value,
)
from katana450.extensions.touch.squeeze import FORCE_LIMIT

OPEN_ENCODER, CLOSED_ENCODER = 30770, 12240
"""Counts of the open and the closed gripper."""

GAPS = (
    (-0.44, 0.4),
    (-0.30, 25.5),
    (-0.20, 43.0),
    (-0.10, 60.0),
    (0.00, 76.4),
    (0.10, 92.0),
    (0.20, 106.8),
    (0.30, 120.4),
)
"""Finger joint [rad] and the gap between the finger tips [mm], measured on the meshes."""

CLOSED_ANGLE, OPEN_ANGLE = GAPS[0][0], GAPS[-1][0]

OPEN_GAP = GAPS[-1][1]
"""[mm] Distance of everything that is not between the fingers."""


def encoder_at_gap(gap: float) -> float:
    """Return the counts of axis 6 at which the finger tips are ``gap`` [mm] apart."""
    place = min(max(bisect_right(GAPS, gap, key=lambda row: row[1]), 1), len(GAPS) - 1)
    (low, start), (high, end) = GAPS[place - 1], GAPS[place]
    angle = low + (gap - start) / (end - start) * (high - low)
    turned = (angle - CLOSED_ANGLE) / (OPEN_ANGLE - CLOSED_ANGLE)
    return CLOSED_ENCODER + turned * (OPEN_ENCODER - CLOSED_ENCODER)


def gap_at_encoder(encoder: float) -> float:
    """Return the gap of the finger tips [mm] at ``encoder`` counts of axis 6."""
    turned = (encoder - CLOSED_ENCODER) / (OPEN_ENCODER - CLOSED_ENCODER)
    angle = CLOSED_ANGLE + turned * (OPEN_ANGLE - CLOSED_ANGLE)
    place = min(max(bisect_right(GAPS, angle, key=lambda row: row[0]), 1), len(GAPS) - 1)
    (low, start), (high, end) = GAPS[place - 1], GAPS[place]
    return start + (angle - low) / (high - low) * (end - start)


def sensor_values(encoder: float, width: float | None, squeeze: float) -> tuple[int, ...]:
    """Return the bytes (16,) of all sensors.

    Args:
        encoder: counts of axis 6.
        width: width of the object between the fingers [mm]; None without one.
        squeeze: force on it, as a fraction of the whole effort of the motor.
    """
    beside = 0.5e-3 * max(gap_at_encoder(encoder) - (width or 0.0), 0.0)
    near = distance_value(beside)
    # Half of a pad has one of its two sensors.
    force = force_value(0.5 * FORCE_LIMIT * squeeze)
    sensors = GripperSensors(
        right_near_distance=near,
        right_far_distance=near,
        right_rear_force=force,
        right_front_force=force,
        left_near_distance=near,
        left_far_distance=near,
        left_rear_force=force,
        left_front_force=force,
        centre_distance=distance_value(1e-3 * (OPEN_GAP if width is None else 0.0)),
    )
    return tuple(sensors.to_bytes())
