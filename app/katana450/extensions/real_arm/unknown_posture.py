"""The scene of an arm that is not connected: nobody knows where its links are."""

from __future__ import annotations

from typing import Final

from katana450.arm.control.arm_report import ArmMode
from katana450.arm.control.state import State
from katana450.server.view.layer import LayerContext, ViewLayer

TEXT: Final = "Not connected: the posture of the arm is not known"

ABOVE: Final = 0.3
"""[m] Height of the text above the shoulder."""


class UnknownPosture(ViewLayer):
    """Hides the links of an arm that is not connected, and says why.

    The ghost, which a stopped arm has, stays.
    """

    def attach(self, context: LayerContext) -> None:
        """Add the text, hidden."""
        self._arm = context.arm
        x, y, z = context.robot.require_arm().T_base_shoulder[:3, 3].tolist()
        self._text = context.server.scene.add_label(
            "/unknown_posture",
            TEXT,
            position=(x, y, z + ABOVE),
            anchor="bottom-center",
            visible=False,
        )

    def follow(self, state: State) -> None:
        """Hide the links if the arm of ``state`` is not connected; else show them."""
        report = state.report
        unknown = report is not None and report.mode is ArmMode.DISCONNECTED
        self._arm.show_moving(not unknown)
        if self._text.visible != unknown:
            self._text.visible = unknown
