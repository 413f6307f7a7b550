"""Test that answers that depend on a snapshot alone are computed once for all clients."""

from __future__ import annotations

from typing import cast
from unittest.mock import Mock

import pytest

from katana450.arm.control.branch_options import BranchOption
from katana450.arm.control.lease import Role
from katana450.arm.control.state import State
from katana450.arm.runtime.state_publisher import Snapshot
from katana450.errors import InputError
from katana450.server.api import answers, requests
from katana450.server.service.arm_handle import ArmHandle
from katana450.server.service.budget import Budgets
from katana450.server.service.derived import once
from katana450.server.service.dispatcher import Dispatcher
from katana450.server.service.hub import Hub
from katana450.server.service.identity import Identity


def _snapshot() -> Snapshot:
    return Snapshot(cast(State, Mock()), 0)


def test_branches_are_computed_once_per_snapshot() -> None:
    hub, arm, computed = Hub(lambda: 0.0), Mock(snapshot=_snapshot()), []

    def choices() -> tuple[BranchOption, ...]:
        computed.append(1)
        return ()

    arm.choices = choices
    hub.gate.arm = cast(ArmHandle, arm)
    budgets = Budgets(hub.clock)
    for number in range(3):
        identity = Identity(f"session-{number}", "Viewer", Role.VIEWER)
        window = hub.join(identity, "a-page", lambda _notice: None)
        request = requests.Query(at="branches", id=number)
        answer = Dispatcher(hub).handle(window, request, budgets.of(identity.session))
        assert answer == answers.Branches(choices=[], id=number)
    assert len(computed) == 1
    arm.snapshot = _snapshot()
    Dispatcher(hub).query("branches")
    assert len(computed) == 2


def test_error_is_not_cached() -> None:
    snapshot = _snapshot()

    def fail() -> int:
        raise InputError("no branches")

    with pytest.raises(InputError):
        once(snapshot, "a", fail)
    assert once(snapshot, "a", lambda: 1) == 1
