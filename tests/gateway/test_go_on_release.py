"""Test that a detour which is taken when a drag ends passes the command gate."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from typing import cast

import pytest

from katana450.arm.control import commands as cmd
from katana450.arm.control.modes import JointTarget, Positioning
from katana450.arm.control.plans import plan_to
from katana450.arm.control.session import Session
from katana450.arm.runtime.detour_planner import DetourPlanner
from katana450.arm.runtime.loop_timing import LoopTiming
from katana450.arm.runtime.mailbox import CommandSink
from katana450.arm.runtime.planning_worker import PlanningWorker
from katana450.arm.runtime.state_publisher import Snapshot, StatePublisher
from katana450.server.service.recorder import Note
from tests.gateway.test_hub import PAGES, Table


@pytest.fixture
def table(session: Session) -> Table:
    table = Table(session.begin(session.ready, 0.0, 0.0))
    table.hub.recorder.enabled = True
    table.hub.move(table.join(PAGES[0]), cmd.EndDrag())
    return table


@pytest.fixture
def offer(session: Session, table: Table) -> Iterator[Callable[[], None]]:
    """Return a function that publishes a state with a detour on offer, after the drag."""
    state = table.arm.rest
    goal = state.q + 0.1
    plan = plan_to(session.require_arm(), session.world_at(state), state, goal)
    offered = replace(state, mode=Positioning(JointTarget(state.q), detour=plan))
    publisher = StatePublisher(Snapshot(state, 0), LoopTiming(0.01))
    worker = PlanningWorker(session, publisher, cast("CommandSink", table.arm))
    worker.newest_actor = table.arm.actors[-1]
    planner = DetourPlanner(session, publisher, worker, partial(table.hub.gate.submit, cmd.Go()))
    planner.start()
    yield lambda: publisher.publish(Snapshot(offered, 0))
    planner.stop()


def next_note(table: Table, what: type) -> Note:
    """Return the next note of the event log about a command of class ``what``."""
    end = time.monotonic() + 20.0
    while True:
        note = table.hub.recorder.notes.get(timeout=max(end - time.monotonic(), 0.01))
        assert note is not None
        if isinstance(note.what, what):
            return note


def test_detour_is_recorded_with_the_person_who_dragged(
    table: Table, offer: Callable[[], None]
) -> None:
    offer()
    note = next_note(table, cmd.Go)
    assert (note.kind, note.outcome) == ("command", "accepted")
    assert note.actor is not None
    assert note.actor.person == table.hub.lease.holder
    assert table.arm.commands[-1] == cmd.Go()


@pytest.mark.parametrize("stops", [False, True])
def test_no_detour_is_taken_after_a_stop_or_a_released_lease(
    table: Table, offer: Callable[[], None], stops: bool
) -> None:
    (participant,) = table.hub.participants
    if stops:
        table.stop("Vera")
        table.hub.move(participant, cmd.ClearStop())
    else:
        table.hub.release_lease(participant)
    holder = table.hub.lease.holder
    offer()
    assert next_note(table, cmd.Go).kind == "refusal"
    assert cmd.Go() not in table.arm.commands
    assert table.hub.lease.holder == holder
