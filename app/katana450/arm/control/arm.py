"""The arm as the controller knows it: a kinematic chain, its tools and its gripper."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

from katana450.errors import InputError
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.chain import Chain
from katana450.maths.motion.limiter import Limits


@dataclass(frozen=True)
class GripperModel:
    """The driven finger joint: limits [rad], greatest speed [rad/s]; ``lower`` is closed.

    Where it slides, its numbers are in m and m/s. That of an arm without fingers has nowhere to go.
    """

    lower: float
    upper: float
    speed: float
    slides: bool = False

    @property
    def moves(self) -> bool:
        """Whether there is anything to open."""
        return self.lower < self.upper

    def clamp(self, value: float) -> float:
        """The nearest to ``value`` [rad or m] inside the limits."""
        return min(max(value, self.lower), self.upper)


SPEED_RISE_TIME = 0.9
"""[s] Until a joint runs at its greatest speed, as the Katana's own controllers have it at the
quicker of their two settings."""

ACCELERATION_RISE_TIME = 0.1
"""[s] Until it accelerates as it may."""

NO_GRIPPER = GripperModel(0.0, 0.0, 0.0)


@dataclass(frozen=True, eq=False)
class ArmModel:
    """A 5-axis arm with interchangeable tool frames.

    Attributes:
        chain: the joints in frame {S}; its ``M`` is that of ``default_tool``.
        tools: home configuration M, (4, 4) in {S}, of each named tool frame.
        default_tool: a key of ``tools``.
        gripper: the finger joint, or ``NO_GRIPPER``.
        acceleration, jerk: (n,) the most of each joint [rad/s^2, rad/s^3]; None where nobody says.
    """

    chain: Chain
    tools: Mapping[str, FloatArray]
    default_tool: str
    gripper: GripperModel
    acceleration: FloatArray | None = None
    jerk: FloatArray | None = None

    @property
    def slides(self) -> tuple[bool, ...]:
        """(n,) whether each joint is prismatic: none is."""
        return (False,) * self.chain.n

    @cached_property
    def limits(self) -> Limits:
        """Of the joints' motion, gentle where nobody says."""
        chain = self.chain
        gentle = limits_of(chain.lower, chain.upper, chain.speed, self.acceleration)
        return gentle if self.jerk is None else replace(gentle, jerk=self.jerk)

    @cached_property
    def chains(self) -> Mapping[str, Chain]:
        """The same joints once for each tool."""
        return {name: self.chain.with_tool(M) for name, M in self.tools.items()}

    def chain_to(self, tool: str) -> Chain:
        """The chain that ends in ``tool``; InputError names the tools there are."""
        try:
            return self.chains[tool]
        except (KeyError, TypeError):
            known = ", ".join(self.tools)
            raise InputError(f"There is no tool {tool!r}; this arm has {known}.") from None


def limits_of(
    lower: FloatArray, upper: FloatArray, speed: FloatArray, acceleration: FloatArray | None = None
) -> Limits:
    """Gentle ones of joints whose own, (n,) each, say no more."""
    acceleration = speed / SPEED_RISE_TIME if acceleration is None else acceleration
    return Limits(lower, upper, speed, acceleration, acceleration / ACCELERATION_RISE_TIME)
