"""Access to the links of a running arm by name; an extension adds the nodes of the VRML world."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from katana450.arm.control import commands as cmd
from katana450.arm.control.state import State
from katana450.arm.robot.robot import Robot
from katana450.errors import InputError
from katana450.server.api import answers, requests


class Nodes:
    """Poses of the links. An extension with further nodes overrides the other methods."""

    def __init__(self, robot: Robot) -> None:
        self._robot = robot

    def links(self, state: State) -> answers.Links:
        """Return the poses of all links."""
        frames = self._robot.frames(self._values(state))
        return answers.Links(links=[answers.Link(name=n, T=T.tolist()) for n, T in frames.items()])

    def _values(self, state: State) -> Mapping[str, float]:
        return self._robot.joint_values(state.q, state.gripper)

    def world(self, state: State) -> answers.World:  # noqa: ARG002
        """Return all nodes with their present values."""
        return answers.World(nodes=[])

    def read(self, state: State, fields: Iterable[requests.FieldName]) -> tuple[answers.Value, ...]:  # noqa: ARG002
        """Return the present values of the fields. Raises InputError for an unknown name."""
        raise _not_installed()

    def command(self, state: State, settings: Iterable[requests.FieldSetting]) -> cmd.Command:  # noqa: ARG002
        """Return the command that sets all fields. Raises InputError if one cannot be set."""
        raise _not_installed()


def _not_installed() -> InputError:
    return InputError("There are no nodes. Install the extension that provides them.")
