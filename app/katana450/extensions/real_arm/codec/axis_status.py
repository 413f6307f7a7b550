"""Status bytes of the axes in words."""

from __future__ import annotations

from enum import IntEnum


class AxisStatus(IntEnum):
    """Known values of the status byte of an axis. Others occur and have no known meaning."""

    OFF = 0
    CALIBRATING = 4
    FIXED = 8
    MOVING = 16
    MOVING_TO_TARGET = 24
    COLLIDED = 40
    SPLINES_DONE = 88
    DATA_INVALID = 128
    SPLINE_BUFFER_FULL = 152


IN_MOTION = frozenset(
    (AxisStatus.MOVING, AxisStatus.MOVING_TO_TARGET, AxisStatus.SPLINE_BUFFER_FULL)
)
"""Values of an axis that moves by itself."""

AT_REST = frozenset((AxisStatus.FIXED, AxisStatus.SPLINES_DONE))
"""Values of an axis that holds its position and accepts a motion."""

STATUS_WORDS = {
    AxisStatus.OFF: "its motor is off",
    AxisStatus.CALIBRATING: "it calibrates",
    AxisStatus.FIXED: "it holds its position",
    AxisStatus.MOVING: "it moves",
    AxisStatus.MOVING_TO_TARGET: "it moves to a target",
    AxisStatus.COLLIDED: "a collision stopped it",
    AxisStatus.SPLINES_DONE: "its motion is finished",
    AxisStatus.DATA_INVALID: "its data are invalid",
    AxisStatus.SPLINE_BUFFER_FULL: "it moves and its buffer is full",
}


def status_words(status: int) -> str:
    """Return a status byte in words, as the end of a sentence on the axis."""
    if status in STATUS_WORDS:
        return STATUS_WORDS[AxisStatus(status)]
    return f"it reports the unknown status {status}"
