"""The panel of programs: choose, preview, run and step a script."""

from __future__ import annotations

import asyncio
import math
import threading
from collections.abc import Callable, Coroutine
from html import escape
from typing import Any

import viser

from katana450.arm.control.actor import Actor
from katana450.arm.control.arm import ArmModel
from katana450.arm.control.session.session import Session
from katana450.arm.control.state.state import State
from katana450.arm.robot.robot import Robot
from katana450.errors import KatanaError, LeaseError
from katana450.extensions.programs.run.program import Program
from katana450.extensions.programs.script.script import parse
from katana450.extensions.programs.script.script_files import Scripts
from katana450.extensions.programs.server import step_list
from katana450.extensions.programs.server.preview import TIME_STEP, Preview
from katana450.extensions.programs.server.program_runner import ProgramRunner
from katana450.extensions.programs.server.state_line import ENDED, RUNS
from katana450.extensions.programs.server.step_list import ListedStep
from katana450.extensions.programs.server.traces import DRIVEN
from katana450.server.api.answers import Progress
from katana450.server.api.program_requests import ProgramOrder
from katana450.server.service.hub import Hub
from katana450.server.service.participants import Participant
from katana450.server.view.controls import GestureGate, refuse, set_value
from katana450.server.view.panel_folder import FolderContext

ORDERS = {
    "Run": ProgramOrder.RUN,
    "Step": ProgramOrder.STEP,
}
"""The order that each button gives to the program."""


class PanelAccess:
    """The interface of the panel to the runner: for any thread, with the actor of a gesture."""

    def __init__(
        self, runner: ProgramRunner, hub: Hub, call: Callable[[Callable[[], None]], None]
    ) -> None:
        """Use ``call`` to run functions in the server's thread, see ``FolderContext``."""
        self._runner = runner
        self._hub = hub
        self._call = call

    @property
    def progress(self) -> Progress | None:
        """Progress of the present or last program."""
        return self._runner.progress()

    @property
    def program(self) -> Program | None:
        """The program that is planned."""
        return self._runner.program

    @property
    def text(self) -> str:
        """The script that was planned last; "" before the first one."""
        return self._runner.planner.text

    def plan(self, text: str, then: ProgramOrder | None, actor: Actor) -> None:
        """Plan ``text`` for ``actor``, then carry out ``then``. Raises KatanaError."""

        def act() -> None:
            participant = self._participant_of(actor)
            if then is not None:
                self._hub.gate.check_not_stopped()
            self._runner.script(participant, text, more=False, speed=1.0)
            self._runner.planner.then = then

        self._call(act)

    def steer(self, order: ProgramOrder, actor: Actor) -> None:
        """Give the program an order of ``actor``. Raises LeaseError if it is refused."""

        def act() -> None:
            self._runner.steer(self._participant_of(actor), order)

        self._call(act)

    def _participant_of(self, actor: Actor) -> Participant:
        self._hub.gate.check_current(actor)
        participant = self._hub.participant(actor.key)
        if participant is None:
            raise LeaseError("Open the start page to run programs.")
        return participant


TAB = "Programs"
"""Label of the panel's tab with the controls."""


def programs_panel(context: FolderContext) -> ProgramsPanel | None:
    """Return the controls for programs, added to their tab; None for a robot without an arm."""
    runner = context.hub.runner
    # Another extension may provide the only runner of this server.
    if context.robot.arm is None or not isinstance(runner, ProgramRunner):
        return None
    with context.tabs.tab(TAB):
        return ProgramsPanel(
            context.server,
            context.robot,
            PanelAccess(runner, context.hub, context.call),
            Scripts(context.options.programs),
            context.gestures,
            context.state,
            lambda: context.hub.present().session,
        )


class ProgramsPanel:
    """The controls for programs, and the preview of a program in the scene."""

    def __init__(
        self,
        server: viser.ViserServer,
        robot: Robot,
        access: PanelAccess,
        scripts: Scripts,
        gestures: GestureGate,
        state: Callable[[], State],
        session: Callable[[], Session],
    ) -> None:
        """Add the controls to the tab that is being built.

        ``state`` returns the newest state, and ``session`` the rules of the arm.
        """
        self._access = access
        self._scripts = scripts
        self._gestures = gestures
        self._state = state
        self._drawn: Program | None = None
        self._steps: tuple[ListedStep, ...] = ()
        # The script that was sent last, and the name under which the drop-down shows it.
        self._sent = self._sent_name = ""
        # Held while a program is requested: viser runs callbacks in other threads.
        self._order_lock = threading.Lock()
        self._preview = Preview(server, robot, session)
        gui = server.gui
        self._arm = robot.require_arm()
        self._listed, self._names = scripts.changed, scripts.offered(self._arm)
        suitable = (name for name in self._names if _suits(scripts, name, self._arm))
        self._choice = gui.add_dropdown(
            "Script",
            self._names,
            initial_value=next(suitable, None),
            hint="Scripts of the library, and of the folder of this server",
        )
        self._edit = gui.add_html("")
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
            hint="Show arm, objects and water at this time [s] of the preview",
        )
        self._look.on_update(lambda _: self._seek())
        self._seek_time = gui.add_html("", visible=False)
        self._status = gui.add_html("")
        self._list = gui.add_html("", visible=False)

    def follow(self) -> None:
        """Update the display of the program's progress, and the list of scripts."""
        progress = self._access.progress
        self._follow_choice(progress)
        name = self._choice.value
        # It opens the script as text, see `static/scene/steps.js`.
        button = f"<button type=button data-script='{escape(name)}'>Edit as text</button>"
        edit = f"<div class='k450'>{button}</div>" if name in self._names else ""
        if edit != self._edit.content:
            self._edit.content = edit
        if self._sent_name not in ("", name):
            progress = None
        status = _page(progress)
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
            self._show_time()
        ended = progress is not None and progress.status in ENDED
        if ended and isinstance(self._state().mode, DRIVEN):
            self._preview.end()

    def _follow_choice(self, progress: Progress | None) -> None:
        """Choose the script that was sent last, by anybody, and keep it while it is used."""
        sent, is_new = self._access.text, False
        in_use = progress is not None and progress.status in (*RUNS, "planning")
        if sent != self._sent and progress is not None and (progress.name or not in_use):
            names = (self._choice.value, *self._names)
            same = (name for name in names if _is_text(self._scripts, name, sent))
            name = f"{progress.name or 'Script'} of {progress.by}"
            self._sent, self._sent_name, is_new = sent, next(same, name), True
        if self._scripts.changed != self._listed or is_new:
            self._listed, self._names = self._scripts.changed, self._scripts.offered(self._arm)
            chosen = self._sent_name if is_new else self._choice.value
            options = dict.fromkeys((*self._names, self._sent_name or chosen))
            self._choice.options = tuple(options)
            if chosen in options:
                set_value(self._choice, chosen)
        if self._choice.disabled != in_use:
            self._choice.disabled = in_use

    def _follow_program(self) -> None:
        is_chosen = self._sent_name in ("", self._choice.value)
        program = self._access.program if is_chosen else None
        if program is not self._drawn:
            self._drawn = program
            self._draw(program)

    def _follow_steps(self, progress: Progress | None) -> None:
        look = 0.0 if self._look.disabled else self._look.value
        marks = step_list.marks(self._steps, progress, look)
        breakpoints = () if progress is None else progress.breakpoints
        page = step_list.page(self._steps, marks, breakpoints)
        if page != self._list.content:
            self._list.content, self._list.visible = page, bool(page)

    def _draw(self, program: Program | None) -> None:
        """Show the preview and the steps of ``program``."""
        self._steps = () if program is None else step_list.steps_of(program)
        span = self._preview.show(program, self._state())
        self._look.value = 0.0  # type: ignore[misc]  # viser declares it read-only
        self._look.disabled = span <= 0.0
        if span > 0.0:
            self._look.max = shown_seconds(span)
        self._show_time()

    def _seek(self) -> None:
        self._show_time()
        self._preview.look(self._look.value)

    def _show_time(self) -> None:
        """Show the time of the slider in words."""
        words = f"{self._look.value:.1f} s of {self._look.max:.1f} s"
        self._seek_time.content = f"<div class='k450'><p class='hint' role=status>{words}</p></div>"
        self._seek_time.visible = not self._look.disabled

    def _order(self, actor: Actor) -> None:
        button = self._orders.value
        progress = self._access.progress
        status = "" if progress is None else progress.status
        if button != "Preview" and status in RUNS:
            self._access.steer(ORDERS[button], actor)
            return
        name = self._choice.value
        text = self._scripts.text(name) if name in self._names else self._sent
        if button != "Preview" and status == "planning" and text == self._access.text:
            # This script is being planned for a preview; it runs once it is planned.
            self._access.steer(ORDERS[button], actor)
            return
        with self._order_lock:
            self._access.plan(text, ORDERS.get(button), actor)
            # If the plan of this script was kept, `follow` draws it again.
            self._drawn = None
            self._draw(None)

    def _guarded(
        self, act: Callable[[Actor], None]
    ) -> Callable[[viser.GuiEvent[Any]], Coroutine[Any, Any, None]]:
        """Return a handler that runs ``act`` in a thread and shows errors in the sender's page."""

        async def handler(event: viser.GuiEvent[Any]) -> None:
            if event.client_id is None:
                return
            try:
                actor = self._gestures.actor(event.client_id)
                await asyncio.to_thread(act, actor)
            except KatanaError as error:
                refuse(event, error)

        return handler


def shown_seconds(duration: float) -> float:
    """Return ``duration`` [s] rounded up to a multiple of TIME_STEP."""
    return math.ceil(round(duration / TIME_STEP, 6)) * TIME_STEP


def _suits(scripts: Scripts, name: str, arm: ArmModel) -> bool:
    """Return whether the script ``name`` can be read, and suits ``arm``."""
    try:
        return parse(scripts.text(name)).suits(arm)
    except KatanaError:
        return False


def _is_text(scripts: Scripts, name: str, text: str) -> bool:
    """Return whether ``text`` is that of the script ``name``."""
    try:
        return scripts.text(name) == text
    except KatanaError:
        return False


def _page(progress: Progress | None) -> str:
    """Return the plan, or why there is none or it failed, as HTML; the bar says all else."""
    if progress is None or progress.status not in ("ready", "refused", "cancelled", "failed"):
        return ""
    lines = [f"<b>{escape(progress.name)}</b> {escape(progress.status)}"]
    if progress.status == "ready":
        lines.append(f"{progress.steps} steps, about {shown_seconds(progress.seconds):.1f} s")
    lines += [escape(line) for line in progress.why.splitlines()]
    body = "".join(f"<div>{line}</div>" for line in lines)
    return f"<div class='k450 program'>{body}</div>"
