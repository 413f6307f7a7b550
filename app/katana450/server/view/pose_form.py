"""The form of the tool pose: tool and priority, frame, and numbers to type."""

from __future__ import annotations

from html import escape
from typing import Any

import viser

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.state.state import State
from katana450.arm.robot.mounted_arm import MountedArm
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.forward import forward
from katana450.maths.kinematics.priority import Priority
from katana450.server.view.controls import Listen, set_value
from katana450.server.view.readout import BASE, SHOULDER, PoseDisplay

MAX_TYPED_POSITION = 1000.0
"""Maximum [mm] of a typed coordinate, beyond any tool point of the arm.

It is more while a coordinate exceeds it, typed in another frame.
"""

STEP, DECIMALS = 1.0, 1
"""[mm, deg] Step of the numbers, and their decimals."""


class PoseForm:
    """The form. Its numbers stay until a person changes them or copies the present pose."""

    def __init__(self, gui: viser.GuiApi, arm: MountedArm, listen: Listen, state: State) -> None:
        """Add the controls to ``gui``. They show ``state`` first."""
        self._arm, self._priorities = arm, arm.kinematics.priorities
        self._state = state
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
        copy = gui.add_button("Copy current", hint="Fills in the present pose of the tool")
        copy.on_click(self._copy)
        go = gui.add_button("Go to pose", hint="Or to the nearest possible pose")
        listen(go, lambda: cmd.Pose(self.display.pose(self._position.value, self._angles.value)))

    def follow(self, state: State) -> None:
        """Remember ``state``, whose pose can be copied."""
        self._state = state

    def set_controls(self, state: State) -> None:
        """Show the tool and the priority of ``state``."""
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
        return PoseDisplay(self._frame.value, self._arm.T_base_shoulder)

    # These callbacks are coroutines, because viser calls only those in the order of the messages.

    async def _change_display(self, _: viser.GuiEvent[Any]) -> None:
        """Convert the numbers to the chosen frame."""
        T = self.display.pose(self._position.value, self._angles.value)
        self.display = self._chosen()
        self._fill(T)

    async def _copy(self, event: viser.GuiEvent[Any]) -> None:
        if event.client_id is not None:
            state = self._state
            self._fill(forward(self._arm.chain_to(state.tool), state.q))

    def _fill(self, T: FloatArray) -> None:
        """Show the pose ``T`` (4, 4) in {S}."""
        position, angles = map(_rounded, self.display.numbers(T))
        # The page sends all three numbers when one is edited, so each must be allowed.
        end = max(MAX_TYPED_POSITION, *(abs(x) + STEP for x in position))
        self._position.min, self._position.max = (-end, -end, -end), (end, end, end)
        set_value(self._position, position)
        set_value(self._angles, angles)


def _rounded(numbers: list[float]) -> tuple[float, ...]:
    return tuple(round(number, DECIMALS) + 0.0 for number in numbers)
