"""A detour: offered by the state, and taken by a request."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator

import pytest

from katana450.assembly.robot_session import DescribedRobot
from katana450.client import Client
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
