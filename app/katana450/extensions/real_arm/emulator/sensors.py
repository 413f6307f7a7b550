"""The force sensors of the emulated gripper, and the object between its fingers."""

from __future__ import annotations

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

SENSORS = 16
"""Number of bytes in an answer."""

FORCE_SENSORS = (6, 7, 14, 15)
"""Places of the force sensors: rear and front of the right finger, then of the left one."""


def encoder_at_gap(gap: float) -> float:
    """Return the counts of axis 6 at which the finger tips are ``gap`` [mm] apart."""
    place = min(max(bisect_right(GAPS, gap, key=lambda row: row[1]), 1), len(GAPS) - 1)
    (low, start), (high, end) = GAPS[place - 1], GAPS[place]
    angle = low + (gap - start) / (end - start) * (high - low)
    turned = (angle - CLOSED_ANGLE) / (OPEN_ANGLE - CLOSED_ANGLE)
    return CLOSED_ENCODER + turned * (OPEN_ENCODER - CLOSED_ENCODER)


def sensor_values(squeeze: float) -> tuple[int, ...]:
    """Return the bytes (16,) of all sensors. The others read 0: how they behave is not known.

    ``squeeze``: force on the object, as a fraction of the whole effort of the motor.
    """
    force = min(round(255 * squeeze), 255)
    return tuple(force if place in FORCE_SENSORS else 0 for place in range(SENSORS))
