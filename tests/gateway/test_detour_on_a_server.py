"""A detour: offered by the state, and taken by a request."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator

import pytest

from katana450.assembly.robot_session import DescribedRobot
from katana450.client import Client, RefusedError
from katana450.server.api import answers, requests
from tests.gateway.virtual import VirtualServer

TARGET = (0.008, 0.025, 0.443)
"""[m] A point above the shoulder. A drag there from the ready posture ends at limits."""


@pytest.fixture
def local(described: DescribedRobot) -> Iterator[VirtualServer]:
    """Return a server that offers detours."""
    with VirtualServer(described, detours=True) as server:
        yield server


def wait_for(program: Client, holds: Callable[[answers.State], bool]) -> answers.State:
    deadline = time.monotonic() + 60.0
    while not holds(state := program.query(answers.State)):
        assert time.monotonic() < deadline, state
        time.sleep(0.02)
    return state


def held_at_the_gap(program: Client) -> answers.State:
    """Drag from the ready posture to TARGET, and return the state with a detour on offer."""
    program.go(requests.Home())
    program.go(requests.Position(p=TARGET))
    return wait_for(program, lambda state: state.detour is not None)


def distance(state: answers.State) -> float:
    assert state.T is not None
    return math.dist([row[3] for row in state.T[:3]], TARGET)


def test_offered_detour_is_taken_by_go(program: Client) -> None:
    state = held_at_the_gap(program)
    assert state.detour is not None
    assert state.status == "gap"
    assert f"Reachable by a {state.detour:.1f} s detour: press Enter or Go" in state.why
    assert not state.moving
    assert distance(state) > 0.01
    program.ask(requests.EndDrag())
    rested = program.query(answers.State)
    assert rested.q == state.q
    arrived = program.go(requests.Go())
    assert distance(arrived) < 1e-6
    assert arrived.branch == state.branch
    assert arrived.detour is None


def test_go_is_refused_without_an_offer_and_after_a_change(program: Client) -> None:
    program.go(requests.Home())
    with pytest.raises(RefusedError, match="No detour is offered"):
        program.ask(requests.Go())
    state = held_at_the_gap(program)
    program.ask(requests.Hold())
    with pytest.raises(RefusedError, match="No detour is offered"):
        program.ask(requests.Go())
    assert program.query(answers.State).q == state.q


def test_stop_withdraws_the_offer(program: Client) -> None:
    held_at_the_gap(program)
    program.ask(requests.Stop())
    wait_for(program, lambda state: state.stopped is not None)
    with pytest.raises(RefusedError, match="clear the stop first"):
        program.ask(requests.Go())
    program.clear_stop()
    with pytest.raises(RefusedError, match="No detour is offered"):
        program.ask(requests.Go())
    assert program.query(answers.State).detour is None
