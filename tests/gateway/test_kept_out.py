"""People whom a server knows: names, who is shown, forgotten or kept out, and who may stop."""

from __future__ import annotations

import math
import time
from argparse import Namespace
from collections.abc import Callable
from pathlib import Path
from typing import Any, cast

import pytest
from starlette.exceptions import HTTPException
from starlette.requests import Request

from katana450.arm.control.actor import CommandChannel
from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.lease import Person, Role
from katana450.arm.control.session.session import Session
from katana450.errors import InputError
from katana450.extensions.server_commands.people_requests import PeopleRequests
from katana450.server.api import requests
from katana450.server.service import people as people_module
from katana450.server.service import status
from katana450.server.service.budget import Budgets
from katana450.server.service.dispatcher import Dispatcher
from katana450.server.service.hub import Hub
from katana450.server.service.identity import Identity
from katana450.server.service.known_pages import MAX_NAME, MAX_PAGES, renamed
from katana450.server.service.participants import Participant, actor_of
from katana450.server.service.people import Connection
from katana450.server.web.access_links import AccessFile
from katana450.server.web.authenticator import KICKED, LOOPBACK_NAMES, Address, Authenticator
from katana450.server.web.http_api import Api
from tests.gateway.client import HOUR
from tests.gateway.test_hub import PAGES, FakeArm, Table

ADDRESS = Address(LOOPBACK_NAMES, any_address=False, secure=False)
PROGRAM = "a-program-of-this-test"


class House:
    """A hub with an arm, its HTTP interface, and an access file unless ``free``."""

    def __init__(self, folder: Path, session: Session, *, free: bool = False) -> None:
        self.file = AccessFile.create(folder / "access.json")
        self.hub = Hub(time.monotonic)
        self.hub.add_handler(PeopleRequests(self.hub, Namespace()))
        self.arm = FakeArm(session.begin(session.ready, 0.0, 0.0))
        self.hub.gate.arm = cast(Any, self.arm)
        access = None if free else self.file
        self.people = self.hub.people
        self.people.links = access
        authenticator = Authenticator(access, 8080, ADDRESS, self.people)
        self.budgets = Budgets(self.hub.clock)
        self.api = Api(self.hub, authenticator, self.budgets, Namespace())
        self.ada = self.join("ada", "Ada", Role.ADMIN)

    def join(self, session: str, name: str, role: Role) -> Participant:
        return self.hub.join(Identity(session, name, role, session, name), "page", lambda _: None)

    def ask(self, request: requests.Request) -> object:
        """Execute ``request`` of the admin."""
        return Dispatcher(self.hub).handle(self.ada, request, self.budgets.of("ada"))

    def number(self, session: str) -> int:
        """Return the number of a person who is shown."""
        (number,) = (n for n, identity in self.people.shown.items() if identity.session == session)
        return number

    async def post(
        self, body: bytes, token: str = "", meanwhile: Callable[[], object] = lambda: None
    ) -> int:
        """Send a request over HTTP; ``meanwhile`` is called before its body arrives."""
        return (await self.api._do(self.request(body, token, meanwhile))).status_code

    @staticmethod
    def request(
        body: bytes, token: str = "", meanwhile: Callable[[], object] = lambda: None
    ) -> Request:
        """Return a request of a program."""

        async def receive() -> dict[str, object]:
            meanwhile()
            return {"type": "http.request", "body": body, "more_body": False}

        headers = {"x-program": PROGRAM, "authorization": f"Bearer {token}"}
        raw = [(name.encode(), text.encode()) for name, text in headers.items()]
        address = ("127.0.0.1", 5)
        scope = {"type": "http", "query_string": b"", "headers": raw, "client": address}
        return Request(scope, receive)


@pytest.fixture
def house(tmp_path: Path, session: Session) -> House:
    return House(tmp_path, session)


@pytest.mark.parametrize("revokes", [False, True])
async def test_request_whose_sender_is_removed_before_its_end_is_refused(
    house: House, revokes: bool
) -> None:
    token = house.file.give("Oda", Role.OPERATOR, time.time() + HOUR)
    (number,) = house.file.grants

    def remove() -> None:
        if revokes:
            house.file.revoke(number)
        else:
            house.people.kick(Identity(number, "Oda", Role.OPERATOR), 60.0)

    for do in ("acquire", "release_lease"):
        assert await house.post(b'{"do": "%s"}' % do.encode(), token) == 200
    with pytest.raises(HTTPException) as refused:
        await house.post(b'{"do": "acquire"}', token, remove)
    assert refused.value.status_code == (401 if revokes else 403)
    assert house.hub.lease.holder is None


async def test_http_programs_without_links_are_kept_out_together(
    tmp_path: Path, session: Session
) -> None:
    house = House(tmp_path, session, free=True)
    assert await house.post(b'{"do": "acquire"}') == 200
    number = house.number("programs")
    house.ask(requests.Kick(person=number, seconds=60.0))
    with pytest.raises(HTTPException, match=KICKED) as refused:
        await house.post(b'{"do": "heartbeat"}')
    assert refused.value.status_code == 403
    assert (await house.api._stop(house.request(b""))).status_code == 204
    house.ask(requests.Kick(person=number, seconds=0.0))
    assert await house.post(b'{"do": "heartbeat"}') == 200


VERA = Identity("vera", "Vera", Role.VIEWER, "Vera")
ODA = Identity("oda", "Oda", Role.OPERATOR, "Oda")


def test_every_press_of_an_absent_person_stops_the_arm(table: Table) -> None:
    driver = table.join(PAGES[0])
    table.hub.people.kick(VERA, 60.0)
    for _ in range(2):
        table.hub.stop(actor_of(VERA, CommandChannel.PAGE))
        assert table.hub.stopped is not None
        table.hub.move(driver, cmd.ClearStop())


def test_people_are_shown_while_they_are_connected_or_kept_out(table: Table) -> None:
    people = table.hub.people
    connection = Connection(VERA, "127.0.0.1")

    def shown() -> list[Identity]:
        return list(people.shown.values())

    with people.connected(connection):
        assert shown() == [VERA]
        assert people.kick(VERA, 60.0) == 1
        assert connection.kicked.is_set()
    assert shown() == [VERA]
    table.t += 59.0
    assert (people.kept_out("vera"), shown()) == (1.0, [VERA])
    table.t += 1.0
    assert (people.kept_out("vera"), shown()) == (0.0, [])
    people.kick(VERA, math.inf)
    assert shown() == []
    # The number stays the same, and is never given again.
    (number,) = (number for number in range(10) if people.identity(number) == VERA)
    with people.connected(Connection(ODA, "127.0.0.1")):
        assert list(people.shown) == [number + 1]


def test_connected_and_absent_people_are_never_forgotten(
    table: Table, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(people_module, "MAX_REMEMBERED", 3)
    people = table.hub.people
    identities = [Identity(name, name, Role.VIEWER) for name in ("present", "absent")]
    connections = [Connection(identity, "127.0.0.1") for identity in identities]
    for connection in connections:
        people.add(connection)
    people.kick(identities[1], 60.0)
    for connection in connections[1:]:
        people.remove(connection)
    for number in range(5):
        session = f"visitor {number}"
        visitor = Identity(session, "Visitor", Role.VIEWER)
        with people.connected(Connection(visitor, "127.0.0.1")):
            assert visitor in people.shown.values()
        assert list(people.shown.values()) == identities
    assert len(people._known) <= 4


def test_new_name_is_seen_everywhere_and_the_driver_keeps_the_arm(table: Table) -> None:
    driver, other = (table.join(page) for page in PAGES)
    table.touch(driver.person.key)
    holds, revocations = table.arm.holds, table.hub.gate.revocations
    table.hub.rename(driver, "  Anna   B. ")
    assert status.of(table.hub, driver)["name"] == "Anna B."
    assert status.common(table.hub)["holder"] == "Anna B."
    assert status.of(table.hub, driver)["mine"]
    assert (table.arm.holds, table.hub.gate.revocations) == (holds, revocations)
    table.hub.request(other)
    table.hub.rename(other, "Ben")
    assert [person["name"] for person in status.of(table.hub, driver)["asking"]] == ["Ben"]
    table.hub.move(driver, cmd.Pause())
    assert table.arm.actors[-1].name == "Anna B."
    # A page that is reloaded keeps its name.
    table.hub.leave(driver)
    assert table.join(PAGES[0]).person.name == "Anna B."


@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("", "The name is empty"),
        ("  ", "The name is empty"),
        ("x" * (MAX_NAME + 1), f"The maximum is {MAX_NAME}"),
        ("window 2", "not a name of one person"),
        ("a\u202eb", "cannot be shown"),
        ("\u3164", "cannot be shown"),
        ("a" + "\u0301\u0302\u0303\u0304", "cannot be shown"),
        ("...", "not a name of one person"),
        ("You", "not a name of one person"),
        ("Window 261", "not a name of one person"),
        ("\uff37indow 3", "not a name of one person"),
    ],
)
def test_unsuitable_name_is_refused_in_words(table: Table, name: str, why: str) -> None:
    window, _ = (table.join(page) for page in PAGES)
    with pytest.raises(InputError, match=why):
        table.hub.rename(window, name)
    assert window.person.name == "Window 1"


def test_name_of_an_access_link_stays() -> None:
    with pytest.raises(InputError, match="access link"):
        renamed(Person("key", "Anna", Role.OPERATOR, link="7"), "Ben", ())


def test_name_of_somebody_who_is_away_stays_his(table: Table) -> None:
    first, second = (table.join(page) for page in PAGES)
    table.hub.rename(first, "Ann")
    table.hub.leave(first)
    with pytest.raises(InputError, match="is taken"):
        table.hub.rename(second, "ann")
    assert table.join(PAGES[0]).person.name == "Ann"
    # Saved as it is.
    table.hub.rename(second, "Window 2")


def test_new_name_is_in_the_event_log(table: Table) -> None:
    table.hub.recorder.enabled = True
    window = table.join(PAGES[0])
    table.hub.rename(window, "Ann")
    notes = [table.hub.recorder.notes.get() for _ in range(table.hub.recorder.notes.qsize())]
    (note,) = [entry for entry in notes if entry is not None and entry.kind == "rename"]
    assert note.actor is not None
    assert (note.actor.name, note.what) == ("Window 1", {"name": "Ann"})


def test_connected_window_stays_known_among_many(table: Table) -> None:
    window = table.join(PAGES[0])
    for number in range(MAX_PAGES + 5):
        table.hub.leave(table.join(f"page-{number:032}"))
    table.hub.rename(window, "Ann")
    assert table.join(PAGES[0]).number == window.number
