"""Newest measurements of an arm."""

from __future__ import annotations

import math

import numpy as np

from katana450.extensions.real_arm.codec.axis_status import AxisStatus, status_words
from katana450.extensions.real_arm.codec.replies import (
    AXES,
    ArmReply,
    AxisPositions,
    AxisReading,
    AxisStates,
    MasterVersion,
    SensorBytes,
)
from katana450.maths.geometry.arrays import FloatArray, IntArray

SHORTEST_INTERVAL = 0.02
"""[s] Time between two positions below which their difference gives no useful speed."""


class ArmReadings:
    """Newest measurements of an arm, and the positions at which it was ordered to hold.

    Attributes:
        positions: (6,) [encoders].
        t: Time of the positions [s]; -inf before the first ones.
        speeds: (6,) [encoders/s], from differences of positions: the arm's own are doubtful.
        states: (6,) status bytes; 255 before the first ones.
        states_t: Time of the states [s]; -inf before the first ones.
        sensors: (16,) raw sensors of the gripper; empty before the first ones.
        newest_reply: Time of the newest reply [s].
        version: Firmware of the master, such as 2.1; empty before it is known.
        held: (6,) positions at which the axes were ordered to hold, or ended a motion [encoders].
    """

    def __init__(self) -> None:
        self.positions: IntArray = np.zeros(AXES, np.int64)
        self.t = self.states_t = self.newest_reply = -math.inf
        self.speeds: FloatArray = np.zeros(AXES)
        self.states: tuple[int, ...] = (255,) * AXES
        self.sensors: tuple[int, ...] = ()
        self.version = ""
        self.held: IntArray = np.zeros(AXES, np.int64)

    def note(self, reply: ArmReply, t: float) -> None:
        """Take the measurement in ``reply``, if it has one, made at ``t`` [s]."""
        self.newest_reply = t
        match reply:
            case AxisPositions():
                self._move(np.array(reply.positions, np.int64), t)
            case AxisStates():
                self.states, self.states_t = reply.states, t
            case AxisReading(axis=axis, status=status, position=position) if axis <= AXES:
                self.positions = self.positions.copy()
                self.positions[axis - 1] = position
                self.states = (*self.states[: axis - 1], status, *self.states[axis:])
                self.t = self.states_t = t
            case SensorBytes(values=values):
                self.sensors = values
            case MasterVersion(version=version, revision=revision):
                self.version = f"{version}.{revision}"
            case _:
                pass

    def _move(self, positions: IntArray, t: float) -> None:
        dt = t - self.t
        if dt >= SHORTEST_INTERVAL:
            self.speeds = (positions - self.positions) / dt
        self.positions, self.t = positions, t

    def position_at(self, t: float) -> FloatArray:
        """Return the positions (6,) [encoders] expected at ``t`` [s] from the newest ones."""
        return self.positions + self.speeds * (t - self.t if math.isfinite(self.t) else 0.0)

    def axes_in(self, *statuses: int) -> tuple[int, ...]:
        """Return the axes, from 1, whose status is one of ``statuses``."""
        return tuple(i for i, status in enumerate(self.states, 1) if status in statuses)

    @property
    def collided(self) -> tuple[int, ...]:
        """Axes, from 1, that a collision stopped."""
        return self.axes_in(AxisStatus.COLLIDED)

    def words(self, axis: int) -> str:
        """Return the status of ``axis``, from 1, as a sentence."""
        return f"Axis {axis}: {status_words(self.states[axis - 1])}."


def collision_sentence(axes: tuple[int, ...]) -> str:
    """Return the sentence about a collision of ``axes``, of which there is at least one."""
    *others, last = map(str, axes)
    names = f"axes {', '.join(others)} and {last}" if others else f"axis {last}"
    return f"A collision stopped {names}. Clear the space around the arm, then unblock it."
