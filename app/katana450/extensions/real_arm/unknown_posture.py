"""The scene of an arm that is not connected: nobody knows where its links are."""

from __future__ import annotations

from katana450.arm.control.state.arm_report import ArmMode
from katana450.arm.control.state.state import State
from katana450.sdk import LayerContext, ViewLayer


class UnknownPosture(ViewLayer):
    """Hides the links of an arm that is not connected. The ghost of a stopped arm stays.

    The card of the arm says in words that there is no connection.
    """

    def attach(self, context: LayerContext) -> None:
        """Take the nodes of the arm."""
        self._arm = context.arm

    def follow(self, state: State) -> None:
        """Hide the links if the arm of ``state`` is not connected; else show them."""
        report = state.report
        self._arm.show_moving(report is None or report.mode is not ArmMode.DISCONNECTED)
