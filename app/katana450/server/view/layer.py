"""What extensions show in the scene of an arm."""

from __future__ import annotations

from typing import Protocol

import viser

from katana450.arm.robot.robot import Robot


class ViewLayer(Protocol):
    """Nodes of the scene with controls in the folder "Show" of the panel."""

    @property
    def what(self) -> str:
        """A sentence on what was asked for and needs an arm; empty to be left out without one."""

    def attach(self, server: viser.ViserServer, robot: Robot) -> None:
        """Prepare for the arm of ``robot`` on ``server``. Raises ConfigurationError."""

    def add_controls(self, gui: viser.GuiApi) -> None:
        """Add the controls to the open folder of ``gui``. Called once, after ``attach``."""
