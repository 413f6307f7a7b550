"""Base classes of what an extension adds to a server: answers to requests, and runs of the arm."""

from __future__ import annotations

from collections.abc import Awaitable
from typing import Any, ClassVar, NamedTuple

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.commands.act import Request
from katana450.arm.control.lease import Person
from katana450.arm.control.state.state import State
from katana450.server.api import answers
from katana450.server.service.participants import Participant


class RequestHandler:
    """Answers requests of some classes. Its methods are called in the server's thread.

    The class of an extension is called with the ``Hub`` and the options of ``katana450 serve``.

    Attributes:
        request_types: Classes of the requests that ``handle`` answers, of the API or of its own.
    """

    request_types: ClassVar[tuple[type[Request], ...]] = ()

    def handle(
        self,
        participant: Participant,  # noqa: ARG002
        request: Request,
    ) -> answers.Answer | cmd.Command | Awaitable[answers.Done]:
        """Execute ``request``, one of ``request_types``, and return its answer.

        The dispatcher submits a returned command in the name of ``participant``, and answers with
        its outcome. It awaits an answer that takes long, and raises the same errors: LeaseError and
        InputError with the reason for a refusal.
        """
        kind = type(request).__name__
        raise AssertionError(f"{type(self).__name__} lists {kind} and does not execute it.")

    def page_status(self, participant: Participant) -> dict[str, Any]:  # noqa: ARG002
        """Return its entries in the status of the page of ``participant``."""
        return {}


class StatusLine(NamedTuple):
    """The state line of the page.

    Attributes:
        mood: the colour of its lamp.
        headline: what moves or waits.
        why: one sentence about it.
        end: the end of the headline that is never cut, such as the time left.
    """

    mood: str
    headline: str
    why: str
    end: str = ""


class Runner(RequestHandler):
    """A runner drives the arm over time on behalf of an owner. This base class never does.

    A run joins the hub as a participant, holds the lease, and submits its commands through the
    gate. Meanwhile ``CommandGate.program`` names the run and its owner. The hub calls the methods
    below in the server's thread, except where they name another. A server has one runner.
    """

    @property
    def running(self) -> bool:
        """True while a run drives the arm."""
        return False

    @property
    def sets_speed(self) -> bool:
        """True while the speed is that of a step, in place of what a person has chosen."""
        return False

    def owns(self, participant: Participant) -> bool:  # noqa: ARG002
        """Return whether ``participant`` owns the present or last run, or its planning."""
        return False

    def runs_for(self, participant: Participant) -> bool:  # noqa: ARG002
        """Return whether a run of ``participant`` drives the arm, or will once it is planned."""
        return False

    def end(self, participant: Participant, why: str) -> None:
        """End the run of ``participant`` because of ``why``, a clause."""

    def tick(self) -> None:
        """Look at the arm and continue. Called every ``TICK`` after the watch over the driver."""

    def stopped(self) -> None:
        """Note a stop, before the arm gets it. No earlier request may begin afterwards.

        Called in any thread, under the lock of the gate, so it must return at once.
        """

    def redirected(self) -> None:
        """Note a command that supersedes a run that waits to begin. Called in any thread."""

    def leave(self, participant: Participant) -> None:
        """Note that ``participant`` is closed and will not return."""

    def progress(self) -> answers.Progress | None:
        """Return the progress of the present or last run; the state includes it."""

    def plan(self) -> answers.ProgramPlan:
        """Return the present or last program with its steps."""
        return answers.ProgramPlan()

    def status_line(
        self,
        state: State,  # noqa: ARG002
        line: StatusLine,
        reader: Person | None,  # noqa: ARG002
    ) -> StatusLine:
        """Return the state line for ``reader`` in place of ``line``, which describes ``state``.

        Not called while the arm is stopped, blocked or at fault.
        """
        return line

    def names(self, person: Person) -> bool:  # noqa: ARG002
        """Return whether the state line names ``person``, for whom it then says "You"."""
        return False

    def orders(self, participant: Participant) -> tuple[str, ...]:  # noqa: ARG002
        """Return the orders that the bar of the page offers to ``participant``.

        Pause and Resume are not among them: the bar always has them.
        """
        return ()
