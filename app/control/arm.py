"""The arm as the controller knows it: a kinematic chain, its tools and its gripper."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

from app.errors import InputError
from app.geometry.arrays import FloatArray
from app.kinematics.chain import Chain


@dataclass(frozen=True)
class Gripper:
    """The driven finger joint: limits [rad], greatest speed [rad/s]; ``lower`` is closed.

    That of an arm without fingers has nowhere to go.
    """

    lower: float
    upper: float
    speed: float

    @property
    def moves(self) -> bool:
        """Whether there is anything to open."""
        return self.lower < self.upper


NO_GRIPPER = Gripper(0.0, 0.0, 0.0)


@dataclass(frozen=True, eq=False)
class Arm:
    """A 5-axis arm with interchangeable tool frames.

    Attributes:
        chain: the joints in frame {S}; its ``M`` is that of ``default_tool``.
        tools: home configuration M, (4, 4) in {S}, of each named tool frame.
        default_tool: a key of ``tools``.
        gripper: the finger joint, or ``NO_GRIPPER``.
    """

    chain: Chain
    tools: Mapping[str, FloatArray]
    default_tool: str
    gripper: Gripper

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
