"""The tab "Drive" of the panel of an arm: joints, gripper, postures, tool pose, and branches."""

from __future__ import annotations

import math

import numpy as np
import viser

from katana450.arm.control import commands as cmd
from katana450.arm.control.messages import degrees, millimetres
from katana450.arm.control.state import State
from katana450.arm.robot.joint_labels import joint_labels
from katana450.arm.robot.robot import Robot
from katana450.server.view import readout
from katana450.server.view.branches import BranchList, Find
from katana450.server.view.controls import GestureGate, ends, listener, set_slider
from katana450.server.view.pose_form import PoseForm
from katana450.server.view.view_updater import READOUT_INTERVAL

GESTURES: dict[str, cmd.Command] = {
    "Home": cmd.Home(),
    "Go to zero": cmd.GoToZero(),
    "Hold": cmd.Hold(),
}


class Panel:
    """The controls of the arm. Sliders show the goal, as the gizmo does."""

    def __init__(
        self,
        server: viser.ViserServer,
        robot: Robot,
        gestures: GestureGate,
        find: Find,
        state: State,
    ) -> None:
        """Add the controls to the open tab of ``server``.

        Args:
            server: viser's server.
            robot: The robot, which must have an arm.
            gestures: The path of gestures to the arm.
            find: Returns the branch options of a state.
            state: The state that the panel shows first.
        """
        self._arm = robot.require_arm()
        self._on_person = listener(gestures)
        self._gui = server.gui
        self._shown_at = -math.inf
        for caution in robot.cautions:
            self._gui.add_markdown(caution)
        labels = joint_labels(robot)
        self._sliders = [self._joint(axis, labels[axis], state) for axis in range(len(labels))]
        self._gripper = self._finger(state) if self._arm.gripper.moves else None
        self._gestures = self._gui.add_button_group(
            "Drive",
            tuple(GESTURES),
            hint="Home: to the ready posture. Go to zero: every joint to zero, the arm along x. "
            "Hold: stop here and drop the target.",
        )
        self._on_person(self._gestures, lambda: GESTURES[self._gestures.value])
        self._readout = self._gui.add_html("")
        with self._gui.add_folder("Pose by numbers"):
            self._form = PoseForm(self._gui, self._arm, self._on_person, state)
        self._numbered: State | None = None
        self._display = self._form.display
        with self._gui.add_folder("Branches", expand_by_default=False):
            self._branches = BranchList(server, robot, find, self._on_person, state)
        with self._gui.add_folder("Details", expand_by_default=False):
            self._details = self._gui.add_html("")

    def follow(self, state: State, now: float, *, caught_up: bool) -> None:
        """Show ``state`` at time ``now`` [s].

        ``caught_up`` means that ``state`` includes every command that was sent. Without it the
        controls stay as they are, so that an older state never moves a slider that a person drags.
        """
        self._form.follow(state)
        if now - self._shown_at < READOUT_INTERVAL:
            return
        self._shown_at = now
        if caught_up:
            self._set_controls(state)
        self._show_numbers(state)
        self._branches.follow(state, now)

    def _show_numbers(self, state: State) -> None:
        # At rest the state stays the same object, and its numbers need no work.
        if state is self._numbered and self._form.display is self._display:
            return
        self._numbered, self._display = state, self._form.display
        self._readout.content = readout.page(self._arm, state, self._display)
        self._details.content = readout.details(self._arm, state)

    def _set_controls(self, state: State) -> None:
        for slider, angle in zip(self._sliders, state.goal, strict=True):
            set_slider(slider, math.degrees(angle))
        if self._gripper is not None:
            set_slider(self._gripper, self._opening(state.gripper_goal))
        self._form.set_controls(state)

    def _joint(self, axis: int, label: str, state: State) -> viser.GuiSliderHandle[float]:
        chain = self._arm.chain
        lower, upper = ends(*(math.degrees(limit[axis]) for limit in (chain.lower, chain.upper)))
        slider = self._gui.add_slider(
            label,
            min=lower,
            max=upper,
            step=0.05,
            initial_value=float(np.clip(math.degrees(state.goal[axis]), lower, upper)),
            hint=f"Axis {axis + 1}, degrees: "
            f"{degrees(chain.lower[axis], 2)} to {degrees(chain.upper[axis], 2)}",
        )
        slider.precision = 2
        self._on_person(slider, lambda: cmd.Joint(axis + 1, math.radians(slider.value)))
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
            hint=f"Percent open: 0 is closed ({named(fingers.closed)} at each finger), "
            f"100 is open ({named(fingers.opened)})",
        )
        slider.precision = 1
        self._on_person(slider, lambda: cmd.Gripper(self._finger_angle(slider.value)))
        ends_of = {"Open": fingers.opened, "Close": fingers.closed}
        buttons = self._gui.add_button_group(
            "Fingers", tuple(ends_of), hint="Opens or closes the gripper as far as it goes"
        )
        self._on_person(buttons, lambda: cmd.Gripper(ends_of[buttons.value]))
        return slider

    def _opening(self, angle: float) -> float:
        fingers = self._arm.gripper
        return 100.0 * (angle - fingers.closed) / (fingers.opened - fingers.closed)

    def _finger_angle(self, opening: float) -> float:
        fingers = self._arm.gripper
        return fingers.closed + opening / 100.0 * (fingers.opened - fingers.closed)
