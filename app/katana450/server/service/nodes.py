"""The links of a running arm by their names, and what an extension names besides."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from katana450.arm.control import commands as cmd
from katana450.arm.control.state import State
from katana450.arm.robot.robot import Robot
from katana450.errors import InputError
from katana450.server.api import answers, requests


class Nodes:
    """Where the links are. An extension that names more overrides the other methods."""

    def __init__(self, robot: Robot) -> None:
        self._robot = robot

    def links(self, state: State) -> answers.Links:
        """Return where every link is."""
        frames = self._robot.frames(self._values(state))
        return answers.Links(links=[answers.Link(name=n, T=T.tolist()) for n, T in frames.items()])

    def _values(self, state: State) -> Mapping[str, float]:
        return self._robot.joint_values(state.q, state.gripper)

    def world(self, state: State) -> answers.World:  # noqa: ARG002
        """Return all nodes with their present values."""
        return answers.World(nodes=[])

    def read(self, state: State, asked: Iterable[requests.FieldName]) -> tuple[answers.Value, ...]:  # noqa: ARG002
        """Return what the fields are now. Raises InputError for a name that there is not."""
        raise _not_installed()

    def command(self, state: State, settings: Iterable[requests.FieldSetting]) -> cmd.Command:  # noqa: ARG002
        """Return what sets all of these. Raises InputError if one of them cannot be set."""
        raise _not_installed()


def _not_installed() -> InputError:
    return InputError("There are no nodes: the extension that names them is not installed.")
