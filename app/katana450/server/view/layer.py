"""Layers that extensions add to the scene of an arm."""

from __future__ import annotations

from typing import Protocol

import viser

from katana450.arm.robot.robot import Robot


class ViewLayer(Protocol):
    """Nodes of the scene with controls in the folder "Show" of the panel."""

    @property
    def what(self) -> str:
        """Sentence that names the requested feature, which needs an arm.

        If it is empty, the layer is left out for a robot without an arm.
        """

    def attach(self, server: viser.ViserServer, robot: Robot) -> None:
        """Prepare for the arm of ``robot`` on ``server``. Raises ConfigurationError."""

    def add_controls(self, gui: viser.GuiApi) -> None:
        """Add the controls to the open folder of ``gui``. Called once, after ``attach``."""
