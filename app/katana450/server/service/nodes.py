"""Access to the links of a running arm by name; an extension adds the nodes of the VRML world."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping

from katana450.arm.control import commands as cmd
from katana450.arm.control.state import State
from katana450.arm.robot.robot import Robot
from katana450.server.api import answers, requests


class Nodes(ABC):
    """Nodes of a robot and its environment by name, and the poses of its links."""

    def __init__(self, robot: Robot) -> None:
        self._robot = robot

    def links(self, state: State) -> answers.Links:
        """Return the poses of all links."""
        frames = self._robot.frames(self._values(state))
        return answers.Links(links=[answers.Link(name=n, T=T.tolist()) for n, T in frames.items()])

    def _values(self, state: State) -> Mapping[str, float]:
        return self._robot.joint_values(state.q, state.gripper)

    @abstractmethod
    def world(self, state: State) -> answers.World:
        """Return all nodes with their present values."""

    @abstractmethod
    def read(self, state: State, fields: Iterable[requests.FieldName]) -> tuple[answers.Value, ...]:
        """Return the present values of the fields. Raises InputError for an unknown name."""

    @abstractmethod
    def command(self, state: State, settings: Iterable[requests.FieldSetting]) -> cmd.Command:
        """Return the command that sets all fields. Raises InputError if one cannot be set."""
