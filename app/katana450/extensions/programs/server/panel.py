"""The panel of programs: choose one, see its way, run, step, pause and end it; teach a new one."""

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
from katana450.extensions.programs.server.preview import Preview
from katana450.extensions.programs.server.state_line import RUNS
from katana450.extensions.programs.teach import script_from_postures
from katana450.maths.geometry.arrays import FloatArray
from katana450.server.api.answers import Progress
from katana450.server.view.controls import GestureGate, refuse

FOLLOW_INTERVAL = 0.1
"""[s] Between two times to look at."""

MAX_TAUGHT_POSTURES = 200

ORDERS = {
    "Run": ProgramOrder.RUN,
    "Step": ProgramOrder.STEP,
    "Wait": ProgramOrder.PAUSE,
    "End": ProgramOrder.END,
}


class Steering(Protocol):
    """What the panel asks of whoever runs programs. Each raises KatanaError with the reason."""

    def plan(self, text: str, then: ProgramOrder | None, actor: Actor) -> None:
        """Plan a script for ``actor``, and then run it."""
        ...

    def steer(self, order: ProgramOrder, actor: Actor) -> None:
        """Steer the one that runs."""
        ...

    @property
    def progress(self) -> Progress | None:
        """How it stands."""
        ...

    @property
    def program(self) -> Program | None:
        """The one that is planned."""
        ...


class ProgramsPanel:
    """A folder of controls, and the preview in the scene."""

    def __init__(
        self,
        server: viser.ViserServer,
        robot: Robot,
        steering: Steering,
        scripts: Scripts,
        gestures: GestureGate,
        state: Callable[[], State],
    ) -> None:
        """``state``: the newest."""
        self._steering = steering
        self._scripts = scripts
        self._gestures = gestures
        self._state = state
        self._taught: list[FloatArray] = []
        self._drawn: Program | None = None
        # The script that was last asked for.
        self._text = ""
        # Held while a person asks for one, which viser hears in a thread of its own.
        self._asking = threading.Lock()
        # Whether a person asked to see it before it runs.
        self._wanted = False
        self._preview = Preview(server, robot)
        gui = server.gui
        with gui.add_folder("Programs", expand_by_default=False):
            names = tuple(scripts.paths)
            # First one that this arm can run: the library has a circle for the bare flange too.
            fitting = (name for name in names if _suits(scripts, name, robot))
            self._choice = gui.add_dropdown(
                "Script",
                names,
                initial_value=next(fitting, None),
                hint="Those that come along, and of --programs DIR",
            )
            self._choice.on_update(lambda _: self._draw(None))
            self._orders = gui.add_button_group(
                "Program",
                ("Preview", *ORDERS),
                hint="Preview: plan it and show the tool's way. Step: to the end of a step. "
                "Wait: rest on the way, until Run or Step. End: end the run, or the planning",
            )
            self._orders.on_click(self._guarded(self._order))
            self._look = gui.add_slider(
                "Look at",
                min=0.0,
                max=1.0,
                step=FOLLOW_INTERVAL,
                initial_value=0.0,
                disabled=True,
                hint="Seconds of what is previewed, at full speed: the arm as it will stand then",
            )
            self._look.on_update(lambda _: self._preview.look(self._look.value))
            self._status = gui.add_html("")
            self._teach = gui.add_button_group(
                "Teach",
                ("Add pose", "Forget", "Save"),
                hint="Add pose: where the arm is now. Save: a script through all of them, in the "
                "folder of --programs, or else as a download",
            )
            self._teach.on_click(self._guarded(self._on_teach))
            self._name = gui.add_text("Name", "My script", hint="Of the script that Save writes")

    def follow(self) -> None:
        """Show how the program stands."""
        told = self._steering.progress
        page = _page(told, len(self._taught))
        if page != self._status.content:
            self._status.content = page
        if self._asking.acquire(blocking=False):
            try:
                self._follow_program()
            finally:
                self._asking.release()
        if not self._look.disabled and told is not None and told.status in RUNS:
            self._preview.begin()
            self._look.disabled = True

    def _follow_program(self) -> None:
        program = self._steering.program
        if program is not self._drawn:
            self._drawn = program
            self._draw(program)
            self._wanted = self._wanted and program is None

    def _draw(self, program: Program | None) -> None:
        """Show what ``program`` would do."""
        span = self._preview.show(program, self._state().tool, ghosts=self._wanted)
        self._look.value = 0.0  # type: ignore[misc]  # viser declares it read-only
        self._look.disabled = span <= 0.0
        if span > 0.0:
            self._look.max = shown_seconds(span)

    def _order(self, actor: Actor, _client: viser.ClientHandle | None = None) -> None:
        said = self._orders.value
        told = self._steering.progress
        status = "" if told is None else told.status
        if said in ("Wait", "End") or (said != "Preview" and status in RUNS):
            self._steering.steer(ORDERS[said], actor)
            return
        text = self._scripts.text(self._choice.value)
        if said != "Preview" and status == "planning" and text == self._text:
            # A preview is on its way already: it is run once it is planned.
            self._steering.steer(ORDERS[said], actor)
            return
        with self._asking:
            self._wanted = said == "Preview"
            self._steering.plan(text, ORDERS.get(said), actor)
            self._text = text
            # A plan that is kept is drawn anew.
            self._drawn = None
            self._draw(None)

    def _on_teach(self, _actor: Actor, client: viser.ClientHandle | None = None) -> None:
        match self._teach.value:
            case "Add pose":
                if len(self._taught) >= MAX_TAUGHT_POSTURES:
                    raise InputError(f"No more than {MAX_TAUGHT_POSTURES} poses; save these first.")
                self._taught.append(self._state().goal)
            case "Forget":
                self._taught.clear()
            case "Save":
                if not self._taught:
                    raise InputError("There is no pose yet: bring the arm somewhere and add it.")
                self._save(client)

    def _save(self, client: viser.ClientHandle | None) -> None:
        """Save the poses in the folder; where there is none, as a download of ``client``."""
        name = self._name.value.strip()
        text = script_from_postures(name, self._taught)
        if client is not None and not self._scripts.keeps:
            # The poses stay: a browser may refuse the file.
            client.send_file_download(file_name(name), text.encode(), save_immediately=True)
            return
        self._scripts.save(name, text)
        self._taught.clear()
        self._choice.options = tuple(self._scripts.paths)
        self._choice.value = name  # type: ignore[misc]  # viser declares it read-only

    def _guarded(
        self, act: Callable[[Actor, viser.ClientHandle | None], None]
    ) -> Callable[[viser.GuiEvent[Any]], Coroutine[Any, Any, None]]:
        """``act`` in a thread, and what is wrong told in the window of whoever asked."""

        async def acted(event: viser.GuiEvent[Any]) -> None:
            if event.client_id is None:
                return
            try:
                actor = self._gestures.actor(event.client_id)
                await asyncio.to_thread(act, actor, event.client)
            except KatanaError as error:
                refuse(event, error)

        return acted


def shown_seconds(duration: float) -> float:
    """``duration`` [s] as the panel shows it, in words and as the end of its slider."""
    return math.ceil(round(duration / FOLLOW_INTERVAL, 6)) * FOLLOW_INTERVAL


def _suits(scripts: Scripts, name: str, robot: Robot) -> bool:
    """Whether the script can be read, and is not for an arm without the gripper there is."""
    try:
        return not (parse(scripts.text(name)).bare and robot.require_arm().gripper.moves)
    except KatanaError:
        return False


def _page(told: Progress | None, poses: int) -> str:
    lines = []
    if told is not None:
        head = f"<b>{escape(told.name)}</b> " if told.name else ""
        lines.append(f"{head}{escape(told.status)}")
        if told.status in RUNS:
            lines.append(
                f"Step {told.step} of {told.steps}, line {told.line}: {escape(told.task)}, "
                f"{told.fraction:.0%}"
            )
        elif told.status == "planning":
            lines.append("All of it is planned before anything moves, which may take a while.")
            if told.steps:
                at = f"Step {told.step} of {told.steps}: {escape(told.task)}"
                lines.append(
                    f"{at}, {told.fraction:.0%}<progress value='{told.fraction:.2f}'></progress>"
                )
        elif told.status == "ready":
            seconds = shown_seconds(told.seconds)
            lines.append(f"{told.steps} steps, {seconds:.1f} s of motion at full speed")
        lines += [escape(line) for line in told.why.splitlines()]
    if poses:
        lines.append(f"Taught: {poses} pose{'s' if poses > 1 else ''}")
    body = "".join(f"<div>{line}</div>" for line in lines)
    return f"<div class='k450 program'>{body}</div>" if body else ""
