"""The view of a robot that can only be driven joint by joint."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from html import escape

import viser

from katana450.arm.control import commands as cmd
from katana450.arm.control.joints import JointSet
from katana450.arm.control.messages import signed, title
from katana450.arm.control.session import Session
from katana450.arm.control.state import State
from katana450.arm.robot.initial_camera import camera
from katana450.arm.robot.joint_labels import joint_labels
from katana450.arm.robot.props import load_props
from katana450.arm.robot.robot import Robot
from katana450.arm.runtime.state_publisher import Snapshot, StatePublisher
from katana450.extensions.objects.handles import ObjectHandles
from katana450.server.view.controls import GestureGate, Listen, ends, listener, set_slider
from katana450.server.view.display_options import LogProblem
from katana450.server.view.paint import PaintNodes, Tint
from katana450.server.view.panel_folder import DRIVE, SCENE, AddFolders, PanelTabs
from katana450.server.view.readout import style
from katana450.server.view.scene import ArmNodes
from katana450.server.view.scene_objects import SceneObjectNodes
from katana450.server.view.view import ViewOptions
from katana450.server.view.view_updater import READOUT_INTERVAL, ViewUpdater
from katana450.server.viser_bridge.themes import set_up_room

GESTURES: dict[str, cmd.Command] = {"Home": cmd.Home(), "Hold": cmd.Hold()}

STEPS = 400
"""Minimum number of steps of a slider from end to end."""


class MachinePanel:
    """The panel. Its sliders show the goal, and its read-out shows the joint values.

    Attributes:
        handles: The checkbox that shows the handles of objects.
    """

    def __init__(
        self,
        gui: viser.GuiApi,
        robot: Robot,
        gestures: GestureGate,
        state: State,
        folders: AddFolders,
    ) -> None:
        """Add the tabs to the panel.

        Args:
            gui: The panel of viser's server.
            robot: The robot.
            gestures: The path of gestures to the arm.
            state: The state that is shown first.
            folders: Adds the controls of extensions to the tabs. Raises KatanaError.
        """
        self._gui = gui
        self._joints = joints = robot.joint_group
        self._labels = joint_labels(robot)
        self._shown_at = -math.inf
        self._shown = ""
        listen: Listen = listener(gestures)
        tabs = PanelTabs(gui)
        with tabs.tab(DRIVE):
            gui.add_html(f"<div class='k450'><p><b>Joints only.</b> {escape(joints.why)}</p></div>")
            self._sliders = [self._slider(axis, state, listen) for axis in range(joints.n)]
            drive = gui.add_button_group(
                "Drive",
                tuple(GESTURES),
                hint="Home: every joint to zero, or to the limit nearest to zero. Hold: stop here.",
            )
            listen(drive, lambda: GESTURES[drive.value])
            self._readout = gui.add_html(page(joints, self._labels, state))
            gui.add_html(style())
        self._folders = tuple(folders(tabs))
        with tabs.tab(SCENE):
            self._problem = LogProblem(gui, gestures)

    def follow(self, state: State, now: float, *, caught_up: bool) -> None:
        """Show ``state`` at time ``now`` [s]; see ``Panel.follow``."""
        for folder in self._folders:
            folder.follow()
        if now - self._shown_at < READOUT_INTERVAL:
            return
        self._shown_at = now
        if caught_up:
            for axis, slider in enumerate(self._sliders):
                set_slider(slider, shown(self._joints, axis, float(state.goal[axis])))
        text = page(self._joints, self._labels, state)
        if text != self._shown:
            self._shown = self._readout.content = text
        self._problem.follow()

    def _slider(self, axis: int, state: State, listen: Listen) -> viser.GuiSliderHandle[float]:
        joints = self._joints
        low, high = ends(
            *(shown(joints, axis, float(limit[axis])) for limit in (joints.lower, joints.upper))
        )
        slides = joints.slides[axis]
        slider = self._gui.add_slider(
            # The number stands in messages too, and keeps the label apart from other controls.
            self._labels[axis],
            min=low,
            max=high,
            step=10.0 ** math.floor(math.log10((high - low) / STEPS)),
            initial_value=min(max(shown(joints, axis, float(state.goal[axis])), low), high),
            hint=f"{'mm' if slides else 'Degrees'}: {signed(low, 2)} to {signed(high, 2)}",
        )
        slider.precision = 2
        unit = 1e-3 if slides else math.radians(1.0)
        listen(slider, lambda: cmd.Joint(axis + 1, unit * slider.value))
        return slider


def shown(joints: JointSet, axis: int, value: float) -> float:
    """Return the ``value`` of a joint [rad, m] in the units of the panel [deg, mm]."""
    return 1e3 * value if joints.slides[axis] else math.degrees(value)


def page(joints: JointSet, labels: Sequence[str], state: State) -> str:
    """Return the read-out for ``state`` as HTML."""
    rows = "".join(
        f"<tr><th>{escape(label)}</th>"
        f"<td data-now='{axis}'>{signed(shown(joints, axis, float(state.q[axis])), 1)}</td>"
        f"<td data-goal='{axis}'>{signed(shown(joints, axis, float(state.goal[axis])), 1)}</td>"
        f"<td class='unit'>{'mm' if joints.slides[axis] else '°'}</td></tr>"
        for axis, label in enumerate(labels)
    )
    return (
        f"<div class='k450'><table><thead><tr><th>joint</th><th>now</th><th>goal</th><th></th></tr>"
        f"</thead><tbody>{rows}</tbody></table></div>"
    )


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
