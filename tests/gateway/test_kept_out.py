"""Test what persons can do who are kept out, without a server process."""

from __future__ import annotations

import asyncio
import time
from argparse import Namespace
from collections.abc import Callable
from pathlib import Path
from typing import Any, cast

import pytest
from starlette.exceptions import HTTPException
from starlette.requests import Request

from katana450.arm.control.lease import Role
from katana450.arm.control.session import Session
from katana450.extensions.server_commands.people_requests import PeopleRequests
from katana450.server.api import requests
from katana450.server.service.budget import Budgets
from katana450.server.service.dispatcher import Dispatcher
from katana450.server.service.hub import Hub
from katana450.server.service.identity import Identity
from katana450.server.service.participants import Participant
from katana450.server.service.people import Connection, ConnectionKind
from katana450.server.web.access_links import AccessFile
from katana450.server.web.authenticator import KICKED, LOOPBACK_NAMES, Address, Authenticator
from katana450.server.web.http_api import Api
from tests.gateway.client import HOUR
from tests.gateway.test_hub import FakeArm

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
        self.api = Api(self.hub, authenticator, self.budgets)
        self.ada = self.join("ada", "Ada", Role.ADMIN)

    def join(self, session: str, name: str, role: Role) -> Participant:
        return self.hub.join(Identity(session, name, role, session, name), "page", lambda _: None)

    def ask(self, request: requests.Request) -> object:
        """Execute ``request`` of the admin."""
        return Dispatcher(self.hub).handle(self.ada, request, self.budgets.of("ada"))

    def number(self, session: str) -> int:
        """Return the number of a person who is shown."""
        (found,) = (n for n, each in self.people.shown.items() if each.session == session)
        return found

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
def test_request_whose_sender_is_removed_before_its_end_is_refused(
    house: House, revokes: bool
) -> None:
    token = house.file.give("Oda", Role.OPERATOR, time.time() + HOUR)
    (number,) = house.file.grants

    def remove() -> None:
        if revokes:
            house.file.revoke(number)
        else:
            house.people.kick(Identity(number, "Oda", Role.OPERATOR), 60.0)

    async def act() -> None:
        for do in ("acquire", "release_lease"):
            assert await house.post(b'{"do": "%s"}' % do.encode(), token) == 200
        with pytest.raises(HTTPException) as refused:
            await house.post(b'{"do": "acquire"}', token, remove)
        assert refused.value.status_code == (401 if revokes else 403)
        assert house.hub.lease.holder is None

    asyncio.run(act())


def test_access_file_says_who_is_kept_out(house: House) -> None:
    house.file.give("Vera", Role.VIEWER, time.time() + HOUR)
    (number,) = house.file.grants

    async def written(*, out: bool) -> None:
        async with asyncio.timeout(5.0):
            while (house.file.grants[number].kept_out > time.time()) != out:
                await asyncio.sleep(0.01)

    async def act() -> None:
        vera = Identity(number, "Vera", Role.VIEWER, number, "Vera")
        with house.people.connected(Connection(vera, ConnectionKind.PAGE, "127.0.0.1")):
            person = house.number(number)
        house.ask(requests.Kick(person=person, seconds=60.0))
        await written(out=True)
        house.ask(requests.Kick(person=person, seconds=0.0))
        await written(out=False)

    asyncio.run(act())


def test_http_programs_without_links_are_kept_out_together(
    tmp_path: Path, session: Session
) -> None:
    house = House(tmp_path, session, free=True)

    async def act() -> None:
        assert await house.post(b'{"do": "acquire"}') == 200
        number = house.number("programs")
        house.ask(requests.Kick(person=number, seconds=60.0))
        with pytest.raises(HTTPException, match=KICKED) as refused:
            await house.post(b'{"do": "heartbeat"}')
        assert refused.value.status_code == 403
        assert (await house.api._stop(house.request(b""))).status_code == 204
        house.ask(requests.Kick(person=number, seconds=0.0))
        assert await house.post(b'{"do": "heartbeat"}') == 200

    asyncio.run(act())
