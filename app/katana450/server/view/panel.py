"""The control panel of an arm: read-out, sliders for its joints, a pose to type, and buttons."""

from __future__ import annotations

import math
from html import escape

import numpy as np
import viser

from katana450.arm.control import commands as cmd
from katana450.arm.control.event_log import LogEntry
from katana450.arm.control.messages import (
    AXIS_NAMES,
    PRIORITIES,
    PRIORITY_HINTS,
    UNCHECKED,
    degrees,
    millimetres,
)
from katana450.arm.control.state import State
from katana450.arm.robot.robot import Robot
from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.forward import forward
from katana450.maths.kinematics.priority import Priority
from katana450.server.view import readout
from katana450.server.view.branches import BranchList, Find
from katana450.server.view.controls import (
    GestureGate,
    add_motion,
    ends,
    listener,
    set_slider,
    set_value,
)
from katana450.server.view.display_options import DisplayOptions, add_shows, add_views
from katana450.server.view.event_list import EventList
from katana450.server.view.view_updater import READOUT_INTERVAL

MAX_TYPED_POSITION = 1000.0
"""Maximum [mm] of a typed coordinate, beyond any tool point of the arm."""


GESTURES: dict[str, cmd.Command] = {
    "Home": cmd.Home(),
    "Go to zero": cmd.GoToZero(),
    "Hold": cmd.Hold(),
}


class Panel:
    """The panel. Sliders show the goal, as the gizmo does; the read-out shows the arm itself."""

    def __init__(
        self,
        server: viser.ViserServer,
        robot: Robot,
        gestures: GestureGate,
        find: Find,
        shows: DisplayOptions,
        state: State,
    ) -> None:
        """Add the controls to the panel of ``server``.

        Args:
            server: viser's server.
            robot: The robot, which must have an arm.
            gestures: The path of gestures to the arm.
            find: Returns the branch options of a state.
            shows: The functions of the display controls.
            state: The state that the panel shows first.
        """
        self._arm = robot.require_arm()
        self._on_person = listener(gestures)
        self._gui = server.gui
        self._shown_at = -math.inf
        self._shown = ""
        self._readout = self._gui.add_html(readout.page(self._arm, state))
        add_views(self._gui, shows)
        if not robot.collides:
            self._gui.add_markdown(UNCHECKED)
        with self._gui.add_folder("Joints"):
            self._sliders = [self._joint(axis, state) for axis in range(self._arm.chain.n)]
            self._gripper = self._finger(state) if self._arm.gripper.moves else None
        self._gestures = self._gui.add_button_group(
            "Drive",
            tuple(GESTURES),
            hint="Home: to the ready posture. Go to zero: every joint to zero, the arm along x. "
            "Hold: stop here and drop the target.",
        )
        self._on_person(self._gestures, lambda: GESTURES[self._gestures.value])
        self._speed = add_motion(self._gui, self._on_person, state)
        with self._gui.add_folder("Pose by numbers"):
            self._pose_form(state)
        with self._gui.add_folder("Branches", expand_by_default=False):
            self._branches = BranchList(server, robot, find, self._on_person, state)
        with self._gui.add_folder("Show", expand_by_default=False):
            add_shows(self._gui, shows)
        with self._gui.add_folder("Why", expand_by_default=False):
            self._why = EventList(self._gui, gestures)
        # At the end of the panel, because the element takes an empty line.
        self._gui.add_html(readout.style())

    def follow(
        self, state: State, now: float, event_log: tuple[LogEntry, ...], *, caught_up: bool
    ) -> None:
        """Show ``state`` and ``event_log`` at time ``now`` [s].

        ``caught_up`` means that ``state`` includes every command that was sent. Without it the
        controls stay as they are, so that an older state never moves a slider that a person drags.
        """
        if now - self._shown_at < READOUT_INTERVAL:
            return
        self._shown_at = now
        if caught_up:
            self._set_controls(state)
        page = readout.page(self._arm, state)
        if page != self._shown:
            self._shown = self._readout.content = page
        self._branches.follow(state, now)
        self._why.follow(event_log)

    def _set_controls(self, state: State) -> None:
        for slider, angle in zip(self._sliders, state.goal, strict=True):
            set_slider(slider, math.degrees(angle))
        if self._gripper is not None:
            set_slider(self._gripper, self._opening(state.gripper_goal))
        set_slider(self._speed, 100.0 * state.speed)
        set_value(self._tool, state.tool)
        set_value(self._priority, PRIORITIES[state.priority])
        meaning = _meaning(state.priority)
        if meaning != self._meaning.content:
            self._meaning.content = meaning

    def _joint(self, axis: int, state: State) -> viser.GuiSliderHandle[float]:
        chain = self._arm.chain
        lower, upper = ends(*(math.degrees(limit[axis]) for limit in (chain.lower, chain.upper)))
        slider = self._gui.add_slider(
            f"Axis {axis + 1}",
            min=lower,
            max=upper,
            step=0.05,
            initial_value=float(np.clip(math.degrees(state.goal[axis]), lower, upper)),
            hint=f"{AXIS_NAMES[axis]}, degrees: "
            f"{degrees(chain.lower[axis], 2)} to {degrees(chain.upper[axis], 2)}".capitalize(),
        )
        slider.precision = 2
        self._on_person(slider, lambda: cmd.SetJoint(axis, math.radians(slider.value)))
        return slider

    def _finger(self, state: State) -> viser.GuiSliderHandle[float]:
        fingers = self._arm.gripper
        named = millimetres if fingers.slides else degrees
        slider = self._gui.add_slider(
            "Gripper",
            min=0.0,
            max=100.0,
            step=0.5,
            initial_value=self._opening(state.gripper_goal),
            hint=f"Percent open: 0 is closed ({named(fingers.lower)} at each finger), "
            f"100 is open ({named(fingers.upper)})",
        )
        slider.precision = 1
        self._on_person(slider, lambda: cmd.SetGripper(self._finger_angle(slider.value)))
        return slider

    def _pose_form(self, state: State) -> None:
        arm = self._arm
        T = forward(arm.chain_to(state.tool), state.goal)
        self._tool = self._gui.add_dropdown(
            "Tool",
            tuple(arm.tools),
            initial_value=state.tool,
            hint="The frame of the gizmo, these numbers and the read-out",
        )
        self._on_person(self._tool, lambda: cmd.SetTool(self._tool.value))
        self._priority = self._gui.add_dropdown(
            "Priority",
            tuple(PRIORITIES.values()),
            initial_value=PRIORITIES[state.priority],
            hint="Which part of the target is kept when five axes cannot satisfy all of it",
        )
        self._meaning = self._gui.add_html(_meaning(state.priority))
        self._on_person(self._priority, lambda: cmd.SetPriority(_priority(self._priority.value)))
        position = self._gui.add_vector3(
            "x, y, z",
            np.round(1e3 * T[:3, 3]) + 0.0,
            min=(-MAX_TYPED_POSITION, -MAX_TYPED_POSITION, -MAX_TYPED_POSITION),
            max=(MAX_TYPED_POSITION, MAX_TYPED_POSITION, MAX_TYPED_POSITION),
            step=1.0,
            hint="Tool position in mm, in the frame {S} at the shoulder",
        )
        angles = self._gui.add_vector3(
            "r, p, y",
            np.round(np.degrees(so3.to_rpy(T[:3, :3]))) + 0.0,
            min=(-180.0, -180.0, -180.0),
            max=(180.0, 180.0, 180.0),
            step=1.0,
            hint="Roll, pitch and yaw in degrees, in the frame {S}; pitch above 0 points down",
        )

        def pose() -> cmd.Command:
            return cmd.SetPose(typed_pose(position.value, angles.value))

        button = self._gui.add_button("Go to pose", hint="Or to the nearest possible pose")
        self._on_person(button, pose)

    def _opening(self, angle: float) -> float:
        fingers = self._arm.gripper
        return 100.0 * (angle - fingers.lower) / (fingers.upper - fingers.lower)

    def _finger_angle(self, opening: float) -> float:
        fingers = self._arm.gripper
        return fingers.lower + opening / 100.0 * (fingers.upper - fingers.lower)


def typed_pose(
    position: tuple[float, float, float], angles: tuple[float, float, float]
) -> FloatArray:
    """Return the pose (4, 4) in {S} of a typed position [mm] and roll, pitch, yaw [deg]."""
    R = so3.from_rpy(*(math.radians(angle) for angle in angles))
    return se3.from_rotation_translation(R, 1e-3 * np.array(position))


def _meaning(priority: Priority) -> str:
    return f"<div class='k450'><p class='hint'>{escape(PRIORITY_HINTS[priority])}</p></div>"


def _priority(name: str) -> Priority:
    return next(priority for priority, text in PRIORITIES.items() if text == name)
