"""The panel of programs: choose, preview, run and step a script; teach a new one."""

from __future__ import annotations

import asyncio
import math
import threading
from collections.abc import Callable, Coroutine
from html import escape
from typing import Any, Protocol

import viser

from katana450.arm.control.actor import Actor
from katana450.arm.control.state import State
from katana450.arm.robot.robot import Robot
from katana450.errors import InputError, KatanaError
from katana450.extensions.programs.program import Program
from katana450.extensions.programs.requests import ProgramOrder
from katana450.extensions.programs.script import parse
from katana450.extensions.programs.script_files import Scripts, file_name
from katana450.extensions.programs.server import step_list
from katana450.extensions.programs.server.preview import Preview
from katana450.extensions.programs.server.state_line import RUNS
from katana450.extensions.programs.server.step_list import ListedStep
from katana450.extensions.programs.teach import script_from_postures
from katana450.maths.geometry.arrays import FloatArray
from katana450.server.api.answers import Progress
from katana450.server.view.controls import GestureGate, refuse

TIME_STEP = 0.1
"""[s] Step of the slider that chooses a time of the preview, and resolution of shown durations."""

MAX_TAUGHT_POSTURES = 200
"""Maximum number of postures in a taught script."""

ORDERS = {
    "Run": ProgramOrder.RUN,
    "Step": ProgramOrder.STEP,
}
"""The order that each button gives to the program."""


class Steering(Protocol):
    """The program runner as the panel uses it.

    Its methods raise KatanaError with the reason if they refuse.
    """

    def plan(self, text: str, then: ProgramOrder | None, actor: Actor) -> None:
        """Plan the script ``text`` for ``actor``, then execute the order ``then``, if any."""
        ...

    def steer(self, order: ProgramOrder, actor: Actor) -> None:
        """Execute ``order`` of ``actor`` for the present program."""
        ...

    @property
    def progress(self) -> Progress | None:
        """The progress of the present or last program; None before the first one."""
        ...

    @property
    def program(self) -> Program | None:
        """The program whose planning has succeeded; None without one."""
        ...


class ProgramsPanel:
    """The controls for programs, and the preview of a program in the scene."""

    def __init__(
        self,
        server: viser.ViserServer,
        robot: Robot,
        steering: Steering,
        scripts: Scripts,
        gestures: GestureGate,
        state: Callable[[], State],
    ) -> None:
        """Add the controls to the tab that is being built. ``state`` returns the newest state."""
        self._steering = steering
        self._scripts = scripts
        self._gestures = gestures
        self._state = state
        self._taught: list[FloatArray] = []
        self._drawn: Program | None = None
        self._steps: tuple[ListedStep, ...] = ()
        # The text of the script that was last requested.
        self._text = ""
        # Held while a program is requested: viser runs callbacks in other threads.
        self._order_lock = threading.Lock()
        # Whether the program was requested by Preview, which also shows ghosts.
        self._with_ghosts = False
        self._preview = Preview(server, robot)
        gui = server.gui
        names = tuple(scripts.paths)
        # Some scripts of the library need an arm without its gripper.
        suitable = (name for name in names if _suits(scripts, name, robot))
        self._choice = gui.add_dropdown(
            "Script",
            names,
            initial_value=next(suitable, None),
            hint="Scripts of the library, and of the folder of --programs",
        )
        self._choice.on_update(lambda _: self._draw(None))
        self._orders = gui.add_button_group(
            "Program",
            ("Preview", *ORDERS),
            hint="Preview: plan the script and show the tool's path. Step: run one step, then "
            "wait. The bar pauses and ends the run, and cancels the planning",
        )
        self._orders.on_click(self._guarded(self._order))
        self._look = gui.add_slider(
            "Look at",
            min=0.0,
            max=1.0,
            step=TIME_STEP,
            initial_value=0.0,
            disabled=True,
            hint="Show the arm at this time [s] of the preview, at full speed",
        )
        self._look.on_update(lambda _: self._preview.look(self._look.value))
        self._status = gui.add_html("")
        self._list = gui.add_html("", visible=False)
        self._teach = gui.add_button_group(
            "Teach",
            ("Add pose", "Forget", "Save"),
            hint="Add pose: add the present pose. Forget: drop all poses. Save: save a script that "
            "moves through all poses, in the folder of --programs or else as a download",
        )
        self._teach.on_click(self._guarded(self._on_teach))
        self._name = gui.add_text("Name", "My script", hint="Name of the script that Save writes")

    def follow(self) -> None:
        """Update the display of the program's progress."""
        progress = self._steering.progress
        status = _page(progress, len(self._taught))
        if status != self._status.content:
            self._status.content = status
        if self._order_lock.acquire(blocking=False):
            try:
                self._follow_program()
                self._follow_steps(progress)
            finally:
                self._order_lock.release()
        if not self._look.disabled and progress is not None and progress.status in RUNS:
            self._preview.begin()
            self._look.disabled = True

    def _follow_program(self) -> None:
        program = self._steering.program
        if program is not self._drawn:
            self._drawn = program
            self._draw(program)
            self._with_ghosts = self._with_ghosts and program is None

    def _follow_steps(self, progress: Progress | None) -> None:
        look = 0.0 if self._look.disabled else self._look.value
        current = step_list.current_step(self._steps, progress, look)
        page = step_list.page(self._steps, current)
        if page != self._list.content:
            self._list.content, self._list.visible = page, bool(page)

    def _draw(self, program: Program | None) -> None:
        """Show the preview and the steps of ``program``."""
        self._steps = () if program is None else step_list.steps_of(program)
        span = self._preview.show(program, self._state().tool, ghosts=self._with_ghosts)
        self._look.value = 0.0  # type: ignore[misc]  # viser declares it read-only
        self._look.disabled = span <= 0.0
        if span > 0.0:
            self._look.max = shown_seconds(span)

    def _order(self, actor: Actor, _client: viser.ClientHandle | None = None) -> None:
        button = self._orders.value
        progress = self._steering.progress
        status = "" if progress is None else progress.status
        if button != "Preview" and status in RUNS:
            self._steering.steer(ORDERS[button], actor)
            return
        text = self._scripts.text(self._choice.value)
        if button != "Preview" and status == "planning" and text == self._text:
            # This script is being planned for a preview; it runs once it is planned.
            self._steering.steer(ORDERS[button], actor)
            return
        with self._order_lock:
            self._with_ghosts = button == "Preview"
            self._steering.plan(text, ORDERS.get(button), actor)
            self._text = text
            # If the plan of this script was kept, `follow` draws it again.
            self._drawn = None
            self._draw(None)

    def _on_teach(self, _actor: Actor, client: viser.ClientHandle | None = None) -> None:
        match self._teach.value:
            case "Add pose":
                if len(self._taught) >= MAX_TAUGHT_POSTURES:
                    raise InputError(
                        f"A script has at most {MAX_TAUGHT_POSTURES} poses. Save these first."
                    )
                self._taught.append(self._state().goal)
            case "Forget":
                self._taught.clear()
            case "Save":
                if not self._taught:
                    raise InputError("There is no pose yet. Move the arm and add a pose.")
                self._save(client)

    def _save(self, client: viser.ClientHandle | None) -> None:
        """Save the poses as a script in the folder or, without one, as a download of ``client``."""
        name = self._name.value.strip()
        text = script_from_postures(name, self._taught)
        if client is not None and not self._scripts.keeps:
            # The poses are kept, because a browser may refuse the file.
            client.send_file_download(file_name(name), text.encode(), save_immediately=True)
            return
        self._scripts.save(name, text)
        self._taught.clear()
        self._choice.options = tuple(self._scripts.paths)
        self._choice.value = name  # type: ignore[misc]  # viser declares it read-only

    def _guarded(
        self, act: Callable[[Actor, viser.ClientHandle | None], None]
    ) -> Callable[[viser.GuiEvent[Any]], Coroutine[Any, Any, None]]:
        """Return a handler that runs ``act`` in a thread and shows errors in the sender's page."""

        async def handler(event: viser.GuiEvent[Any]) -> None:
            if event.client_id is None:
                return
            try:
                actor = self._gestures.actor(event.client_id)
                await asyncio.to_thread(act, actor, event.client)
            except KatanaError as error:
                refuse(event, error)

        return handler


def shown_seconds(duration: float) -> float:
    """Return ``duration`` [s] rounded up to a multiple of TIME_STEP."""
    return math.ceil(round(duration / TIME_STEP, 6)) * TIME_STEP


def _suits(scripts: Scripts, name: str, robot: Robot) -> bool:
    """Return whether the script ``name`` can be read, and can run on ``robot`` with its gripper."""
    try:
        return not (parse(scripts.text(name)).bare and robot.require_arm().gripper.moves)
    except KatanaError:
        return False


def _page(progress: Progress | None, poses: int) -> str:
    """Return the progress, and the number of taught poses, as HTML; empty without both."""
    lines = []
    if progress is not None:
        head = f"<b>{escape(progress.name)}</b> " if progress.name else ""
        lines.append(f"{head}{escape(progress.status)}")
        if progress.status in RUNS:
            lines.append(
                f"Step {progress.step} of {progress.steps}, line {progress.line}: "
                f"{escape(progress.task)}, {progress.fraction:.0%}"
            )
        elif progress.status == "planning":
            lines.append("The whole script is planned before the arm moves. This may take a while.")
            if progress.steps:
                at = f"Step {progress.step} of {progress.steps}: {escape(progress.task)}"
                lines.append(
                    f"{at}, {progress.fraction:.0%}"
                    f"<progress value='{progress.fraction:.2f}'></progress>"
                )
        elif progress.status == "ready":
            seconds = shown_seconds(progress.seconds)
            lines.append(f"{progress.steps} steps, {seconds:.1f} s of motion at full speed")
        lines += [escape(line) for line in progress.why.splitlines()]
    if poses:
        lines.append(f"Taught: {poses} pose{'s' if poses > 1 else ''}")
    body = "".join(f"<div>{line}</div>" for line in lines)
    return f"<div class='k450 program'>{body}</div>" if body else ""
