"""Test who is shown, kept out and remembered, and that absent people can stop the arm."""

from __future__ import annotations

import math
from typing import Any, cast

import pytest

from katana450.arm.control import commands as cmd
from katana450.arm.control.actor import CommandChannel
from katana450.arm.control.lease import Role
from katana450.arm.control.session import Session
from katana450.server.service import people as people_module
from katana450.server.service.hub import Hub
from katana450.server.service.identity import Identity
from katana450.server.service.participants import Participant, actor_of
from katana450.server.service.people import Connection, ConnectionKind
from tests.gateway.test_hub import FakeArm

VERA = Identity("vera", "Vera", Role.VIEWER, "Vera")
ODA = Identity("oda", "Oda", Role.OPERATOR, "Oda")


class Room:
    """A hub with a viewer, an operator, an arm and a clock that tests set."""

    def __init__(self, session: Session) -> None:
        self.t = 100.0
        self.hub = Hub(lambda: self.t)
        self.arm = FakeArm(session.begin(session.ready, 0.0, 0.0))
        self.hub.gate.arm = cast(Any, self.arm)
        self.vera, self.oda = (self.join(each) for each in (VERA, ODA))

    def join(self, identity: Identity) -> Participant:
        return self.hub.join(identity, "a-page-of-this-person", lambda _: None)

    def clear(self) -> None:
        self.hub.move(self.oda, cmd.ClearStop())


@pytest.fixture
def room(session: Session) -> Room:
    return Room(session)


def test_every_press_of_an_absent_person_stops_the_arm(room: Room) -> None:
    room.hub.people.kick(VERA, 60.0)
    for _ in range(2):
        room.hub.stop(actor_of(VERA, CommandChannel.PAGE))
        assert room.hub.stopped is not None
        room.clear()


def test_people_are_shown_while_they_are_connected_or_kept_out(room: Room) -> None:
    people = room.hub.people
    connection = Connection(VERA, ConnectionKind.PAGE, "127.0.0.1")

    def shown() -> list[Identity]:
        return list(people.shown.values())

    with people.connected(connection):
        assert shown() == [VERA]
        assert people.kick(VERA, 60.0) == 1
        assert connection.kicked.is_set()
    assert shown() == [VERA]
    room.t += 59.0
    assert (people.kept_out("vera"), shown()) == (1.0, [VERA])
    room.t += 1.0
    assert (people.kept_out("vera"), shown()) == (0.0, [])
    people.kick(VERA, math.inf)
    assert shown() == []
    # The number stays the same, and is never given again.
    (number,) = (number for number in range(10) if people.identity(number) == VERA)
    with people.connected(Connection(ODA, ConnectionKind.PAGE, "127.0.0.1")):
        assert list(people.shown) == [number + 1]


def test_connected_and_absent_people_are_never_forgotten(
    room: Room, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(people_module, "MAX_REMEMBERED", 3)
    people = room.hub.people
    kept = [Identity(name, name, Role.VIEWER) for name in ("present", "absent")]
    connections = [Connection(each, ConnectionKind.PAGE, "127.0.0.1") for each in kept]
    for connection in connections:
        people.add(connection)
    people.kick(kept[1], 60.0)
    for connection in connections[1:]:
        people.remove(connection)
    for number in range(5):
        session = f"visitor {number}"
        visitor = Identity(session, "Visitor", Role.VIEWER)
        with people.connected(Connection(visitor, ConnectionKind.PAGE, "127.0.0.1")):
            people.refused(session)
            # Also those that come late are counted.
            assert people.refusals(session) == 1
        assert list(people.shown.values()) == kept
    assert people.refusals("visitor 0") == 0


def test_absences_are_restored_with_their_people(room: Room) -> None:
    people = room.hub.people
    people.restore(VERA, -5.0)
    people.restore(ODA, 30.0)
    assert list(people.shown.values()) == [ODA]
    assert (people.kept_out("vera"), people.kept_out("oda")) == (0.0, 30.0)
