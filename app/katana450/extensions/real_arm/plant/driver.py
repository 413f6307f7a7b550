"""A simulated arm whose axes follow their setpoints as a plant does, not exactly."""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from katana450.arm.control.session.stopping import SilenceProfile
from katana450.arm.control.state.arm_report import ArmAct, ArmMode, ArmReport, MeasuredStop
from katana450.arm.drivers.driver import DriverAnswer
from katana450.arm.robot.robot import Robot, loads_of
from katana450.errors import InputError
from katana450.extensions.real_arm.plant.axis import STEP, PlantAxis, PlantProfile
from katana450.extensions.real_arm.tool_travel import tool_travel
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.kinematics.statics import holding_torques

COARSE = 0.02
"""[rad] Change of a joint after which the weights are computed again; they change by 2 %."""

NEGLIGIBLE = 0.01
"""[N m] Largest torque of an axis below which it counts as balanced."""


class GravityLoads:
    """The weights on the axes of a robot, from the masses in its description.

    All are zero for a robot without masses or without an arm.
    """

    def __init__(self, robot: Robot) -> None:
        """Find the largest torque of each axis, from the stretched posture."""
        self._arm = robot.arm
        self._masses = loads_of(robot)
        count = len(robot.driven) if robot.arm is None else robot.arm.chain.n
        self._weights = (0.0,) * count
        self._at: FloatArray | None = None
        self._scale = np.zeros(count)
        if robot.arm is not None and self._masses:
            largest = np.abs(holding_torques(robot.arm.chain, np.zeros(count), self._masses))
            # An axis that is balanced when stretched holds no weight worth simulating.
            heavy = largest > NEGLIGIBLE
            self._scale[heavy] = 1.0 / largest[heavy]

    def at(self, q: FloatArray) -> tuple[float, ...]:
        """Return the weight (n,) on each axis at the posture ``q`` (n,) [rad], from -1 to 1.

        It is positive if the motor must push towards larger angles to hold the arm.
        """
        if self._arm is None or not self._scale.any():
            return self._weights
        if self._at is None or np.abs(q - self._at).max() > COARSE:
            self._at = q.copy()
            torques = holding_torques(self._arm.chain, q, self._masses) * self._scale
            self._weights = tuple(np.clip(torques, -1.0, 1.0).tolist())
        return self._weights


MAX_STEPS = 200
"""Steps of one tick at most; a longer silence of the control loop is not simulated."""

ROUNDING = 1e-6
"""Fraction of a step that rounding may take from the time between two ticks."""

GRIPPER_RISE_TIME = 0.1
"""[s] Time in which the finger joint reaches its speed. Assumed."""

Targets = tuple[float, ...]


class PlantDriver:
    """A simulated arm with inertia, delay, friction, droop and play.

    It measures the links, where an encoder at a motor would not see the play.
    """

    silence_profile = SilenceProfile.SIMULATION

    def __init__(self, robot: Robot, q: FloatArray, gripper: float, profile: PlantProfile) -> None:
        """Create an arm at rest at ``q`` (n,) [rad] with its finger joint at ``gripper`` [rad]."""
        arm = robot.joint_group if robot.arm is None else robot.arm
        limits, fingers = arm.limits, arm.gripper
        self._lower = np.append(limits.lower, fingers.lower)
        self._upper = np.append(limits.upper, fingers.upper)
        self._speed = np.append(limits.speed, fingers.speed)
        accelerations = np.append(limits.acceleration, fingers.speed / GRIPPER_RISE_TIME)
        start = np.clip(np.append(q, gripper), self._lower, self._upper)
        self._axes = tuple(
            PlantAxis(profile, *numbers)
            for numbers in zip(
                start.tolist(),
                zip(self._lower.tolist(), self._upper.tolist(), strict=True),
                self._speed.tolist(),
                accelerations.tolist(),
                strict=True,
            )
        )
        self._loads, self._travel = GravityLoads(robot), tool_travel(robot)
        self._weights = (*self._loads.at(start[:-1]), 0.0)
        self._setpoint = start
        # The targets of the steps that the delay keeps back, and the one before them.
        steps = round(profile.delay / STEP)
        self._waiting: deque[Targets] = deque([tuple(start.tolist())] * (steps + 1))
        self._t: float | None = None
        self._asked: list[float] = []
        self._rests = False
        self._brakes = False
        # When and where a stop found the arm in motion.
        self._stopping: tuple[float, FloatArray] | None = None
        self._measured_stop: MeasuredStop | None = None
        self._measured = self._expected = frozen(start)
        self._q = self._measured[:-1]
        self._speeds = frozen(np.zeros(len(start)))

    def start(self, t: float) -> DriverAnswer:
        """Start the clock at ``t`` [s], and return where the arm stands."""
        self._t = t
        return self._answer(t)

    def send(self, q: FloatArray, gripper: float, t: float, stopped: bool = False) -> DriverAnswer:
        """Simulate the arm until ``t`` [s] with the setpoint, and return where it is.

        While ``stopped``, the axes brake as hard as their motors can and hold where they come to
        rest. Raises InputError before ``start`` and for a setpoint that is not finite.
        """
        if self._t is None:
            raise InputError("The simulated arm is not started: call `start` first.")
        target = [*q.tolist(), gripper]
        if not all(map(math.isfinite, target)):
            raise InputError(f"The setpoint must be finite, not {q}, {gripper}.")
        steps = min(int(max(t - self._t, 0.0) / STEP + ROUNDING), MAX_STEPS)
        # What is left of the time is simulated in the next tick.
        self._t = max(self._t + steps * STEP, t - STEP)
        if stopped is not self._brakes:
            self._turn(stopped, t)
        if stopped:
            self._brake(steps, t)
        elif steps and (target != self._asked or not self._rests):
            self._follow(np.array(target), steps)
            self._asked = target
        return self._answer(t)

    def perform(self, act: ArmAct, t: float) -> None:
        """Do nothing: a simulated arm is always connected, calibrated and held."""

    def freeze(self, t: float) -> None:
        """Do nothing: a simulated arm does nothing by itself."""

    def place(self, q: FloatArray, gripper: float) -> None:
        """Do nothing: the session restores no state of an arm with a report."""

    def stop(self) -> None:
        """End the motion; ``start`` is needed before the next setpoint."""
        self._t = None

    @property
    def _moves(self) -> bool:
        return any(axis.speed for axis in self._axes)

    def _turn(self, stopped: bool, t: float) -> None:
        """Begin to brake, or to follow setpoints from where the arm stands."""
        self._brakes, self._rests = stopped, False
        posture = np.array([axis.position for axis in self._axes])
        if stopped:
            self._measured_stop = None
            self._stopping = (t, posture) if self._moves else None
            return
        self._setpoint = posture
        self._waiting = deque([tuple(posture.tolist())] * len(self._waiting))

    def _follow(self, setpoint: FloatArray, steps: int) -> None:
        wanted = np.clip(setpoint, self._lower, self._upper)
        reach = self._speed * (steps * STEP)
        change = np.clip(wanted - self._setpoint, -reach, reach)
        waiting, begin = self._waiting, self._setpoint.tolist()
        step = (change / steps).tolist()
        changed = False
        for number in range(1, steps + 1):
            goal = [a + number * b for a, b in zip(begin, step, strict=True)]
            waiting.append(tuple(goal))
            before, target = waiting.popleft(), waiting[0]
            for axis, old, new, load in zip(self._axes, before, target, self._weights, strict=True):
                changed |= axis.follow(new, (new - old) / STEP, load)
        self._setpoint = self._setpoint + change
        self._rests = not changed and all(row == before for row in waiting)
        self._take_over(np.array(waiting[0]))

    def _brake(self, steps: int, t: float) -> None:
        if self._rests or not steps:
            return
        changed = False
        for _ in range(steps):
            for axis, load in zip(self._axes, self._weights, strict=True):
                changed |= axis.brake(load)
        self._rests = not changed
        posture = np.array([axis.position for axis in self._axes])
        if self._stopping is not None and not self._moves:
            began, places = self._stopping
            angle = float(np.abs(posture - places)[:-1].max())
            distance = None if self._travel is None else self._travel(places, posture)
            self._measured_stop = MeasuredStop(t - began, angle, distance)
            self._stopping = None
        # A braking arm is where it should be.
        self._take_over(posture)

    def _take_over(self, expected: FloatArray) -> None:
        """Keep the results of the steps; unchanged values keep their arrays."""
        axes = self._axes
        measured = _kept(self._measured, [axis.output for axis in axes])
        if measured is not self._measured:
            self._measured, self._q = measured, measured[:-1]
        self._speeds = _kept(self._speeds, [axis.speed for axis in axes])
        self._expected = _kept(self._expected, expected.tolist())
        self._weights = (*self._loads.at(self._q), 0.0)

    def _answer(self, t: float) -> DriverAnswer:
        report = ArmReport(
            ArmMode.MOVING if self._moves else ArmMode.HOLDING,
            t,
            self._expected,
            self._speeds,
            measured_stop=self._measured_stop,
        )
        return DriverAnswer(self._q, float(self._measured[-1]), report)


def _kept(array: FloatArray, values: list[float]) -> FloatArray:
    """Return ``array`` if it has the ``values``, else a new read-only array of them."""
    return array if array.tolist() == values else frozen(values)
