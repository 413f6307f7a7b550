"""The calibration: each axis in turn searches its mechanical stop, which gets a known count."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from katana450.extensions.real_arm.emulator.axis import EmulatedAxis
from katana450.extensions.real_arm.emulator.motors import CALIBRATED_AT
from katana450.extensions.real_arm.emulator.target_move import TargetMove
from katana450.extensions.real_arm.plant.axis import STEP

SEARCH_SPEED, SLOW_SPEED = 6000.0, 1000.0
"""[counts/s] Speeds of the first and the second search. Assumed; all axes then take about 30 s."""

ACCELERATION = 10000.0
"""[counts/s^2] Acceleration of all motions of a calibration."""

PRESS, SLOW_PRESS = 150.0, 60.0
"""[counts] Deviation from the setpoint by which the stop is recognised, in each search."""

GAP = 250.0
"""[counts] Half the distance by which the axis leaves the stop between the searches."""

REST_SPEED = 50.0
"""[counts/s] Speed below which an axis that presses has reached its stop."""

FARTHEST = 200_000.0
"""[counts] A distance that no axis can travel."""


class CalibrationRun:
    """A calibration in progress.

    Attributes:
        is_done: whether all axes are calibrated.
    """

    def __init__(self, axes: Sequence[EmulatedAxis]) -> None:
        """Begin with the first of ``axes``, in their order."""
        self._axes = tuple(axes)
        for axis in axes:
            axis.begin_calibration()
        self._steps = self._all()
        self.is_done = False

    def step(self) -> None:
        """Move the setpoint of the axis in turn for one step of the plant."""
        self.is_done = next(self._steps, None) is None
        if self.is_done:
            for axis in self._axes:
                axis.freeze()

    def _all(self) -> Iterator[EmulatedAxis]:
        for axis in self._axes:
            yield from _search(axis, SEARCH_SPEED, PRESS)
            _set_stop(axis)
            yield from _travel(axis, axis.setpoint - axis.facts.sign * 2.0 * GAP)
            yield from _search(axis, SLOW_SPEED, SLOW_PRESS)
            _set_stop(axis)
            axis.is_calibrated = True
            yield from _travel(axis, axis.facts.sign * CALIBRATED_AT - axis.offset)


def _search(axis: EmulatedAxis, speed: float, press: float) -> Iterator[EmulatedAxis]:
    """Move towards the stop until the axis stays behind its setpoint and stands."""
    plant, speed = axis.plant, speed / axis.facts.halving
    move = TargetMove(axis.setpoint, 0.0, axis.setpoint + axis.facts.sign * FARTHEST)
    while (
        abs(move.position - plant.position) < press / axis.facts.halving
        or abs(plant.speed) > REST_SPEED
    ):
        move.advance(STEP, speed, ACCELERATION)
        axis.lead(move.position, move.speed)
        yield axis
    axis.lead(plant.position, 0.0)


def _travel(axis: EmulatedAxis, target: float) -> Iterator[EmulatedAxis]:
    move = TargetMove(axis.setpoint, 0.0, target)
    while not move.is_done:
        move.advance(STEP, SEARCH_SPEED / axis.facts.halving, ACCELERATION)
        axis.lead(move.position, move.speed)
        yield axis


def _set_stop(axis: EmulatedAxis) -> None:
    """Give the place where the axis stands the count of its stop."""
    axis.offset = axis.facts.stop - round(axis.plant.position)
