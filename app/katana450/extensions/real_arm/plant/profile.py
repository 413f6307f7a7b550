"""Profiles of a simulated plant: the numbers of its position control, friction and play."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from katana450.errors import InputError


@dataclass(frozen=True)
class PlantProfile:
    """Numbers by which the axes of a simulated arm follow their setpoints.

    Lengths of sliding joints take the place of angles, in m instead of rad.

    Attributes:
        name: name on the command line.
        bandwidth: natural frequency of the position control of an axis [rad/s].
        damping: its damping ratio.
        delay: time from a setpoint to the motion that it commands [s].
        coulomb: Coulomb friction as an acceleration [rad/s^2].
        viscous: viscous friction as an acceleration per speed [1/s].
        droop: angle by which an axis hangs below its setpoint under its largest weight [rad].
        backlash: play between motor and link, from one side to the other [rad].
        fall: acceleration of an axis without current under its largest weight [rad/s^2].
        reserve: largest acceleration of the motor, as a multiple of the arm's own limit.
    """

    name: str
    bandwidth: float
    damping: float
    delay: float
    coulomb: float
    viscous: float
    droop: float
    backlash: float
    fall: float
    reserve: float


STIFF = PlantProfile(
    "stiff",
    bandwidth=200.0,
    damping=1.0,
    delay=0.0,
    coulomb=1e-3,
    viscous=0.0,
    droop=0.0,
    backlash=0.0,
    fall=5.0,
    reserve=1e3,
)
"""Axes that follow within 0.01 degrees: for tests of everything but the plant. Not measured."""

KATANA450 = PlantProfile(
    "katana450",
    # Assumed: a fourteenth of the rate of the internal bus, which has 100 cycles a second.
    bandwidth=45.0,
    # Assumed: no overshoot is reported by the people who ran such an arm.
    damping=1.0,
    # Two cycles of the internal bus of 10 ms: one to receive, one to act.
    delay=0.02,
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

PROFILES: Mapping[str, PlantProfile] = {each.name: each for each in (STIFF, KATANA450)}


def profile_named(name: str) -> PlantProfile:
    """Return the profile ``name``. Raises InputError with the names of all profiles."""
    found = PROFILES.get(name)
    if found is None:
        raise InputError(f"There is no plant {name!r}; choose one of: {', '.join(PROFILES)}.")
    return found
