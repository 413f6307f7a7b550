"""The panel: joints, gripper and postures, and the pose of the tool in numbers."""

from __future__ import annotations

import math
from html import escape
from operator import is_
from typing import NamedTuple

import viser

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.state.messages import degrees, millimetres, signed
from katana450.arm.control.state.state import State
from katana450.arm.robot.robot import Robot
from katana450.server.view import readout
from katana450.server.view.branches import BranchList, Find
from katana450.server.view.controls import GestureGate, Listen, ends, listener, set_slider
from katana450.server.view.pose_form import PoseForm
from katana450.server.view.readout import PoseDisplay
from katana450.server.view.view_updater import READOUT_INTERVAL

GESTURES: dict[str, tuple[cmd.Command, str]] = {
    "Home": (cmd.Home(), "to the ready posture"),
    "Go to zero": (cmd.GoToZero(), "every joint to zero, or to the limit nearest to zero"),
    "Hold": (cmd.Hold(), "stop here and drop the target"),
}
"""The buttons, with their commands and what these do."""

TURN_STEP, MIN_STEPS = 0.05, 400
"""[deg] Step of the slider of a joint that turns; minimum number of steps of one that slides."""


class ToolControls(NamedTuple):
    """The controls of the tool of an arm: its pose by numbers, and the branches to choose from."""

    form: PoseForm
    branches: BranchList


class Panel:
    """The controls of the robot. Sliders show the goal, as the gizmo does."""

    def __init__(
        self,
        server: viser.ViserServer,
        robot: Robot,
        gestures: GestureGate,
        find: Find,
        state: State,
    ) -> None:
        """Add the controls to the panel of ``server``.

        Args:
            server: viser's server.
            robot: The robot.
            gestures: The path of gestures to the arm.
            find: Returns the branch options of a state.
            state: The state that the panel shows first.
        """
        self._robot, self._gui = robot, server.gui
        self._model = robot.joint_group if robot.arm is None else robot.arm
        self._labels, self._per_si = robot.joint_labels, readout.per_si(self._model.slides)
        listen = listener(gestures)
        self._shown_at = -math.inf
        for caution in robot.cautions:
            self._gui.add_markdown(caution)
        if robot.arm is None:
            why = f"<p><b>Joints only.</b> {escape(robot.why)}</p>"
            self._gui.add_html(f"<div class='k450'>{why}</div>")
        self._sliders = [self._joint(axis, state, listen) for axis in range(len(self._labels))]
        fingers = self._model.gripper
        self._gripper = self._finger(state, listen) if fingers.moves else None
        drive = self._gui.add_button_group(
            "Drive",
            tuple(GESTURES),
            hint=" ".join(f"{name}: {effect}." for name, (_, effect) in GESTURES.items()),
        )
        listen(drive, lambda: GESTURES[drive.value][0])
        self._readout = self._gui.add_html("")
        self._numbered: tuple[State, PoseDisplay | None] | None = None
        self._tool: ToolControls | None = None
        if robot.arm is not None:
            with self._gui.add_folder("Pose by numbers"):
                form = PoseForm(self._gui, robot.arm, listen, state)
            with self._gui.add_folder("Branches", expand_by_default=False):
                names = robot.arm.kinematics.branches
                branches = BranchList(self._gui, names, find, listen, state)
            self._tool = ToolControls(form, branches)

    def follow(self, state: State, now: float, *, caught_up: bool) -> None:
        """Show ``state`` at time ``now`` [s].

        ``caught_up`` means that ``state`` includes every command that was sent. Without it the
        controls stay as they are, so that an older state never moves a slider that a person drags.
        """
        if self._tool is not None:
            self._tool.form.follow(state)
        if now - self._shown_at < READOUT_INTERVAL:
            return
        self._shown_at = now
        if caught_up:
            self._set_controls(state)
        self._show_numbers(state)
        if self._tool is not None:
            self._tool.branches.follow(state, now)

    def _show_numbers(self, state: State) -> None:
        display, arm = None if self._tool is None else self._tool.form.display, self._robot.arm
        # At rest the state stays the same object, and its numbers need no work.
        if self._numbered is not None and all(map(is_, self._numbered, (state, display))):
            return
        self._numbered = state, display
        if arm is None or display is None:
            joints = self._robot.joint_group
            self._readout.content = readout.joint_page(joints, self._labels, state)
        else:
            self._readout.content = readout.page(arm, state, display)

    def _set_controls(self, state: State) -> None:
        for slider, value, factor in zip(self._sliders, state.goal, self._per_si, strict=True):
            set_slider(slider, factor * float(value))
        if self._gripper is not None:
            set_slider(self._gripper, self._opening(state.gripper_goal))
        if self._tool is not None:
            self._tool.form.set_controls(state)

    def _joint(self, axis: int, state: State, listen: Listen) -> viser.GuiSliderHandle[float]:
        limits, factor = self._model.limits, self._per_si[axis]
        low, high = ends(factor * float(limits.lower[axis]), factor * float(limits.upper[axis]))
        slides = self._model.slides[axis]
        slider = self._gui.add_slider(
            # The number stands in messages too, and keeps the label apart from other controls.
            self._labels[axis],
            min=low,
            max=high,
            step=10.0 ** math.floor(math.log10((high - low) / MIN_STEPS)) if slides else TURN_STEP,
            initial_value=min(max(factor * float(state.goal[axis]), low), high),
            hint=f"Axis {axis + 1}, {'mm' if slides else 'degrees'}: "
            f"{signed(low, 2)} to {signed(high, 2)}",
        )
        slider.precision = 2
        listen(slider, lambda: cmd.Joint(axis + 1, slider.value / factor))
        return slider

    def _finger(self, state: State, listen: Listen) -> viser.GuiSliderHandle[float]:
        fingers = self._model.gripper
        named = millimetres if fingers.slides else degrees
        slider = self._gui.add_slider(
            "Gripper",
            min=0.0,
            max=100.0,
            step=0.5,
            initial_value=self._opening(state.gripper_goal),
            hint=f"Percent open: 0 is closed ({named(fingers.closed)} at each finger), "
            f"100 is open ({named(fingers.opened)})",
        )
        slider.precision = 1
        listen(slider, lambda: cmd.Gripper(self._finger_angle(slider.value)))
        ends_of = {"Open": fingers.opened, "Close": fingers.closed}
        buttons = self._gui.add_button_group(
            "Fingers", tuple(ends_of), hint="Opens or closes the gripper as far as it goes"
        )
        listen(buttons, lambda: cmd.Gripper(ends_of[buttons.value]))
        return slider

    def _opening(self, angle: float) -> float:
        fingers = self._model.gripper
        return 100.0 * (angle - fingers.closed) / (fingers.opened - fingers.closed)

    def _finger_angle(self, opening: float) -> float:
        fingers = self._model.gripper
        return fingers.closed + opening / 100.0 * (fingers.opened - fingers.closed)
