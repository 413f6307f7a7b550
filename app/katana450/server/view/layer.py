"""The parts of extensions in the scene and the panel of viser."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Callable, Iterable
from typing import ClassVar, NamedTuple, Protocol

import viser

from katana450.arm.control.session.session import Session
from katana450.arm.control.state.state import State
from katana450.arm.robot.robot import Robot
from katana450.server.service.hub import Hub
from katana450.server.view.controls import GestureGate
from katana450.server.view.scene import ArmNodes


class LayerContext(NamedTuple):
    """The scene to which a layer adds nodes.

    Attributes:
        server: viser's server.
        robot: The robot, which has an arm if the layer needs one.
        session: The session, which has the environment of objects and the water model.
        arm: The nodes of the robot.
        gestures: The path of gestures to the arm.
    """

    server: viser.ViserServer
    robot: Robot
    session: Session
    arm: ArmNodes
    gestures: GestureGate


class ViewLayer:
    """Nodes of the scene that follow the state. The base has none.

    Attributes:
        needs_arm: Whether the layer is left out for a robot without an arm.
    """

    needs_arm: ClassVar[bool] = True

    def __init__(self, options: Namespace | None = None) -> None:
        """Take the options of ``katana450 serve``; None outside a server."""

    def attach(self, context: LayerContext) -> None:
        """Prepare for the arm of ``context``. Raises ConfigurationError."""

    def follow(self, state: State) -> None:
        """Show ``state``. Called for each state that is shown, so only changes may be sent."""


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
