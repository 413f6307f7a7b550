"""Model of the arm for the session: a kinematic chain, its tool frames and its gripper."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

from katana450.arm.control.objects.gripper_model import GripperModel
from katana450.arm.control.tool_kinematics import FiveAxisTool, ToolKinematics
from katana450.caching import cached_property
from katana450.errors import InputError
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.chain import Chain
from katana450.maths.motion.limiter import Limits

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
