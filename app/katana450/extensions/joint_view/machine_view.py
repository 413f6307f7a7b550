"""The view of a robot that can only be driven joint by joint."""

from __future__ import annotations

import time
from collections.abc import Callable

import viser

from katana450.arm.control.messages import title
from katana450.arm.control.session import Session
from katana450.arm.robot.initial_camera import camera
from katana450.arm.robot.props import load_props
from katana450.arm.robot.robot import Robot
from katana450.arm.runtime.state_publisher import Snapshot, StatePublisher
from katana450.extensions.joint_view.machine_panel import MachinePanel
from katana450.extensions.objects.handles import ObjectHandles
from katana450.server.view.controls import GestureGate
from katana450.server.view.paint import PaintNodes
from katana450.server.view.panel_folder import AddFolders
from katana450.server.view.room import set_up_room
from katana450.server.view.scene import ArmNodes
from katana450.server.view.scene_objects import SceneObjectNodes
from katana450.server.view.tint import Tint
from katana450.server.view.view import ViewOptions
from katana450.server.view.view_updater import ViewUpdater

FLOOR_GAP = 5e-4
"""Depth [m] of the floor below the table that is checked, so that objects on it do not flicker."""


class MachineView(ViewUpdater):
    """The links of the robot, objects, and a panel with joints and objects. There is no gizmo.

    Extensions add controls by the same hook as for an arm.
    """

    def __init__(
        self,
        server: viser.ViserServer,
        robot: Robot,
        state_publisher: StatePublisher,
        gestures: GestureGate,
        last_ticket: Callable[[], int],
        session: Session,
        frame_rate: float,
        view_options: ViewOptions,
    ) -> None:
        """Build the scene.

        Args:
            server: viser's server.
            robot: The robot.
            state_publisher: The source of snapshots.
            gestures: The path of gestures to the arm.
            last_ticket: Returns the ticket of the newest command.
            session: The session, which has the environment of objects.
            frame_rate: Maximum number of updates per second [Hz].
            view_options: The meshes of scene objects.
        """
        super().__init__(server, state_publisher, frame_rate)
        self._robot, self._gestures = robot, gestures
        self._last_ticket = last_ticket
        environment = session.environment
        set_up_room(server, environment.table_height - FLOOR_GAP)
        server.gui.set_panel_label(title(robot.name))
        look = camera(robot)
        server.initial_camera.position = look.eye
        server.initial_camera.look_at = look.target
        self._nodes = ArmNodes(server, robot)
        self._paint = PaintNodes(server, self._nodes)
        self._tint = Tint(server, robot, self._nodes.path)
        self._objects = SceneObjectNodes(server, load_props(), environment, view_options.meshes)
        self._handles = ObjectHandles(server, environment, gestures)
        self.show(state_publisher.snapshot)

    def add_panel(self, folders: AddFolders) -> None:
        """Add the panel, with the controls of extensions. Raises KatanaError."""
        state, gui = self._state_publisher.snapshot.state, self._server.gui
        with self._server.atomic():
            self._panel = MachinePanel(gui, self._robot, self._gestures, state, folders)
        self._panel.handles.on_update(lambda _: self._handles.show(self._panel.handles.value))

    def show(self, snapshot: Snapshot) -> None:
        """Send the changes in ``snapshot`` to every browser."""
        state = snapshot.state
        with self._server.atomic():
            self._nodes.move(self._robot.joint_values(state.q, state.gripper))
            self._objects.follow(state)
            self._handles.follow(state)
            self._paint.follow(state)
            self._tint.follow(state)
        self._server.flush()

    def show_panel(self, snapshot: Snapshot) -> None:
        """Send the changes of the panel in ``snapshot`` to every browser."""
        with self._server.atomic():
            caught_up = snapshot.ticket == self._last_ticket()
            self._panel.follow(snapshot.state, time.perf_counter(), caught_up=caught_up)
