"""The panel: joints, gripper and postures, the pose of the tool in numbers, and the branches."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from html import escape
from operator import is_
from typing import Any

import numpy as np
import viser

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.session.tool_targets import BranchOption
from katana450.arm.control.state.messages import degrees, millimetres, part, short, signed
from katana450.arm.control.state.state import State
from katana450.arm.robot.arm_reader import MountedArm
from katana450.arm.robot.robot import Robot
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.arm import arm_of
from katana450.maths.kinematics.branch import AnyBranch
from katana450.maths.kinematics.forward import forward
from katana450.maths.kinematics.priority import Priority
from katana450.maths.kinematics.projection import ANGLE_WORTH_TELLING, POSITION_WORTH_TELLING
from katana450.server.view import readout
from katana450.server.view.controls import (
    GestureGate,
    Listen,
    ends,
    listener,
    set_slider,
    set_value,
)
from katana450.server.view.readout import BASE, SHOULDER, PoseDisplay
from katana450.server.view.scene import Colour

READOUT_INTERVAL = 0.1
"""Time [s] between two updates of numbers and sliders; people cannot read faster changes."""

GESTURES: dict[str, tuple[cmd.Command, str]] = {
    "Home": (cmd.Home(), "to the ready posture"),
    "Go to zero": (cmd.GoToZero(), "every joint to zero, or to the limit nearest to zero"),
    "Hold": (cmd.Hold(), "stop here and drop the target"),
}
"""The buttons, with their commands and what these do."""

TURN_STEP, MIN_STEPS = 0.05, 400
"""[deg] Step of the slider of a joint that turns; minimum number of steps of one that slides."""

MAX_TYPED_POSITION = 1000.0
"""Maximum [mm] of a typed coordinate, beyond any tool point of the arm.

It is more while a coordinate exceeds it, typed in another frame.
"""

STEP, DECIMALS = 1.0, 1
"""[mm, deg] Step of the numbers, and their decimals."""

COLOURS: tuple[Colour, ...] = (
    *((47, 128, 237), (124, 77, 219), (0, 150, 136), (216, 67, 121)),
    *((202, 138, 4), (14, 116, 144), (154, 52, 18), (100, 116, 139)),
)
"""Colours of the branches in their order, which colour-blind people can distinguish."""

HEADINGS = ("branch", "off by", "path", "singular")

NOTHING_LOST = "nothing"

INTERVAL = 1.0
"""Time [s] between two updates while the arm moves.

One update takes longer than several frames. The first one, which loads the engine of the collision
checks, waits as long, so that it takes no time from the first picture.
"""

Find = Callable[[State], tuple[BranchOption, ...]]
"""Returns the option for each branch in a state."""


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
        self._suction = self._cup(state, listen) if fingers.is_cup else None
        has_fingers = fingers.moves and self._suction is None
        self._gripper = self._finger(state, listen) if has_fingers else None
        drive = self._gui.add_button_group(
            "Drive",
            tuple(GESTURES),
            hint=" ".join(f"{name}: {effect}." for name, (_, effect) in GESTURES.items()),
        )
        listen(drive, lambda: GESTURES[drive.value][0])
        self._readout = self._gui.add_html("")
        self._numbered: tuple[State, PoseDisplay | None] | None = None
        self._form: PoseForm | None = None
        if robot.arm is not None:
            with self._gui.add_folder("Pose by numbers"):
                self._form = PoseForm(self._gui, robot.arm, listen, state)
            with self._gui.add_folder("Branches", expand_by_default=False):
                names = robot.arm.kinematics.branches
                self._branches = BranchList(self._gui, names, find, listen, state)

    def follow(self, state: State, now: float, *, caught_up: bool) -> None:
        """Show ``state`` at time ``now`` [s].

        ``caught_up`` means that ``state`` includes every command that was sent. Without it the
        controls stay as they are, so that an older state never moves a slider that a person drags.
        """
        if self._form is not None:
            self._form.follow(state)
        if now - self._shown_at < READOUT_INTERVAL:
            return
        self._shown_at = now
        if caught_up:
            self._set_controls(state)
        self._show_numbers(state)
        if self._form is not None:
            self._branches.follow(state, now)

    def _show_numbers(self, state: State) -> None:
        display, arm = None if self._form is None else self._form.display, self._robot.arm
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
        if self._suction is not None:
            set_value(self._suction, self._switched(state))
        if self._form is not None:
            self._form.set_controls(state)

    def _joint(self, axis: int, state: State, listen: Listen) -> viser.GuiSliderHandle[float]:
        limits, factor = self._model.limits, self._per_si[axis]
        low, high = ends(factor * float(limits.lower[axis]), factor * float(limits.upper[axis]))
        slides = self._model.slides[axis]
        unit = " mm" if slides else "°"
        slider = self._gui.add_slider(
            # The number stands in messages too, and keeps the label apart from other controls.
            self._labels[axis],
            min=low,
            max=high,
            step=10.0 ** math.floor(math.log10((high - low) / MIN_STEPS)) if slides else TURN_STEP,
            initial_value=min(max(factor * float(state.goal[axis]), low), high),
            marks=tuple((end, f"{signed(end, 2)}{unit}") for end in (low, high)),
            hint=f"Axis {axis + 1}: {signed(low, 2)}{unit} to {signed(high, 2)}{unit}",
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
            marks=((0.0, "0 %"), (100.0, "100 %")),
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

    def _switched(self, state: State) -> str:
        return "Off" if state.gripper_goal == self._model.gripper.opened else "On"

    def _cup(self, state: State, listen: Listen) -> viser.GuiDropdownHandle[str]:
        cup = self._model.gripper
        switch = self._gui.add_dropdown(
            "Suction",
            ("Off", "On"),
            initial_value=self._switched(state),
            hint="On: the cup goes out to the flat face before it, and holds it. Off: it lets go",
        )
        listen(switch, lambda: cmd.Gripper(cup.closed if switch.value == "On" else cup.opened))
        return switch

    def _opening(self, angle: float) -> float:
        fingers = self._model.gripper
        return 100.0 * (angle - fingers.closed) / (fingers.opened - fingers.closed)

    def _finger_angle(self, opening: float) -> float:
        fingers = self._model.gripper
        return fingers.closed + opening / 100.0 * (fingers.opened - fingers.closed)


class PoseForm:
    """The form of the tool pose: tool and priority, frame, and numbers to type.

    The numbers are the pose of the goal. What a person has typed stays until the goal is there, or
    until they copy the present pose.
    """

    def __init__(self, gui: viser.GuiApi, arm: MountedArm, listen: Listen, state: State) -> None:
        """Add the controls to ``gui``. They show ``state`` first."""
        self._arm, self._priorities = arm, arm.kinematics.priorities
        self._state, self._goal = state, (state.tool, state.goal)
        self._filled: tuple[tuple[float, ...], ...] = ()
        self._tool = gui.add_dropdown(
            "Tool",
            tuple(arm.tools),
            initial_value=state.tool,
            hint="The frame of the gizmo, these numbers and the read-out",
        )
        listen(self._tool, lambda: cmd.Tool(self._tool.value))
        self._priority = gui.add_dropdown(
            "Priority",
            tuple(name for name, _ in self._priorities.values()),
            initial_value=self._priorities[state.priority][0],
            hint="Which part of the target is kept when the arm cannot satisfy all of it",
        )
        listen(self._priority, lambda: cmd.SetPriority(self._chosen_priority()))
        self._meaning = gui.add_html(self._hint(state.priority))
        self._frame = gui.add_dropdown(
            "Frame",
            (SHOULDER, BASE),
            initial_value=SHOULDER,
            hint="Of the numbers here and above: {S} is where axes 1 and 2 cross, base is the "
            "frame of the robot on the table",
        )
        self.display = self._chosen()
        self._position = gui.add_vector3(
            "x, y, z", (0.0, 0.0, 0.0), step=STEP, hint="Tool position [mm] in this frame"
        )
        self._angles = gui.add_vector3(
            "r, p, y",
            (0.0, 0.0, 0.0),
            min=(-180.0,) * 3,
            max=(180.0,) * 3,
            step=STEP,
            hint="Roll, pitch and yaw [°] in this frame; pitch above 0 points down",
        )
        self._position.precision = self._angles.precision = DECIMALS
        self._fill(forward(self._arm.chain_to(state.tool), state.goal))
        self._frame.on_update(self._change_display)
        # viser shows the label of a row as the name of the pose, and each button by its own text.
        hint = "Fills in the present pose of the tool"
        gui.add_button("Copy current", color="gray", hint=hint).on_click(self._copy)
        go = gui.add_button("Go to pose", hint="Or to the nearest possible pose")
        listen(go, lambda: cmd.Pose(self.display.pose(self._position.value, self._angles.value)))

    def follow(self, state: State) -> None:
        """Remember ``state``, whose pose can be copied."""
        self._state = state

    def set_controls(self, state: State) -> None:
        """Show the tool, the priority and the goal of ``state``."""
        goal = state.tool, state.goal
        if not all(map(is_, goal, self._goal)):
            self._goal = goal
            T = forward(self._arm.chain_to(state.tool), state.goal)
            if self._numbers in (self._filled, self._numbers_of(T)):
                self._fill(T)
        set_value(self._tool, state.tool)
        set_value(self._priority, self._priorities[state.priority][0])
        meaning = self._hint(state.priority)
        if meaning != self._meaning.content:
            self._meaning.content = meaning

    def _hint(self, priority: Priority) -> str:
        hint = escape(self._priorities[priority][1])
        return f"<div class='k450'><p class='hint'>{hint}</p></div>"

    def _chosen_priority(self) -> Priority:
        chosen = self._priority.value
        return next(priority for priority, (name, _) in self._priorities.items() if name == chosen)

    def _chosen(self) -> PoseDisplay:
        arm = self._arm
        T = arm_of(arm.chain).T_K_tool if arm.kinematics.is_pitched else np.eye(4)
        return PoseDisplay(self._frame.value, arm.T_base_shoulder, T[:3, :3])

    # These callbacks are coroutines, because viser calls only those in the order of the messages.

    async def _change_display(self, _: viser.GuiEvent[Any]) -> None:
        """Convert the numbers to the chosen frame."""
        is_typed = self._numbers != self._filled
        T = self.display.pose(self._position.value, self._angles.value)
        self.display = self._chosen()
        self._fill(T)
        if is_typed:
            self._filled = ()

    async def _copy(self, event: viser.GuiEvent[Any]) -> None:
        if event.client_id is not None:
            state = self._state
            self._fill(forward(self._arm.chain_to(state.tool), state.q))

    @property
    def _numbers(self) -> tuple[tuple[float, ...], ...]:
        """The position [mm] and the angles [deg] in the form."""
        return tuple(self._position.value), tuple(self._angles.value)

    def _numbers_of(self, T: FloatArray) -> tuple[tuple[float, ...], ...]:
        """Return the numbers of the pose ``T`` (4, 4) in {S}."""
        return tuple(map(_rounded, self.display.numbers(T)))

    def _fill(self, T: FloatArray) -> None:
        """Show the pose ``T`` (4, 4) in {S}."""
        self._filled = position, angles = self._numbers_of(T)
        # The page sends all three numbers when one is edited, so each must be allowed.
        end = max(MAX_TYPED_POSITION, *(abs(x) + STEP for x in position))
        self._position.min, self._position.max = (-end, -end, -end), (end, end, end)
        set_value(self._position, position)
        set_value(self._angles, angles)


def _rounded(numbers: list[float]) -> tuple[float, ...]:
    return tuple(round(number, DECIMALS) + 0.0 for number in numbers)


class BranchList:
    """The branches to choose from, with the outcome and cost of each.

    A person takes a branch by a button below the table. The page shows the arm on the branch whose
    row is under the pointer (``static/scene/branches.js``).
    """

    def __init__(
        self,
        gui: viser.GuiApi,
        branches: Sequence[AnyBranch],
        find: Find,
        listen: Listen,
        state: State,
    ) -> None:
        """Add the controls to the open folder of ``gui``.

        ``find``: returns the option for each of ``branches`` in a state. ``state``: shown first.
        """
        self._find = find
        self._seen: State | None = None
        self._seen_at = math.nan
        self._table = gui.add_html(_rows((), state.branch))
        take = gui.add_button_group(
            "Take",
            tuple(map(str, branches)),
            hint="Moves the arm to this branch; the target of the tool stays the same",
        )
        listen(take, lambda: cmd.Branch(name=take.value))

    def follow(self, state: State, now: float) -> None:
        """Update the branches for ``state`` at time ``now`` [s].

        The update is immediate while the arm is at rest. Otherwise, and before the first one, at
        least INTERVAL passes.
        """
        if math.isnan(self._seen_at):
            self._seen_at = now
        rests = self._seen is not None and not state.moving
        if state is self._seen or not (rests or now - self._seen_at >= INTERVAL):
            return
        self._seen, self._seen_at = state, now
        rows = _rows(self._find(state), state.branch)
        if rows != self._table.content:
            self._table.content = rows


def _rows(options: tuple[BranchOption, ...], now: AnyBranch) -> str:
    """Return the table as HTML, with one row per branch and the branch ``now`` marked."""
    head = "".join(f"<th>{escape(heading)}</th>" for heading in HEADINGS)
    rows = "".join(
        f"<tr data-branch='{choice.branch}'"
        f"{' aria-current=true' if choice.branch == now else ''}>"
        f"<th><i style='background:rgb{colour}'></i>{choice.branch}</th>"
        + "".join(f"<td>{escape(cell)}</td>" for cell in cells_of(choice))
        + "</tr>"
        for choice, colour in zip(options, COLOURS, strict=False)
    )
    return (
        f"<div class='k450'><table class='branches'><thead><tr>{head}</tr></thead>"
        f"<tbody>{rows}</tbody></table></div>"
    )


def cells_of(choice: BranchOption) -> tuple[str, str, str]:
    """Return the loss, the path length and time, and the smallest singular value of a branch."""
    if choice.refusal:
        return choice.refusal.partition(" exclude")[0].removeprefix("The "), "–", "–"
    lost = []
    if choice.position_error > POSITION_WORTH_TELLING:
        lost.append(f"{short(1e3 * choice.position_error)} mm")
    if choice.rotation_error > ANGLE_WORTH_TELLING:
        lost.append(f"{short(math.degrees(choice.rotation_error))}°")
    if choice.contact is not None:
        lost.append(" meets ".join(map(part, choice.contact.parts)))
    path = f"{degrees(choice.distance, 0)}, {choice.time:.1f} s"
    return ", ".join(lost) or NOTHING_LOST, path, f"{choice.smallest_singular_value:.3f}"
