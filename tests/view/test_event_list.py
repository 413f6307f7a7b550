"""Test the event log in the panel."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import pytest
import viser

from katana450.arm.control.actor import SERVER
from katana450.arm.control.event_log import LogEntry
from katana450.arm.control.lease import Person, Role
from katana450.arm.control.state import Finding, Reason
from katana450.extensions.joint_view.event_list import EventList
from tests.view.gestures import ANNA, RecordedGestures

LIMIT = Finding(Reason.AXIS_LIMIT, 1.0, 0)


@pytest.fixture(scope="module")
def server() -> Iterator[viser.ViserServer]:
    server = viser.ViserServer("127.0.0.1", 0, verbose=False)
    yield server
    server.stop()


def shown(events: EventList, *entries: LogEntry) -> str:
    events.follow(entries)
    return events.content


def test_entry_names_the_participant(server: viser.ViserServer) -> None:
    events = EventList(server.gui, RecordedGestures())
    evil = replace(ANNA, person=Person("eve", "<b>Eve</b>", Role.OPERATOR))
    assert "Anna" in shown(events, LogEntry(1.0, LIMIT, True, ANNA, "Nudge"))
    assert "&lt;b&gt;Eve" in shown(events, LogEntry(2.0, LIMIT, True, evil, "Nudge"))
    assert "the server" not in shown(events, LogEntry(3.0, LIMIT, True, SERVER, "Stop"))


def test_problem_of_the_log_is_shown_while_it_lasts(server: viser.ViserServer) -> None:
    gestures = RecordedGestures()
    events = EventList(server.gui, gestures)
    entry = LogEntry(1.0, LIMIT, True, ANNA, "Nudge")
    for entries in ((), (entry,)):
        gestures.log_problem = "The event log cannot be written: No space left on device."
        assert gestures.log_problem in shown(events, *entries)
        gestures.log_problem = ""
        assert "cannot be written" not in shown(events, *entries)
