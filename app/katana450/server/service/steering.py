"""Requests of the programs' panel, carried from viser's threads to the gateway's."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from concurrent.futures import Future

from katana450.arm.control.actor import Actor
from katana450.errors import LeaseError
from katana450.extensions.programs.program import Program
from katana450.server.api import answers
from katana450.server.api.fields import Order
from katana450.server.service.program_runner import ProgramRunner

PATIENCE = 2.0
"""[s] Until the panel gives up on an answer."""

RUNS = ("running", "paused", "blocked")
"""States of a program that holds the arm, as `answers.Progress.status`."""


class Steering:
    """What the panel may ask; done in the gateway's one thread."""

    def __init__(
        self, performer: ProgramRunner, loop: Callable[[], asyncio.AbstractEventLoop | None]
    ) -> None:
        """``loop``: the gateway's, once it runs."""
        self._performer = performer
        self._loop = loop

    @property
    def told(self) -> answers.Progress | None:
        """How the program stands."""
        return self._performer.told()

    @property
    def program(self) -> Program | None:
        """The one that is planned."""
        return self._performer.program

    def redirected(self) -> None:
        """The arm is told something else: a program that waits for its plan does not run."""
        self._performer.redirected()

    def plan(self, text: str, then: Order | None, actor: Actor) -> None:
        """Plan a script, and do ``then``. Raises KatanaError with the reason why not."""
        self._do(lambda: self._performer.plan(text, then, actor))

    def steer(self, order: Order, actor: Actor) -> None:
        """Steer the program that runs. Raises LeaseError with the reason why not."""
        self._do(lambda: self._performer.order(order, actor))

    def _do(self, act: Callable[[], None]) -> None:
        loop, future = self._loop(), Future[None]()
        if loop is None:
            raise LeaseError("The server is not there yet.")

        def done() -> None:
            try:
                act()
            except Exception as error:
                future.set_exception(error)
            else:
                future.set_result(None)

        loop.call_soon_threadsafe(done)
        try:
            future.result(PATIENCE)
        except TimeoutError as error:
            raise LeaseError("The server does not answer. See how the program stands.") from error
