"""People whom a server knows: names, who is shown, forgotten or kept out, and who may stop."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Any

import pytest

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.lease import Person, Role
from katana450.errors import InputError
from katana450.server.service import people as people_module
from katana450.server.service import status
from katana450.server.service.identity import Identity
from katana450.server.service.participants import MAX_NAME, MAX_PAGES, renamed
from katana450.server.service.people import Connection
from katana450.server.web.access_links import AccessFile
from katana450.server.web.authenticator import KICKED
from tests.gateway.client import HOUR, people_of
from tests.gateway.test_hub import PAGES, Table
from tests.gateway.virtual import VirtualServer


@pytest.mark.parametrize("revokes", [False, True])
async def test_request_whose_sender_is_removed_before_its_end_is_refused(
    guarded: VirtualServer, file: AccessFile, revokes: bool
) -> None:
    token = file.give("Oda", Role.OPERATOR, time.time() + HOUR)
    (number,) = file.grants

    def remove() -> None:
        if revokes:
            file.revoke(number)
        else:
            guarded.hub.people.kick(Identity(number, "Oda", Role.OPERATOR), 60.0)

    async def do(what: str, meanwhile: Callable[[], object] = lambda: None) -> int:
        body = b'{"do": "%s"}' % what.encode()
        names: dict[str, Any] = {"X_Program": "a-program-of-this-test"}
        names["Authorization"] = f"Bearer {token}"
        return (await guarded.request("/api/v1/do", body, meanwhile=meanwhile, **names))[0]

    assert (await do("acquire"), await do("release_lease")) == (200, 200)
    assert await do("acquire", remove) == (401 if revokes else 403)
    assert guarded.hub.lease.holder is None


def test_http_programs_without_links_are_kept_out_together(local: VirtualServer) -> None:
    assert local.post(do="acquire")[0] == 200
    with local.connect("Ada") as ada:
        (person,) = (entry.person for entry in people_of(ada) if entry.drives)
        ada.kick(person, 60.0)
        status, refused = local.post("another-program-there", do="heartbeat")
        assert (status, KICKED in refused["why"]) == (403, True)
        assert local.ask("/api/v1/stop", data=b"")[0] == 204
        ada.kick(person, 0.0)
        assert local.post(do="heartbeat")[0] == 200


VERA = Identity("vera", "Vera", Role.VIEWER, "Vera")
ODA = Identity("oda", "Oda", Role.OPERATOR, "Oda")


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


def test_connected_window_stays_known_among_many(table: Table) -> None:
    window = table.join(PAGES[0])
    for number in range(MAX_PAGES + 5):
        table.hub.leave(table.join(f"page-{number:032}"))
    table.hub.rename(window, "Ann")
    assert table.join(PAGES[0]).number == window.number
