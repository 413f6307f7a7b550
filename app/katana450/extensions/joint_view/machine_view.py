"""The view of a robot that can only be driven joint by joint."""

from __future__ import annotations

import time
from collections.abc import Callable

import viser

from katana450.arm.control.messages import title
from katana450.arm.robot.initial_camera import camera
from katana450.arm.robot.robot import Robot
from katana450.arm.runtime.state_publisher import Snapshot, StatePublisher
from katana450.extensions.joint_view.machine_nodes import MachineNodes
from katana450.extensions.joint_view.machine_panel import MachinePanel
from katana450.server.view.controls import GestureGate
from katana450.server.view.paint import PaintNodes
from katana450.server.view.room import set_up_room
from katana450.server.view.tint import Tint
from katana450.server.view.view_updater import ViewUpdater


class MachineView(ViewUpdater):
    """The links of the robot and a panel with its joints. The scene has no gizmo."""

    def __init__(
        self,
        server: viser.ViserServer,
        robot: Robot,
        state_publisher: StatePublisher,
        gestures: GestureGate,
        last_ticket: Callable[[], int],
        frame_rate: float,
    ) -> None:
        """Build the scene and the panel.

        Args:
            server: viser's server.
            robot: The robot.
            state_publisher: The source of snapshots.
            gestures: The path of gestures to the arm.
            last_ticket: Returns the ticket of the newest command.
            frame_rate: Maximum number of updates per second [Hz].
        """
        super().__init__(server, state_publisher, frame_rate)
        self._robot = robot
        self._last_ticket = last_ticket
        set_up_room(server)
        server.gui.set_panel_label(title(robot.name))
        look = camera(robot)
        server.initial_camera.position = look.eye
        server.initial_camera.look_at = look.target
        self._nodes = MachineNodes(server, robot)
        self._paint = PaintNodes(server, self._nodes)
        self._tint = Tint(server, robot, self._nodes.path)
        self._panel = MachinePanel(server.gui, robot, gestures, state_publisher.snapshot.state)
        self.show(state_publisher.snapshot)

    def show(self, snapshot: Snapshot) -> None:
        """Send the changes in ``snapshot`` to every browser."""
        state = snapshot.state
        with self._server.atomic():
            self._nodes.move(self._robot.joint_values(state.q, state.gripper))
            self._paint.follow(state)
            self._tint.follow(state)
            self._panel.follow(
                state,
                time.perf_counter(),
                self._state_publisher.event_log,
                caught_up=snapshot.ticket == self._last_ticket(),
            )
        self._server.flush()
