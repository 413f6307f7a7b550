"""The part of an extension in the panel and the scene of viser."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Callable, Iterable
from typing import NamedTuple, Protocol

import viser

from katana450.arm.control.state.state import State
from katana450.arm.robot.robot import Robot
from katana450.server.service.hub import Hub
from katana450.server.view.controls import GestureGate


class PanelFolder(Protocol):
    """The view of an extension: nodes in the scene, or a folder below the controls of the arm."""

    def follow(self) -> None:
        """Show changes. Called in the view's thread for each state that is shown."""


AddFolders = Callable[[], Iterable[PanelFolder]]
"""Function that adds the folders of extensions. Raises KatanaError."""


class FolderContext(NamedTuple):
    """The parts of the server that a folder of an extension can use.

    Attributes:
        server: viser's server. Controls stand in a folder of their own (``gui.add_folder``).
        robot: The robot. It has no arm if it is driven joint by joint.
        gestures: The path of gestures to the arm.
        state: Returns the newest state.
        hub: The arm and its driver, with the runner of the server.
        options: Options of ``katana450 serve``.
    """

    server: viser.ViserServer
    robot: Robot
    gestures: GestureGate
    state: Callable[[], State]
    hub: Hub
    options: Namespace
