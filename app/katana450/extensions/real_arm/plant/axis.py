"""One axis of a simulated plant: a motor under position control that turns a link.

The control is a spring and a damper towards a moving setpoint, with its speed fed forward. The
motor's acceleration is bounded, friction opposes the motion, and the weight of the arm pulls.
Steps are semi-implicit Euler steps of a fixed length, so the motion is the same on each run.
Source: Lynch & Park, Modern Robotics (2017), ch. 11.4 (control with torque inputs) and 8.9.1
(reflected inertia and friction of geared motors).
"""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class PlantProfile:
    """Numbers by which the axes of a simulated arm follow their setpoints.

    Attributes:
        bandwidth: natural frequency of the position control of an axis [rad/s].
        damping: its damping ratio.
        coulomb: Coulomb friction as an acceleration [rad/s^2].
        viscous: viscous friction as an acceleration per speed [1/s].
        droop: angle by which an axis hangs below its setpoint under its largest weight [rad].
        backlash: play between motor and link, from one side to the other [rad].
        fall: acceleration of an axis without current under its largest weight [rad/s^2].
        reserve: largest acceleration of the motor, as a multiple of the arm's own limit.
    """

    bandwidth: float
    damping: float
    coulomb: float
    viscous: float
    droop: float
    backlash: float
    fall: float
    reserve: float


KATANA450 = PlantProfile(
    # Assumed: a fourteenth of the rate of the internal bus, which has 100 cycles a second.
    bandwidth=45.0,
    # Assumed: no overshoot is reported by the people who ran such an arm.
    damping=1.0,
    # Assumed: with the bandwidth it leaves an axis within 0.014 degrees of its setpoint, so that
    # the tool is within the 0.1 mm that the maker quotes for the precision.
    coulomb=0.5,
    # Assumed: 0.12 degrees behind at the maximum speed of 126 degrees/s.
    viscous=2.0,
    # Assumed: 0.5 mm at the tool of the stretched arm, which is 0.63 m from the shoulder.
    droop=math.radians(0.05),
    # Assumed: a strain wave gear of 100:1 with a spur stage of 3.7:1 in front of it.
    backlash=math.radians(0.03),
    # Assumed: the reflected inertia of the motors lets the arm sink slower than a free body.
    fall=5.0,
    # Assumed: with less than this, axis 3 could not follow the arm's own limits under its weight.
    reserve=5.0,
)
"""The Katana450. Only the cycle of its bus and its precision are known; the rest is assumed until
an arm is measured."""

STEP = 0.0025
"""[s] Length of a step."""

TAKE_UP_TIME = 0.02
"""[s] Time in which weight moves a link through the whole play."""

STICTION = 1.05
"""Friction of an axis at rest as a multiple of that in motion. It also ends a creeping motion,
which would approach its end without reaching it."""

LIGHT = 0.02
"""Fraction of the largest weight below which friction holds a link inside its play."""


class PlantAxis:
    """The state of one axis. Its unit of angle is the caller's: rad or encoder counts.

    Attributes:
        position: angle of the motor, in angles of the joint [unit].
        speed: speed of the motor [unit/s].
        output: angle of the link [unit]; within half the backlash of ``position``.
        effort: acceleration that the motor asks for, as a fraction of its largest: -1 to 1.
        lower, upper: mechanical stops [unit].
    """

    def __init__(
        self,
        profile: PlantProfile,
        position: float,
        stops: tuple[float, float],
        max_speed: float,
        max_acceleration: float,
        unit: float = 1.0,
    ) -> None:
        """Create an axis at rest.

        Args:
            profile: the numbers of the plant.
            position: angle where it stands [unit].
            stops: lower and upper mechanical stop [unit].
            max_speed: largest speed of the motor [unit/s].
            max_acceleration: acceleration limit of the arm [unit/s^2].
            unit: number of units in a radian.
        """
        self.position = self.output = position
        self.lower, self.upper = stops
        self.speed = self.effort = 0.0
        self._max_speed = max_speed
        self._max_acceleration = max_acceleration * profile.reserve
        self._spring = profile.bandwidth**2
        self._damping = 2.0 * profile.damping * profile.bandwidth
        self._viscous = profile.viscous
        self._coulomb = profile.coulomb * unit * STEP
        self._droop = profile.droop * unit * self._spring
        self._fall = profile.fall * unit
        self._play = 0.5 * profile.backlash * unit

    def follow(self, target: float, speed: float, load: float) -> bool:
        """Take a step. The setpoint at its end is ``target`` [unit], with ``speed`` [unit/s].

        load: weight to be held, as a fraction of the largest, -1 to 1. Returns whether anything
        changed.
        """
        behind = target - speed * STEP - self.position
        drive = self._spring * behind + self._damping * (speed - self.speed)
        return self._push(drive, load, self._droop)

    def brake(self, load: float) -> bool:
        """Take a step with the motor braking to rest, at any place. See ``follow``."""
        return self._push(-self._damping * self.speed, load, 0.0)

    def coast(self, load: float) -> bool:
        """Take a step without current; the weight moves the axis. See ``follow``."""
        return self._push(0.0, load, self._fall)

    def _push(self, drive: float, load: float, weight: float) -> bool:
        limit = self._max_acceleration
        drive = min(max(drive, -limit), limit)
        self.effort = drive / limit
        before, slid = self.position, self.output
        speed = self.speed + (drive - weight * load - self._viscous * self.speed) * STEP
        # Friction ends a motion but begins none, so an axis comes to rest exactly.
        if abs(speed) <= STICTION * self._coulomb:
            speed = 0.0
        else:
            speed = math.copysign(min(abs(speed) - self._coulomb, self._max_speed), speed)
        position = before + speed * STEP
        if not self.lower <= position <= self.upper:
            position, speed = min(max(position, self.lower), self.upper), 0.0
        self.position, self.speed = position, speed
        self._take_up(load)
        return position != before or self.output != slid or speed != 0.0

    def _take_up(self, load: float) -> None:
        """Move the link inside the play: the motor pushes it, and its weight pulls it down."""
        play = self._play
        if play == 0.0:
            self.output = self.position
            return
        output = self.output
        if abs(load) > LIGHT:
            side = self.position - math.copysign(play, load)
            reach = 2.0 * play * STEP / TAKE_UP_TIME
            output += min(max(side - output, -reach), reach)
        self.output = min(max(output, self.position - play), self.position + play)
