"""A folder of controls that an extension adds to the panel of an arm."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Callable
from typing import NamedTuple, Protocol

import viser

from katana450.arm.control.state import State
from katana450.arm.robot.robot import Robot
from katana450.server.service.hub import Hub
from katana450.server.view.controls import GestureGate


class PanelFolder(Protocol):
    """Controls of an extension in a folder of their own, with what they show in the scene."""

    def follow(self) -> None:
        """Show what has changed. Called for each state that is shown, in the view's thread."""


class FolderContext(NamedTuple):
    """What a folder of an extension can use.

    Attributes:
        server: viser's server, with the panel.
        robot: The robot, which has an arm.
        gestures: The path of gestures to the arm.
        state: Returns the newest state.
        hub: The arm and who drives it, with the runner of the server.
        call: Runs a function in the server's thread and returns afterwards. Raises what that
            raises, and LeaseError where the server does not answer.
        options: Options of ``katana450 serve``.
    """

    server: viser.ViserServer
    robot: Robot
    gestures: GestureGate
    state: Callable[[], State]
    hub: Hub
    call: Callable[[Callable[[], None]], None]
    options: Namespace
