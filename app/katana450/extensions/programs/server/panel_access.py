"""Transfer of the panel's requests from viser's threads to the server's thread."""

from __future__ import annotations

from collections.abc import Callable

from katana450.arm.control.actor import Actor
from katana450.errors import LeaseError
from katana450.extensions.programs.program import Program
from katana450.extensions.programs.server.program_runner import ProgramRunner
from katana450.server.api import answers
from katana450.server.api.program_requests import ProgramOrder
from katana450.server.service.hub import Hub
from katana450.server.service.participants import Participant


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
    def progress(self) -> answers.Progress | None:
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
        self._call(lambda: self._plan(text, then, actor))

    def steer(self, order: ProgramOrder, actor: Actor) -> None:
        """Give the program an order of ``actor``. Raises LeaseError if it is refused."""
        self._call(lambda: self._steer(order, actor))

    def _steer(self, order: ProgramOrder, actor: Actor) -> None:
        self._runner.steer(self._participant_of(actor), order)

    def _plan(self, text: str, then: ProgramOrder | None, actor: Actor) -> None:
        participant = self._participant_of(actor)
        if then is not None:
            self._hub.gate.check_not_stopped()
        self._runner.script(participant, text, more=False, speed=1.0)
        self._runner.planner.then = then

    def _participant_of(self, actor: Actor) -> Participant:
        self._hub.gate.check_current(actor)
        participant = self._hub.participant(actor.key)
        if participant is None:
            raise LeaseError("Open the start page to run programs.")
        return participant
