"""The view of a robot: one viser server with one scene for all browsers."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable, Mapping, Sequence

import numpy as np
import viser

from katana450.arm.control.session.session import Session
from katana450.arm.control.state.messages import title
from katana450.arm.control.state.modes import JointTarget, PoseTarget
from katana450.arm.control.state.state import State, Status
from katana450.arm.robot.arm_reader import MountedArm
from katana450.arm.robot.object_meshes import Meshes
from katana450.arm.robot.props import load_props
from katana450.arm.robot.robot import Robot
from katana450.arm.runtime.pipes.state_publisher import Snapshot, StatePublisher
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.forward import forward
from katana450.server.view.cameras import Cameras, initial_camera, scale_of
from katana450.server.view.controls import GestureGate
from katana450.server.view.gizmo import Gizmo
from katana450.server.view.layer import AddFolders, ViewLayer
from katana450.server.view.panel import READOUT_INTERVAL, Panel
from katana450.server.view.readout import style
from katana450.server.view.scene import Colour, Gap, GhostNodes
from katana450.server.view.scenery import Scenery

GHOST_COLOURS: dict[Status, Colour] = {
    Status.OK: (64, 156, 255),
    Status.LIMITED: (255, 153, 0),
    Status.GAP: (234, 88, 12),
    Status.BLOCKED: (255, 153, 0),
    Status.PAUSED: (120, 130, 145),
    Status.STOPPED: (230, 45, 45),
    Status.FAULT: (230, 45, 45),
}

SETPOINT_COLOUR: Colour = (120, 130, 145)

GOAL, SETPOINT = "/ghost", "/setpoint"
"""Nodes of the ghosts."""

OPACITY = {GOAL: 0.35, SETPOINT: 0.2}

FRAME_RATE = 60.0
"""[Hz] Maximum rate of updates of the scene."""

GHOST_FROM = np.deg2rad(0.2)
"""Distance [rad] of a joint from its goal, or its setpoint, above which a ghost is shown."""

log = logging.getLogger(__name__)


class ToolNodes:
    """The nodes of the tool's goal: the handle, and a line to it from the target."""

    def __init__(
        self,
        server: viser.ViserServer,
        arm: MountedArm,
        gestures: GestureGate,
        current: Callable[[], State],
        scale: float,
    ) -> None:
        """Add the nodes to the scene; see ``Gizmo``."""
        self._arm = arm
        self._gap = Gap(server)
        self.gizmo = Gizmo(server, arm, gestures, current, scale)
        self._goal: FloatArray | None = None
        self._tool = ""
        self._T_base_goal = np.eye(4)

    def follow(self, state: State) -> None:
        """Show the goal and the target of ``state``."""
        # Goals are immutable: a changed goal is another array.
        if state.goal is not self._goal or state.tool != self._tool:
            self._goal, self._tool = state.goal, state.tool
            chain = self._arm.chain_to(state.tool)
            self._T_base_goal = self._arm.T_base_shoulder @ forward(chain, state.goal)
            self.gizmo.aim(state, self._T_base_goal)
        self.gizmo.follow()
        self._gap.show(self._desired(state), self._T_base_goal[:3, 3])

    def _desired(self, state: State) -> FloatArray | None:
        """Return the tool point (3,) [m] of the target in the base frame; None without one."""
        match state.target:
            case PoseTarget(T=T):
                p = T[:3, 3]
            case JointTarget():
                return None
            case target:
                p = target.position
        T_base_shoulder = self._arm.T_base_shoulder
        return T_base_shoulder[:3, :3] @ p + T_base_shoulder[:3, 3]


class ViewUpdater:
    """Shows new snapshots, up to a maximum number per second. The base shows nothing.

    Attributes:
        failed: set when the view has ended with an error.
    """

    def __init__(
        self, server: viser.ViserServer, state_publisher: StatePublisher, frame_rate: float
    ) -> None:
        """Prepare the thread; ``frame_rate``: maximum number of updates per second [Hz]."""
        self._server = server
        self._state_publisher = state_publisher
        self._interval = 1.0 / frame_rate
        self._stopping = threading.Event()
        self.failed = threading.Event()
        self._thread = threading.Thread(target=self._run, name="view", daemon=True)

    def start(self) -> None:
        """Start to follow the control loop, with the panel."""
        self._thread.start()

    def stop(self) -> None:
        """End the thread and wait for it."""
        self._stopping.set()
        self._state_publisher.wake()
        if self._thread.is_alive():
            self._thread.join()

    def show(self, snapshot: Snapshot) -> None:
        """Send the changes in ``snapshot`` to every browser."""

    def show_panel(self, snapshot: Snapshot) -> None:
        """Send what may follow the scene: it does not delay the picture of a drag."""

    def _run(self) -> None:
        try:
            self._follow()
        except Exception:
            log.exception("The view met an error.")
            self.failed.set()

    def _follow(self) -> None:
        shown = self._state_publisher.snapshot
        settled = True
        while not self._stopping.is_set():
            # The read-out has a longer interval and needs one more update after the last change.
            snapshot = self._state_publisher.wait_for_change(
                shown, 0.5 if settled else READOUT_INTERVAL, self._stopping.is_set
            )
            settled = snapshot is shown
            shown = snapshot
            due = time.perf_counter() + self._interval
            self.show(snapshot)
            # The scene is on its way meanwhile.
            self._state_publisher.wait_for_command(snapshot, self._interval / 2)
            self.show_panel(snapshot)
            # Motion is shown at the frame rate, the effect of a command immediately.
            self._state_publisher.wait_for_command(snapshot, due - time.perf_counter())


class View(ViewUpdater):
    """Shows each new snapshot to every browser; submits what people do."""

    def __init__(
        self,
        server: viser.ViserServer,
        robot: Robot,
        state_publisher: StatePublisher,
        gestures: GestureGate,
        last_ticket: Callable[[], int],
        session: Session,
        layers: Sequence[ViewLayer],
        meshes: Meshes,
    ) -> None:
        """Build the scene.

        Args:
            server: viser's server.
            robot: The robot. Without an arm it has no gizmo.
            state_publisher: The source of snapshots.
            gestures: The path of gestures to the arm.
            last_ticket: Returns the ticket of the newest command.
            session: The session, which has the branch options and the environment of objects.
            layers: Layers of extensions, which the robot can have.
            meshes: The meshes of scene objects.

        Raises:
            KatanaError: A layer cannot be shown.
        """
        super().__init__(server, state_publisher, FRAME_RATE)
        server.gui.set_panel_label(title(robot.name))
        self._robot = robot
        self._gestures, self._choices = gestures, session.choices
        self._last_ticket = last_ticket
        props = load_props()
        self._scenery = Scenery(server, robot, session, props, gestures, meshes, layers)
        self._ghosts: dict[str, GhostNodes] = {}
        self._tool: ToolNodes | None = None
        if robot.arm is not None:
            self._tool = ToolNodes(
                server,
                robot.arm,
                gestures,
                lambda: state_publisher.snapshot.state,
                scale_of(robot),
            )
        self._cameras = Cameras(server, robot)
        look = initial_camera(robot)
        if look is not None:
            server.initial_camera.position, server.initial_camera.look_at = look.eye, look.target
        self.show(state_publisher.snapshot)

    def add_panel(self, folders: AddFolders) -> None:
        """Add the panel, with the controls of extensions, and the ghost. Raises KatanaError."""
        snapshot, server, gestures = self._state_publisher.snapshot, self._server, self._gestures
        with server.atomic():
            # A drag shall not wait for it.
            self._ghost(GOAL, GHOST_COLOURS[Status.OK])
            self._panel = Panel(server, self._robot, gestures, self._choices, snapshot.state)
            self._folders = tuple(folders())
            self._cameras.add_buttons(server.gui, lambda: self._state_publisher.snapshot.state)
            # At the end of the panel, because the element takes an empty line.
            server.gui.add_html(style())
        self.show_panel(snapshot)

    def show(self, snapshot: Snapshot) -> None:
        """Send the changes of the scene in ``snapshot`` to every browser."""
        state = snapshot.state
        with self._server.atomic():
            self._scenery.show(state)
            self._show_goal(state)
            self._cameras.follow(state)
        self._server.flush()

    def show_panel(self, snapshot: Snapshot) -> None:
        """Send the changes of the panel in ``snapshot`` to every browser."""
        with self._server.atomic():
            caught_up = snapshot.ticket == self._last_ticket()
            self._panel.follow(snapshot.state, time.perf_counter(), caught_up=caught_up)
            for folder in self._folders:
                folder.follow()

    def _show_goal(self, state: State) -> None:
        away = float(np.abs(state.goal - state.q).max()) > GHOST_FROM
        visible = away or state.status is not Status.OK
        values = self._robot.joint_values(state.goal, state.gripper_goal)
        self._show_ghost(GOAL, GHOST_COLOURS[state.status], values if visible else None)
        # A measured arm lags behind its setpoint, where it will be soon.
        lags = float(np.abs(state.setpoint - state.q).max()) > GHOST_FROM
        values = self._robot.joint_values(state.setpoint, state.gripper_setpoint)
        self._show_ghost(SETPOINT, SETPOINT_COLOUR, values if lags else None)
        if self._tool is not None:
            self._tool.follow(state)

    def _show_ghost(self, root: str, colour: Colour, values: Mapping[str, float] | None) -> None:
        """Show the ghost ``root`` at the joint ``values`` [rad or m]; None hides it."""
        if values is not None or root in self._ghosts:
            self._ghost(root, colour).show(values is not None, colour)
        if values is not None:
            self._ghost(root, colour).move(values)

    def _ghost(self, root: str, colour: Colour) -> GhostNodes:
        """Return the ghost ``root``, which is made at its first use."""
        if root not in self._ghosts:
            self._ghosts[root] = GhostNodes(self._server, self._robot, root, colour, OPACITY[root])
        return self._ghosts[root]
