"""The links of a running arm by their names, and what an extension names besides."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass

from katana450.arm.control import commands as cmd
from katana450.arm.control.state import State
from katana450.arm.robot.machine import Machine
from katana450.arm.robot.mechanism import Mechanism
from katana450.arm.robot.model import RobotModel
from katana450.errors import InputError
from katana450.server.api import answers, requests


@dataclass(frozen=True, eq=False)
class Body:
    """What moves, and by which commands.

    Attributes:
        axes: the joints that are axes of the arm, with their numbers from 0.
        gripper: the driven finger joint, if there is one.
        values: of every movable joint [rad, m].
        links: those there are.
        fingers: the finger joints, which move together.
    """

    axes: Mapping[str, int]
    gripper: str | None
    values: Callable[[State], Mapping[str, float]]
    links: frozenset[str]
    fingers: frozenset[str] = frozenset()


def body_of(model: RobotModel, mechanism: Mechanism) -> Body:
    """An arm of the family; ``mechanism`` is that of the same file."""
    fingers = [name for name in model.fingers if mechanism.joints[name].leader == name]
    return Body(
        axes={name: axis for axis, name in enumerate(model.arm.chain.names)},
        gripper=fingers[0] if fingers else None,
        values=lambda state: model.joint_angles(state.q, state.gripper),
        links=frozenset(body.name for body in model.bodies),
        fingers=frozenset(model.fingers),
    )


def machine_of(machine: Machine) -> Body:
    """A mechanism that is driven joint by joint."""
    return Body(
        axes={name: axis for axis, name in enumerate(machine.joints.names)},
        gripper=None,
        values=lambda state: machine.values(state.q),
        links=frozenset(link.name for link in machine.mechanism.links),
    )


class Nodes:
    """Where the links are. An extension that names more overrides the other methods."""

    def __init__(self, mechanism: Mechanism, body: Body) -> None:
        self._mechanism = mechanism
        self._body = body

    def links(self, state: State) -> answers.Links:
        """Return where every link is."""
        frames = self._mechanism.frames(self._body.values(state))
        there = self._body.links
        return answers.Links(
            links=[answers.Link(name=n, T=T.tolist()) for n, T in frames.items() if n in there]
        )

    def world(self, state: State) -> answers.World:  # noqa: ARG002
        """Return all nodes with their present values."""
        return answers.World(nodes=[])

    def read(self, state: State, asked: Iterable[requests.Named]) -> tuple[answers.Value, ...]:  # noqa: ARG002
        """Return what the fields are now. Raises InputError for a name that there is not."""
        raise _not_installed()

    def command(self, state: State, settings: Iterable[requests.Setting]) -> cmd.Command:  # noqa: ARG002
        """Return what sets all of these. Raises InputError if one of them cannot be set."""
        raise _not_installed()


def _not_installed() -> InputError:
    return InputError("There are no nodes: the extension that names them is not installed.")
