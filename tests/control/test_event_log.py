"""Every cause that holds the arm back makes one entry in the event log, and has a text."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import pytest

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.session.session import Session
from katana450.arm.control.state.findings import LogEntry, entries_between
from katana450.arm.control.state.messages import sentence
from katana450.arm.control.state.state import Reason, State
from tests.ticks import TICK, during


def run(
    session: Session, state: State, commands: Sequence[cmd.Command], ticks: int
) -> tuple[State, list[LogEntry]]:
    passed = [state, *during(session, state, ticks * TICK, *commands)]
    entries = [entry for pair in pairwise(passed) for entry in entries_between(*pair)]
    return passed[-1], entries


FAULTS: dict[Reason, list[cmd.Command]] = {
    Reason.AXIS_LIMIT: [cmd.Joint(1, 4.0)],
    Reason.GRIPPER_LIMIT: [cmd.Gripper(2.0)],
    Reason.OUT_OF_REACH: [cmd.Position(np.array([0.9, 0.0, 0.1]))],
    Reason.STOPPED: [cmd.Stop()],
    Reason.PAUSED: [cmd.Pause()],
}


@pytest.mark.parametrize("reason", FAULTS)
def test_finding_is_logged_once(session: Session, state: State, reason: Reason) -> None:
    state, entries = run(session, state, FAULTS[reason], 40)
    came = [entry for entry in entries if entry.began and entry.finding.reason is reason]
    assert len(came) == 1
    assert 0.0 < came[0].t <= state.t
    assert sentence(state)


def test_end_of_a_finding_is_logged(session: Session, state: State) -> None:
    stopped, _ = run(session, state, [cmd.Stop()], 120)
    released, entries = run(session, stopped, [cmd.ClearStop()], 3)
    assert [(e.finding.reason, e.began) for e in entries] == [(Reason.STOPPED, False)]
    assert released.findings == ()


def test_changed_amount_makes_no_entry(session: Session, state: State) -> None:
    far, _ = run(session, state, [cmd.Position(np.array([0.9, 0.0, 0.1]))], 40)
    farther, more = run(session, far, [cmd.Position(np.array([0.95, 0.0, 0.1]))], 40)
    assert farther.findings[0].reason is Reason.OUT_OF_REACH
    assert [entry for entry in more if entry.finding.reason is Reason.OUT_OF_REACH] == []
