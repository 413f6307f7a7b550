"""The joint that drives the fingers of an arm."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class GripperModel:
    """The driven finger joint: its closed and its open end [rad] and maximum speed [rad/s].

    The numbers of a sliding joint are in m and m/s. An arm without fingers has an empty range.
    """

    closed: float
    opened: float
    speed: float
    slides: bool = False

    @property
    def lower(self) -> float:
        """Lower end of the range [rad or m]."""
        return min(self.closed, self.opened)

    @property
    def upper(self) -> float:
        """Upper end of the range [rad or m]."""
        return max(self.closed, self.opened)

    @property
    def moves(self) -> bool:
        """True if the finger joint has a range."""
        return self.closed != self.opened

    def wider(self, value: float, by: float) -> float:
        """Return the value at which the fingers are wider open than at ``value`` [rad or m]."""
        return value + by if self.opened > self.closed else value - by

    def is_wider(self, one: float, other: float) -> bool:
        """Return whether the fingers are wider open at ``one`` than at ``other`` [rad or m]."""
        return one > other if self.opened > self.closed else one < other

    def clamp(self, value: float) -> float:
        """Return the value inside the limits that is nearest to ``value`` [rad or m]."""
        return min(max(value, self.lower), self.upper)


NO_GRIPPER = GripperModel(0.0, 0.0, 0.0)
