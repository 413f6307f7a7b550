"""Test that every waiting thread receives the outcome of its ticket."""

from __future__ import annotations

from katana450.arm.control.state import Outcome, Verdict
from katana450.arm.runtime.outcomes import Outcomes

OUTCOME = Outcome(Verdict.ACCEPTED)


def test_all_futures_of_a_ticket_receive_its_outcome() -> None:
    outcomes = Outcomes()
    first, cancelled, last = (outcomes.of(7) for _ in range(3))
    cancelled.cancel()
    assert not first.done()
    outcomes.note([(7, OUTCOME)])
    assert first.result(0.0) is OUTCOME
    assert last.result(0.0) is OUTCOME
    assert outcomes.of(7).result(0.0) is OUTCOME
