"""The arm that a session drives, with its tools and gripper, or the joints of a mechanism."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from katana450.arm.control.tool_kinematics import FiveAxisTool, ToolKinematics
from katana450.caching import cached_property
from katana450.errors import InputError
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.kinematics.chain import Chain
from katana450.maths.motion.limiter import Limits


@dataclass(frozen=True)
class GripperModel:
    """The driven finger joint: its closed and its open end [rad] and maximum speed [rad/s].

    The numbers of a sliding joint are in m and m/s. An arm without fingers has an empty range. A
    suction cup (``is_cup``) is on unless it is open.
    """

    closed: float
    opened: float
    speed: float
    slides: bool = False
    is_cup: bool = False

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


SPEED_RISE_TIME = 0.9
"""[s] Time until a joint reaches its maximum speed, as in the faster of the two settings of the
Katana's own controllers."""

ACCELERATION_RISE_TIME = 0.1
"""[s] Time until a joint reaches its maximum acceleration."""


@dataclass(frozen=True, eq=False)
class ArmModel:
    """An arm with interchangeable tool frames.

    Attributes:
        chain: the joints in frame {S}; its ``M`` is that of ``default_tool``.
        tools: home configuration M, (4, 4) in {S}, of each named tool frame.
        default_tool: a key of ``tools``.
        gripper: the finger joint, or ``NO_GRIPPER``.
        acceleration, jerk: (n,) maximum of each joint [rad/s^2, rad/s^3]; None if unknown.
        to_tool: returns the kinematics of a chain to a tool.
    """

    chain: Chain
    tools: Mapping[str, FloatArray]
    default_tool: str
    gripper: GripperModel
    acceleration: FloatArray | None = None
    jerk: FloatArray | None = None
    to_tool: Callable[[Chain], ToolKinematics] = FiveAxisTool

    @property
    def arm(self) -> ArmModel:
        """The arm itself: joints without a tool have none."""
        return self

    @property
    def slides(self) -> tuple[bool, ...]:
        """Flags (n,) of the prismatic joints."""
        return self.chain.slides

    @cached_property
    def limits(self) -> Limits:
        """Limits of the joints' motion; gentle defaults where the model gives no value."""
        chain = self.chain
        gentle = limits_of(chain.lower, chain.upper, chain.speed, self.acceleration)
        return gentle if self.jerk is None else replace(gentle, jerk=self.jerk)

    @cached_property
    def chains(self) -> Mapping[str, Chain]:
        """The chain to each tool, by the name of the tool."""
        return {name: self.chain.with_tool(M) for name, M in self.tools.items()}

    @cached_property
    def _kinematics(self) -> Mapping[str, ToolKinematics]:
        return {name: self.to_tool(chain) for name, chain in self.chains.items()}

    @property
    def kinematics(self) -> ToolKinematics:
        """The kinematics of the default tool; all tools have the same branches and priorities."""
        return self._kinematics[self.default_tool]

    def kinematics_to(self, tool: str) -> ToolKinematics:
        """Return the kinematics of ``tool``. Raises InputError with the names of all tools."""
        self.chain_to(tool)
        return self._kinematics[tool]

    def chain_to(self, tool: str) -> Chain:
        """Return the chain that ends in ``tool``. Raises InputError with the names of all tools."""
        try:
            return self.chains[tool]
        except (KeyError, TypeError):
            known = ", ".join(self.tools)
            raise InputError(f"There is no tool {tool!r}; this arm has {known}.") from None


def limits_of(
    lower: FloatArray, upper: FloatArray, speed: FloatArray, acceleration: FloatArray | None = None
) -> Limits:
    """Return the limits of joints; gentle defaults where no acceleration is given.

    lower, upper: (n,) [rad or m]. speed, acceleration: (n,) in the units of these per s and s^2.
    """
    acceleration = speed / SPEED_RISE_TIME if acceleration is None else acceleration
    return Limits(lower, upper, speed, acceleration, acceleration / ACCELERATION_RISE_TIME)


@dataclass(frozen=True, eq=False)
class JointSet:
    """The driven joints of a mechanism, which follow no other joint.

    Attributes:
        names: name of each joint, in the order of every joint vector.
        slides: whether each joint is prismatic; its numbers are in m then, else in rad.
        lower, upper, speed: (n,) limits.
        why: a sentence on why no tool of the mechanism can be brought to a pose.
    """

    names: tuple[str, ...]
    slides: tuple[bool, ...]
    lower: FloatArray
    upper: FloatArray
    speed: FloatArray
    why: str

    arm: ClassVar[None] = None

    @property
    def n(self) -> int:
        """Number of driven joints."""
        return len(self.names)

    @property
    def limits(self) -> Limits:
        """Limits of position, speed, acceleration and jerk of the joints."""
        return limits_of(self.lower, self.upper, self.speed)

    @property
    def refusal(self) -> str:
        """The refusal of a command about a tool, in sentences."""
        return f"Only its joints can be driven. {self.why}"

    @property
    def gripper(self) -> GripperModel:
        """No gripper: the fingers are joints like any other."""
        return NO_GRIPPER

    @property
    def ready(self) -> FloatArray:
        """The posture (n,) with all joints at zero, or at the limit nearest to zero."""
        return self.clamp(np.zeros(self.n))

    def clamp(self, q: FloatArray) -> FloatArray:
        """Return the posture inside the limits that is nearest to ``q`` (n,)."""
        return frozen(np.clip(q, self.lower, self.upper))

    def check(self, q: FloatArray) -> None:
        """Raise InputError unless ``q`` has n numbers."""
        if q.shape != (self.n,):
            raise InputError(
                f"This mechanism has {self.n} driven joints, but the command has {q.size}."
            )
