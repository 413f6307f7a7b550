"""The tabs of the panel, and the controls that an extension adds to one."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Callable, Iterable
from typing import NamedTuple, Protocol

import viser

from katana450.arm.control.state.state import State
from katana450.arm.robot.robot import Robot
from katana450.server.service.hub import Hub
from katana450.server.view.controls import GestureGate
from katana450.server.view.display_options import add_themes

DRIVE, SCENE = "Drive", "Scene"
"""Labels of the tabs of the core. The tabs of built-in extensions are between them."""


class PanelTabs:
    """The tabs of a panel. A tab exists as soon as something is put into it."""

    def __init__(self, gui: viser.GuiApi) -> None:
        """Add the empty group of tabs to ``gui``."""
        self._gui = gui
        self._group = gui.add_tab_group()
        self._tabs: dict[str, viser.GuiTabHandle] = {}

    def tab(self, label: str) -> viser.GuiTabHandle:
        """Return the tab ``label``, a context in which controls are added to it."""
        if label not in self._tabs:
            self._tabs[label] = self._group.add_tab(label)
            if label == SCENE:
                with self._tabs[label]:
                    add_themes(self._gui)
        return self._tabs[label]


class PanelFolder(Protocol):
    """The controls of an extension, and the nodes that it shows in the scene."""

    def follow(self) -> None:
        """Show changes. Called in the view's thread for each state that is shown."""


AddFolders = Callable[[PanelTabs], Iterable[PanelFolder]]
"""Function that adds the controls of extensions to the tabs. Raises KatanaError."""


class FolderContext(NamedTuple):
    """The parts of the server that a folder of an extension can use.

    Attributes:
        server: viser's server, with the panel.
        robot: The robot. It has no arm if it is driven joint by joint.
        gestures: The path of gestures to the arm.
        state: Returns the newest state.
        hub: The arm and its driver, with the runner of the server.
        call: Runs a function in the server's thread and returns afterwards. Raises the errors of
            the function, and LeaseError if the server does not answer.
        options: Options of ``katana450 serve``.
        tabs: The tabs of the panel. An extension opens the one in which its controls stand, by its
            label, and adds the controls to it. A new label is a new tab.
    """

    server: viser.ViserServer
    robot: Robot
    gestures: GestureGate
    state: Callable[[], State]
    hub: Hub
    call: Callable[[Callable[[], None]], None]
    options: Namespace
    tabs: PanelTabs
