"""The 16 sensors of the emulated gripper, and the object between its fingers.

The meaning of each sensor is that reported for this gripper; its zero and scale are assumed.
"""

from __future__ import annotations

import math
from bisect import bisect_right

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

RIGHT_NEAR, LEFT_NEAR = (0, 1), (8, 9)
"""Infrared distances at the insides of the fingers."""

CENTRE = 11
"""Infrared distance in the middle of the gripper."""

FORCES = (6, 7, 14, 15)
"""Forces: right rear and front, left rear and front."""

DARK = (2, 3, 10)
"""Sensors that read 0: two that are reserved, and the conductivity between the fingers."""

FAR, NEAR = 12, 250
"""Readings of an infrared sensor with nothing in front of it, and at a surface. Assumed."""

SIGHT = 15.0
"""[mm] Distance at which that reading has fallen by a factor e. Assumed."""

NO_FORCE, WHOLE_FORCE = 20, 255
"""Readings of a force sensor without contact, and at the whole effort of the motor. Assumed."""


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
    values = [FAR] * 16
    for each in DARK:
        values[each] = 0
    away = gap_at_encoder(encoder) - (width or 0.0)
    seen = _seen(max(0.5 * away, 0.0))
    for each in (*RIGHT_NEAR, *LEFT_NEAR):
        values[each] = seen
    values[CENTRE] = FAR if width is None else NEAR
    force = NO_FORCE + min(squeeze, 1.0) * (WHOLE_FORCE - NO_FORCE)
    for each in FORCES:
        values[each] = round(force)
    return tuple(values)


def _seen(distance: float) -> int:
    return round(FAR + (NEAR - FAR) * math.exp(-distance / SIGHT))
