"""A motion of one axis to a target, with limited speed and acceleration."""

from __future__ import annotations

import math


class TargetMove:
    """A setpoint that speeds up, travels, and slows down to rest at its target.

    Attributes:
        position: the setpoint [counts].
        speed: its speed [counts/s].
        target: where it ends [counts].
    """

    def __init__(self, position: float, speed: float, target: float) -> None:
        self.position = position
        self.speed = speed
        self.target = target

    @property
    def is_done(self) -> bool:
        """True once the setpoint rests at the target."""
        return self.position == self.target and self.speed == 0.0

    def advance(self, dt: float, max_speed: float, acceleration: float) -> None:
        """Move the setpoint for ``dt`` [s] within limits [counts/s] and [counts/s^2]."""
        distance = self.target - self.position
        # The fastest speed from which the rest of the way is enough to brake.
        allowed = min(math.sqrt(2.0 * acceleration * abs(distance)), max_speed)
        wanted = math.copysign(allowed, distance)
        change = acceleration * dt
        speed = self.speed + min(max(wanted - self.speed, -change), change)
        if abs(distance) <= abs(speed) * dt and abs(speed) <= change + allowed:
            self.position, self.speed = self.target, 0.0
            return
        self.position += speed * dt
        self.speed = speed
