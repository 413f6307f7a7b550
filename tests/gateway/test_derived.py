"""Answers that follow from a snapshot are worked out once, whoever asks."""

from __future__ import annotations

import gc
from typing import cast
from unittest.mock import Mock

import pytest

from app.api import answers, requests
from app.control.choices import Choice
from app.control.lease import Role
from app.control.state import State
from app.errors import InputError
from app.gateway import derived
from app.gateway.arm import Arm
from app.gateway.budget import Budgets
from app.gateway.derived import once
from app.gateway.desk import Desk
from app.gateway.door import Visitor
from app.gateway.hub import Hub
from app.runtime.board import Snapshot


def _snapshot() -> Snapshot:
    return Snapshot(cast(State, None), 0)


def test_branches_are_computed_once_per_snapshot_for_all_who_ask() -> None:
    hub, arm, computed = Hub(lambda: 0.0), Mock(snapshot=_snapshot()), []

    def choices() -> tuple[Choice, ...]:
        computed.append(1)
        return ()

    arm.choices = choices
    hub.arm = cast(Arm, arm)
    budgets = Budgets(hub.clock)
    for number in range(3):
        visitor = Visitor(f"session-{number}", "Viewer", Role.VIEWER)
        window = hub.join(visitor, "a-page", lambda _notice: None)
        request = requests.Look(at="branches", id=number)
        answer = Desk(hub).do(window, request, budgets.of(visitor.session))
        assert answer == answers.Branches(choices=[], id=number)
    assert len(computed) == 1
    arm.snapshot = _snapshot()
    Desk(hub).look("branches")
    assert len(computed) == 2


def test_what_was_worked_out_goes_with_its_snapshot() -> None:
    gc.collect()
    snapshot = _snapshot()
    before = len(derived._FOUND)
    assert once(snapshot, "a", lambda: 1) == once(snapshot, "a", lambda: 2) == 1
    assert len(derived._FOUND) == before + 1
    del snapshot
    gc.collect()
    assert len(derived._FOUND) == before


def test_an_error_is_not_kept() -> None:
    snapshot = _snapshot()

    def fail() -> int:
        raise InputError("no branches")

    with pytest.raises(InputError):
        once(snapshot, "a", fail)
    assert once(snapshot, "a", lambda: 1) == 1
