"""Test which STOPs and requests of muted and absent people count, with a simulated clock."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, cast

import numpy as np
import pytest

from katana450.arm.control import commands as cmd
from katana450.arm.control.actor import CommandChannel
from katana450.arm.control.lease import Role
from katana450.arm.control.session import Session
from katana450.arm.control.state import ActiveStop
from katana450.arm.control.stop_cause import pressed
from katana450.errors import LeaseError
from katana450.maths.kinematics.velocity import JogFrame
from katana450.server.api import requests
from katana450.server.service import people as people_module
from katana450.server.service.budget import Budgets, BusyError
from katana450.server.service.dispatcher import Dispatcher
from katana450.server.service.hub import Hub
from katana450.server.service.identity import Identity
from katana450.server.service.mutes import STOP_INTERVAL, MutedError
from katana450.server.service.participants import Participant, actor_of
from katana450.server.service.people import Connection, ConnectionKind
from katana450.server.service.recorder import Note, Recorder
from tests.gateway.test_hub import FakeArm

VERA = Identity("vera", "Vera", Role.VIEWER, "Vera")
ODA = Identity("oda", "Oda", Role.OPERATOR, "Oda")
JOG = cmd.Jog(np.array((0.1, 0.0, 0.0, 0.0, 0.0)), JogFrame.BASE)


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

    def stops(self, participant: Participant, press: str | None = None) -> bool:
        """Press STOP in ``participant``; return whether the arm is stopped."""
        try:
            self.hub.stop(participant.actor, press)
        except MutedError:
            assert self.hub.stopped is None
            return False
        return self.hub.stopped is not None


@pytest.fixture
def room(session: Session) -> Room:
    return Room(session)


def test_muted_viewer_stops_once_per_interval(room: Room) -> None:
    room.hub.people.mutes.add("vera", 10.0)
    assert room.stops(room.vera)
    room.clear()
    room.t += 3.0
    with pytest.raises(MutedError, match=r"counts in 7\.0 s"):
        room.hub.stop(room.vera.actor)
    assert not room.stops(room.vera)
    room.t += 7.0
    assert room.stops(room.vera)
    room.hub.people.mutes.remove("vera")
    for _ in range(3):
        room.clear()
        assert room.stops(room.vera)


def test_press_while_the_arm_is_stopped_uses_up_nothing(room: Room) -> None:
    room.hub.people.mutes.add("vera", 10.0)
    room.hub.stop(room.oda.actor)
    sent = room.arm.stops
    for _ in range(20):
        assert room.stops(room.vera)
    assert room.arm.stops == sent
    room.clear()
    assert room.stops(room.vera)


def test_mute_concerns_no_other_identity(room: Room) -> None:
    room.hub.people.mutes.add("vera", 10.0)
    assert room.stops(room.vera)
    room.clear()
    assert not room.stops(room.vera)
    other = room.join(Identity("willi", "Willi", Role.VIEWER, "Willi"))
    assert room.stops(other)
    room.clear()
    assert room.stops(room.oda)


def test_driver_is_never_muted(room: Room) -> None:
    room.hub.people.mutes.add("oda", 10.0)
    room.hub.move(room.oda, JOG)
    for _ in range(3):
        assert room.stops(room.oda)
        room.clear()
    # In another window of the driver too, and over HTTP.
    room.hub.stop(actor_of(ODA, CommandChannel.HTTP))
    assert room.hub.stopped is not None
    room.clear()
    room.hub.release_lease(room.oda)
    assert room.stops(room.oda)
    room.clear()
    room.hub.release_lease(room.oda)
    assert not room.stops(room.oda)


def test_repeated_press_of_a_muted_viewer_counts_once(room: Room) -> None:
    room.hub.people.mutes.add("vera", 10.0)
    assert room.stops(room.vera, "one press")
    room.clear()
    assert room.hub.stop(room.vera.actor, "one press") == 0
    assert room.hub.stopped is None


def test_press_on_the_port_of_stop_counts_too(room: Room) -> None:
    room.hub.people.mutes.add("vera", 10.0)
    cause = pressed("Vera", room.vera.person.key, "another path", 0.0)
    room.arm.rest = replace(room.arm.rest, stopped=ActiveStop(0.0, 0.0, cause))
    room.hub.tick()
    assert room.hub.stopped is not None
    room.arm.rest = replace(room.arm.rest, stopped=None)
    room.clear()
    room.hub.tick()
    room.t += 9.0
    assert not room.stops(room.vera)
    room.t += 1.0
    assert room.stops(room.vera)


def test_heartbeats_name_the_drivers(room: Room) -> None:
    heard = []
    for step in (lambda: None, lambda: room.hub.move(room.oda, JOG)):
        step()
        room.hub.tick()
        heard.append(room.arm.drivers)
    assert heard == [(), ("oda",)]


def test_refused_stop_is_recorded_once(room: Room) -> None:
    recorder = room.hub.recorder
    room.hub.people.mutes.add("vera", 10.0)
    assert room.stops(room.vera)
    room.clear()
    recorder.enabled = True
    with pytest.raises(MutedError):
        room.hub.stop(actor_of(VERA, CommandChannel.HTTP))
    (note,) = notes(recorder)
    assert (note.kind, note.what, note.actor) == (
        "refusal",
        {"request": "stop"},
        actor_of(VERA, CommandChannel.HTTP),
    )
    budget = Budgets(room.hub.clock).of("vera")
    with pytest.raises(MutedError):
        Dispatcher(room.hub).handle(room.vera, requests.Stop(), budget)
    assert len(notes(recorder)) == 1


def notes(recorder: Recorder) -> list[Note]:
    """Return all notes that wait, and remove them."""
    found = [recorder.notes.get() for _ in range(recorder.notes.qsize())]
    return [each for each in found if each is not None]


def test_refused_requests_of_a_muted_person_are_recorded_and_cost(room: Room) -> None:
    dispatcher, budget = Dispatcher(room.hub), Budgets(room.hub.clock, lambda: 0.0).of("oda")
    room.hub.people.mutes.add("oda", 60.0)
    request = requests.ListPeople()
    with pytest.raises(LeaseError, match="Only an admin"):
        dispatcher.handle(room.oda, request, budget)
    room.hub.recorder.enabled = True
    with pytest.raises(MutedError):
        dispatcher.handle(room.oda, request, budget)
    (note,) = notes(room.hub.recorder)
    assert (note.kind, note.what) == ("refusal", request)
    gone = False
    for _ in range(20_000):
        try:
            dispatcher.handle(room.oda, request, budget)
        except BusyError as error:
            gone = gone or error.gone
        except MutedError:
            pass
    assert gone


def test_absent_person_stops_once_per_interval(room: Room) -> None:
    people = room.hub.people
    people.kick(VERA, 60.0)
    absent = actor_of(VERA, CommandChannel.PAGE)
    room.hub.stop(absent)
    room.clear()
    with pytest.raises(MutedError):
        room.hub.stop(absent)
    room.t += STOP_INTERVAL
    room.hub.stop(absent)
    assert room.hub.stopped is not None
    room.t += 60.0
    room.clear()
    # Back again, and not muted.
    for _ in range(3):
        assert room.stops(room.vera)
        room.clear()


def test_people_are_shown_while_they_are_connected_muted_or_kept_out(room: Room) -> None:
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
    people.mutes.add("vera")
    assert shown() == [VERA]
    people.mutes.remove("vera")
    people.kick(VERA, math.inf)
    assert shown() == []
    # The number stays the same, and is never given again.
    (number,) = (number for number in range(10) if people.identity(number) == VERA)
    with people.connected(Connection(ODA, ConnectionKind.PAGE, "127.0.0.1")):
        assert list(people.shown) == [number + 1]


def test_connected_muted_and_absent_people_are_never_forgotten(
    room: Room, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(people_module, "MAX_REMEMBERED", 3)
    people = room.hub.people
    kept = [Identity(name, name, Role.VIEWER) for name in ("present", "muted", "absent")]
    connections = [Connection(each, ConnectionKind.PAGE, "127.0.0.1") for each in kept]
    for connection in connections:
        people.add(connection)
    people.mutes.add("muted")
    people.kick(kept[2], 60.0)
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


def test_mutes_and_absences_are_restored_with_their_people(room: Room) -> None:
    people = room.hub.people
    people.restore(VERA, 20.0, -5.0)
    people.restore(ODA, None, 30.0)
    people.restore(Identity("otto", "Otto", Role.VIEWER), None, 0.0)
    assert list(people.shown.values()) == [VERA, ODA]
    assert (people.mutes.interval("vera"), people.kept_out("vera")) == (20.0, 0.0)
    assert (people.mutes.interval("oda"), people.kept_out("oda")) == (None, 30.0)
