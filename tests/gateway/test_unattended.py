"""Test programs that run without their owner: only on explicit request, shown, and forbidden."""

from __future__ import annotations

import asyncio
import time
from argparse import Namespace
from dataclasses import replace
from unittest.mock import Mock

import pytest

from katana450.arm.control import commands as cmd
from katana450.arm.control.actor import CommandChannel
from katana450.arm.control.lease import Role
from katana450.arm.control.session import Session
from katana450.errors import LeaseError
from katana450.extensions.programs.serve_options import OWNER_SILENCE
from katana450.extensions.programs.server.program_runner import ProgramRunner
from katana450.extensions.server_commands.people_requests import PeopleRequests
from katana450.server.api import requests
from katana450.server.api.program_requests import ProgramOrder, Steer
from katana450.server.service import status
from katana450.server.service.budget import Budgets
from katana450.server.service.dispatcher import Dispatcher
from katana450.server.service.hub import Hub
from katana450.server.service.identity import Identity
from katana450.server.service.participants import Participant, actor_of
from katana450.server.service.people import Connection, ConnectionKind
from tests.gateway.test_hub import PAGES
from tests.gateway.test_program_runner import Staged

LONG = 20.0
"""Time [s] for which an owner is away: the program runs for 30 s."""


@pytest.fixture
def table(session: Session) -> Staged:
    return Staged(session)


def run(table: Staged, owner: Participant, *, unattended: bool = True) -> None:
    table.plan(owner)
    table.programs.handle(owner, Steer(order=ProgramOrder.RUN, unattended=unattended))
    assert table.status == "running"


def test_only_an_unattended_program_runs_on_without_its_owner(table: Staged) -> None:
    owner = table.join(PAGES[0])
    run(table, owner, unattended=False)
    table.wait(2.0 * OWNER_SILENCE)
    assert table.status == "stopped"
    run(table, owner)
    table.wait(LONG)
    assert table.status == "running"
    table.hub.leave(owner, for_good=True)
    table.wait(0.5)
    assert table.status == "running"
    table.wait(LONG)
    assert any(isinstance(command, cmd.Follow) for command in table.arm.commands)


def test_unattended_program_is_shown_with_its_owner_and_begin(table: Staged) -> None:
    owner = table.join(PAGES[0])
    run(table, owner)
    progress = table.programs.progress()
    assert progress is not None
    assert (progress.unattended, progress.by) == (True, "Window 1")
    assert progress.began is not None
    why = status.common(table.hub)["why"]
    assert why.startswith(f"Unattended: started by Window 1 at {progress.began[11:16]} UTC.")
    table.arm.rest = replace(table.arm.rest, paused=True)
    assert "Unattended: started by Window 1" in status.common(table.hub)["why"]
    table.programs.steer(owner, ProgramOrder.END)
    progress = table.programs.progress()
    assert progress is not None
    assert not progress.unattended


def test_any_stop_ends_an_unattended_program(table: Staged) -> None:
    owner = table.join(PAGES[0])
    run(table, owner)
    table.hub.leave(owner, for_good=True)
    table.hub.stop(actor_of(Identity("anybody", "Vera", Role.VIEWER, "Vera"), CommandChannel.PAGE))
    assert table.arm.stopped
    table.wait(0.1)
    assert table.status == "stopped"
    assert table.hub.lease.holder is None


def test_window_of_the_absent_owner_or_an_admin_ends_it(table: Staged) -> None:
    owner, other = (table.join(page, Role.OPERATOR) for page in PAGES)
    stranger = table.hub.join(
        Identity("stranger", "Stranger", Role.OPERATOR), PAGES[0], lambda _: None
    )
    run(table, owner)
    # While the owner is there, another window of the same person is another participant.
    with pytest.raises(LeaseError, match="belongs to"):
        table.programs.steer(other, ProgramOrder.END)
    assert table.programs.orders(other) == ()
    table.hub.leave(owner)
    with pytest.raises(LeaseError, match="belongs to"):
        table.programs.steer(stranger, ProgramOrder.END)
    assert table.programs.orders(other) == ("end",)
    assert status.of(table.hub, other)["pace"] == ""
    table.programs.steer(other, ProgramOrder.END)
    assert table.status == "stopped"
    assert table.arm.holds


def test_server_option_forbids_unattended_programs(session: Session) -> None:
    def made(hub: Hub) -> ProgramRunner:
        options = Namespace(owner_silence=OWNER_SILENCE, no_unattended=True, no_idle_planning=True)
        return ProgramRunner(hub, options)

    table = Staged(session)
    table.programs = made(table.hub)
    owner = table.join(PAGES[0])
    table.plan(owner)
    with pytest.raises(LeaseError, match="not allowed"):
        table.programs.handle(owner, Steer(order=ProgramOrder.RUN, unattended=True))


def test_owner_must_be_there_when_an_unattended_program_begins(
    table: Staged, session: Session
) -> None:
    """The owner falls silent before the planning ends: nothing begins to move."""
    owner = table.join(PAGES[0])
    table.plan(owner)
    # Another situation, so that the script is planned again before it runs.
    table.arm.rest = session.begin(session.ready + 0.05, 0.0, 0.0)
    table.programs.handle(owner, Steer(order=ProgramOrder.RUN, unattended=True))
    assert not table.programs.running
    table.t += 2.0 * OWNER_SILENCE
    table.hub.tick()
    due = time.monotonic() + 10.0
    while table.status == "planning" and time.monotonic() < due:
        time.sleep(0.005)
    table.wait(1.0)
    assert table.status == "ready"
    assert not table.programs.running


def test_a_running_program_does_not_become_unattended(table: Staged) -> None:
    owner = table.join(PAGES[0])
    run(table, owner, unattended=False)
    for order in (ProgramOrder.RUN, ProgramOrder.RESUME, ProgramOrder.END):
        with pytest.raises(LeaseError, match="Only `run`, `step` and `continue`"):
            table.programs.handle(owner, Steer(order=order, unattended=True))


@pytest.mark.parametrize("revoke", [False, True])
@pytest.mark.parametrize("present", [False, True])
def test_unattended_program_of_a_disconnected_person_ends(
    table: Staged, revoke: bool, present: bool
) -> None:
    people = table.hub.people
    people.links = Mock()
    oda = Identity("oda", "Oda", Role.OPERATOR, "oda", "Oda")
    connection = Connection(oda, ConnectionKind.PAGE, "127.0.0.1")
    people.add(connection)
    owner = table.hub.join(oda, "page", lambda _: None)
    admin = table.hub.join(Identity("ada", "Ada", Role.ADMIN), "page", lambda _: None)
    run(table, owner)
    if not present:
        table.hub.leave(owner, for_good=True)
        table.wait(1.0)
    assert table.status == "running"
    (number,) = people.shown
    kick = requests.Kick(person=number, seconds=60.0, revoke=revoke)
    table.hub.add_handler(PeopleRequests(table.hub, Namespace()))

    async def act() -> None:
        Dispatcher(table.hub).handle(admin, kick, Budgets(table.hub.clock).of("ada"))

    asyncio.run(act())
    assert table.status == "stopped"
    assert table.hub.lease.holder is None
