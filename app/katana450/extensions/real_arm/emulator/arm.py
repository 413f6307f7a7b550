"""The emulated arm without I/O: six axes in motion, their calibration, and the gripper."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from katana450.arm.robot.robot import Robot
from katana450.extensions.real_arm.codec.replies import AxisStatus
from katana450.extensions.real_arm.emulator.axis import (
    CALIBRATED_AT,
    CALIBRATION_ORDER,
    MOTORS,
    POWER_UP_POSTURE,
    AxisMode,
    EmulatedAxis,
    TargetMove,
)
from katana450.extensions.real_arm.encoder_map import EncoderMap
from katana450.extensions.real_arm.plant.axis import KATANA450, STEP, PlantProfile
from katana450.extensions.real_arm.plant.loads import GravityLoads
from katana450.maths.geometry.arrays import FloatArray

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


ENCODERS = EncoderMap()


def joints_at(counts: Sequence[float]) -> tuple[FloatArray, float]:
    """Return joint angles (5,) and finger angle [rad] at ``counts`` (6,) of the calibrated arm."""
    joints = ENCODERS.joints(np.array(counts))
    return joints[:-1], float(joints[-1])


def loads_of_robot(robot: Robot) -> Callable[[Sequence[float]], Sequence[float]]:
    """Return the function that finds the weights on the axes at counts; see ``EmulatedArm``."""
    gravity = GravityLoads(robot)
    directions = np.sign(ENCODERS.scale[:-1]).tolist()

    def loads(counts: Sequence[float]) -> Sequence[float]:
        weights = gravity.at(joints_at(counts)[0])
        return (*(a * b for a, b in zip(weights, directions, strict=True)), 0.0)

    return loads


GRIPPER = 5
"""Number of the axis of the gripper, from 0."""

LOAD_INTERVAL = 8
"""Steps after which the weights on the axes are computed again: 20 ms."""

ROUNDING = 1e-6
"""Fraction of a step that rounding may take from the time."""

Loads = Callable[[Sequence[float]], Sequence[float]]
"""Weights (6,) on the axes, from -1 to 1, at the counts (6,) of the calibrated arm. It is positive
if the motor must push towards larger counts."""


def no_loads(_counts: Sequence[float]) -> Sequence[float]:
    """Return the weights of an arm that weighs nothing."""
    return (0.0,) * len(MOTORS)


class EmulatedArm:
    """An arm that begins uncalibrated, with its motors off, on a support.

    Attributes:
        axes: (6,) the axes; the last is that of the gripper.
        time: simulated time since the start [s].
        detects_collisions: whether a blocked axis stops the arm.
        collided: axis that stopped the arm, from 1; 0 for none.
    """

    def __init__(
        self,
        profile: PlantProfile = KATANA450,
        loads: Loads = no_loads,
        *,
        calibrated: bool = False,
        calibration_scale: float = 1.0,
    ) -> None:
        """Create an arm at rest.

        Args:
            profile: numbers of its plant.
            loads: weights on its axes.
            calibrated: whether it begins as after a calibration, in that posture, holding.
            calibration_scale: simulated seconds in a second during a calibration.
        """
        posture = [motor.sign * CALIBRATED_AT for motor in MOTORS]
        places = posture if calibrated else POWER_UP_POSTURE
        self.axes = tuple(
            EmulatedAxis(facts, profile, place) for facts, place in zip(MOTORS, places, strict=True)
        )
        self.time = 0.0
        self.detects_collisions = True
        self.collided = 0
        self._scale = calibration_scale
        self._loads = loads
        self._weights: Sequence[float] = (0.0,) * len(self.axes)
        self._calibration: CalibrationRun | None = None
        self._done = 0
        self._steps = 0
        self._rests = False
        for axis in self.axes:
            axis.is_supported = True
            if calibrated:
                axis.offset, axis.is_calibrated = 0, True
                axis.freeze()

    @property
    def is_calibrating(self) -> bool:
        """True while the axes search their stops."""
        return self._calibration is not None

    @property
    def counts(self) -> tuple[float, ...]:
        """Where the links are, (6,) in counts of the calibrated arm."""
        return tuple(axis.plant.output for axis in self.axes)

    def step(self, dt: float) -> None:
        """Simulate the next ``dt`` [s] in steps of fixed length; what is left follows later."""
        self.time += dt
        due = int(self.time / STEP + ROUNDING) - self._done
        self._done += due
        for _ in range(due):
            # An arm at rest stays at rest until it is touched.
            if self._rests:
                return
            for _ in range(max(round(self._scale), 1) if self._calibration is not None else 1):
                self._step()

    def touch(self) -> None:
        """Simulate again from now on: something may move."""
        self._rests = False
        for axis in self.axes:
            axis.touch()

    def calibrate(self, axis: int) -> None:
        """Begin to calibrate ``axis``, from 1, or all with 0."""
        order = (axis,) if axis else CALIBRATION_ORDER
        self._calibration = CalibrationRun([self.axes[number - 1] for number in order])
        self.collided = 0
        self.touch()

    def freeze(self, axis: int) -> None:
        """Brake and hold ``axis``, from 1, or all with 0. It ends a calibration."""
        self.end_calibration()
        for joint in self.chosen(axis):
            joint.freeze()
        if all(joint.status != AxisStatus.COLLIDED for joint in self.axes[:GRIPPER]):
            self.collided = 0
        self.touch()

    def end_calibration(self) -> None:
        """Stop a calibration and hold all axes."""
        if self._calibration is not None:
            self._calibration = None
            for axis in self.axes:
                if axis.mode is AxisMode.CALIBRATE:
                    axis.freeze()

    def chosen(self, axis: int) -> tuple[EmulatedAxis, ...]:
        """Return the axis with the number ``axis``, from 1, or all for 0."""
        return self.axes if axis == 0 else (self.axes[axis - 1],)

    def _step(self) -> None:
        if self._steps % LOAD_INTERVAL == 0:
            self._weights = self._loads(self.counts)
        self._steps += 1
        if self._calibration is not None:
            self._calibration.step()
            if self._calibration.is_done:
                self._calibration = None
        changed = False
        for axis, load in zip(self.axes, self._weights, strict=True):
            changed |= axis.step(load)
        if self.detects_collisions and self._calibration is None:
            self._find_collision()
        self._rests = not changed and self._calibration is None

    def _find_collision(self) -> None:
        for number, axis in enumerate(self.axes):
            if not axis.has_collided():
                continue
            axis.collide()
            if number == GRIPPER:
                # A gripper that closes on an object stops alone.
                continue
            self.collided = self.collided or number + 1
            for other in self.axes:
                # Only the axis that collided says so; the others hold where they come to rest.
                if other.mode in (AxisMode.TARGET, AxisMode.SPLINE):
                    other.freeze()
