"""Volume in a tilted cylinder below a plane, in closed form, for every tilt.

The cylinder stands on z = 0 of its own frame and is open at the top. A plane is given by its
``tilt`` [rad], from 0 (level) to pi (upside down), between the cylinder's axis and the plane's
normal, which points out of the water; and by its ``level`` [m], its height along the normal over
the middle of the floor. Volumes in m^3.

A slice across the axis is a disc that the plane cuts along a chord. The wet part has the area r^2
(phi - sin phi cos phi), where phi is half the angle of its arc; the volume is the mean of that over
the depth. The mean depends only on the half angles at floor and rim, so one formula serves for
every plane: through the wall only, the floor, the rim, or both.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

from katana450.tolerances import ROUNDING

ROUNDS = 100
"""Maximum number of halvings: more than a float has bits."""


class Arcs(NamedTuple):
    """Half the angle [rad] of the wet part of the wall, at the floor and at the rim."""

    floor: float
    rim: float


@dataclass(frozen=True)
class Cylinder:
    """The inside of a cylinder: radius and depth [m], above 0."""

    radius: float
    depth: float

    @property
    def capacity(self) -> float:
        """The volume [m^3] that the upright cylinder holds."""
        return self.radius**2 * self.depth * math.pi

    def span(self, tilt: float) -> tuple[float, float]:
        """Return the levels [m] at which the cylinder is empty, and full."""
        across = self.radius * math.sin(tilt)
        up = self.depth * math.cos(tilt)
        return min(up, 0.0) - across, max(up, 0.0) + across

    def lip(self, tilt: float) -> float:
        """Return the level [m] of the lowest point of the rim, where water leaves first."""
        return self.depth * math.cos(tilt) - self.radius * math.sin(tilt)

    def arcs(self, tilt: float, level: float) -> Arcs:
        """Return the half angles of the wet wall at floor and rim."""
        across = self.radius * math.sin(tilt)
        up = self.depth * math.cos(tilt)
        return Arcs(_half_angle(level, across), _half_angle(level - up, across))

    def volume(self, tilt: float, level: float) -> float:
        """Return the volume [m^3] below the plane."""
        return self.radius**2 * self.depth * self._mean(tilt, level, _mean_segment)

    def _mean(self, tilt: float, level: float, cut: Callable[[float, float], float]) -> float:
        """Return the mean over all slices of a function of phi that is pi in a wet slice.

        ``cut`` is its mean over the slices between two half angles.
        """
        across = self.radius * math.sin(tilt)
        floor, rim = level, level - self.depth * math.cos(tilt)
        low, high = min(floor, rim), max(floor, rim)
        if low >= across:
            return math.pi
        if high <= -across:
            return 0.0
        base, top = max(low, -across), min(high, across)
        mean = cut(_half_angle(base, across), _half_angle(top, across))
        if high == low:
            return mean
        # Slices that are wet all over, and slices that the plane cuts.
        return (math.pi * (high - top) + mean * (top - base)) / (high - low)

    def level(self, tilt: float, volume: float) -> float:
        """Return the level [m] below which there is ``volume`` [m^3], to rounding.

        Newton's rule: the volume grows with the level at the rate of the surface's area. A step
        that leaves the interval known to contain the answer is replaced by a halving of the
        interval.
        """
        low, high = self.span(tilt)
        if volume <= 0.0:
            return low
        if volume >= self.capacity:
            return high
        level = low + (high - low) * volume / self.capacity
        for _ in range(ROUNDS):
            beyond = self.volume(tilt, level) - volume
            if abs(beyond) <= ROUNDING * self.capacity:
                break
            if beyond > 0.0:
                high = level
            else:
                low = level
            area = self.surface(tilt, level)
            next_level = level - beyond / area if area > 0.0 else low
            if not low < next_level < high:
                next_level = 0.5 * (low + high)
            if next_level in (level, low, high):
                break
            level = next_level
        return level

    def surface(self, tilt: float, level: float) -> float:
        """Return the area [m^2] of the plane inside the cylinder."""
        floor, rim = self.arcs(tilt, level)
        cosine = math.cos(tilt)
        if abs(cosine) < AXIAL_COSINE:
            return 2.0 * self.radius * math.sin(floor) * self.depth
        return self.radius**2 * (_segment(floor) - _segment(rim)) / cosine

    def holds(self, tilt: float) -> float:
        """Return the maximum volume [m^3] at ``tilt``: the volume below the lip."""
        return self.volume(tilt, self.lip(tilt)) if math.cos(tilt) > 0.0 else 0.0

    def margin(self, tilt: float, level: float) -> float:
        """Return the distance [m] of the plane below the lip, negative above it."""
        return self.lip(tilt) - level


AXIAL_COSINE = 1e-9
"""Cosine of a tilt at which the plane runs along the axis, to rounding."""


def _half_angle(height: float, across: float) -> float:
    """Return half the wet arc [rad] of the slice whose middle is ``height`` below the plane."""
    if height >= across:
        return math.pi
    if height <= -across:
        return 0.0
    return math.acos(-height / across)


def _segment(phi: float) -> float:
    """Return the area of a segment of the unit disc with half angle ``phi``."""
    return phi - math.sin(phi) * math.cos(phi)


def _mean_segment(a: float, b: float) -> float:
    """Return the mean of the segment's area as its height changes from half angle ``a`` to ``b``.

    The integral of phi - sin phi cos phi over the height -cos phi, divided by the change of height.
    It is written with half sum m and half difference d, which keeps the digits where the ends meet.
    """
    m, d = 0.5 * (a + b), 0.5 * abs(b - a)
    sine, cosine = math.sin(m), math.cos(m)
    if sine <= 0.0 or d == 0.0:
        return _segment(m)
    spread = _one_less_cotangent(d) + math.sin(d) ** 2 * (1.0 - 4.0 / 3.0 * cosine**2)
    return _segment(m) + cosine / sine * spread


def _one_less_cotangent(d: float) -> float:
    """Return 1 - d cot d, by its series where d is small."""
    if d > 0.05:
        return 1.0 - d / math.tan(d)
    x = d * d
    return x * (1.0 / 3.0 + x * (1.0 / 45.0 + x * (2.0 / 945.0 + x / 4725.0)))
