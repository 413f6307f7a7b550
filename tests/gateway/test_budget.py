"""Limits of rates: buckets of tokens, budgets of people, and the flow of frames."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from katana450.errors import InputError
from katana450.server.service.budget import (
    IDENTITY_BUDGET,
    MAX_DEBT,
    REQUEST_COST,
    SHARED_BUDGET,
    Budget,
    Budgets,
    BusyError,
)
from katana450.server.service.limits import SenderBuckets, TokenBucket
from katana450.server.viser_bridge.proxy import (
    MAX_IN_FLIGHT_BYTES,
    MAX_REMEMBERED_FRAMES,
    OVERDUE,
    FlowControl,
)


class Clocks:
    """A clock, and a processor time that advances on request."""

    def __init__(self) -> None:
        self.now = 0.0
        self.used = 0.0

    def budgets(self) -> Budgets:
        return Budgets(lambda: self.now, lambda: self.used)

    def ask(
        self, budget: Budget, seconds: float, driver: str = "", *, question: bool = True
    ) -> None:
        with budget.charged(driver, question=question):
            self.used += seconds


def test_all_windows_of_an_identity_pay_from_one_budget() -> None:
    clocks = Clocks()
    budgets = clocks.budgets()
    clocks.ask(budgets.of("a"), IDENTITY_BUDGET)
    with pytest.raises(BusyError) as refused:
        clocks.ask(budgets.of("a"), 0.0)
    assert refused.value.retry == pytest.approx(0.1)
    assert isinstance(refused.value, InputError)
    assert "Try again in" in str(refused.value)
    clocks.ask(budgets.of("b"), 0.01)
    clocks.now += 1.01
    clocks.ask(budgets.of("a"), 0.0)


def test_viewers_share_a_budget_and_the_driver_does_not() -> None:
    clocks = Clocks()
    budgets = clocks.budgets()
    viewers = [budgets.of(name) for name in "abc"]
    for viewer in viewers[:2]:
        clocks.ask(viewer, SHARED_BUDGET / 2.0)
    with pytest.raises(BusyError) as refused:
        clocks.ask(viewers[2], 0.0)
    assert not refused.value.gone
    # Other requests than questions do not depend on the shared budget.
    clocks.ask(viewers[2], 0.0, question=False)
    clocks.ask(viewers[2], IDENTITY_BUDGET / 2.0, driver="c/page")
    with pytest.raises(BusyError):
        clocks.ask(viewers[0], 0.0, question=False)


def test_another_window_of_the_driver_cannot_empty_the_drivers_budget() -> None:
    clocks = Clocks()
    budget = clocks.budgets().of("a")
    clocks.ask(budget, 10.0 * IDENTITY_BUDGET)
    for _ in range(50):
        clocks.ask(budget, 0.001, driver="a/page")
    with pytest.raises(BusyError):
        clocks.ask(budget, 0.0)


def test_identity_that_ignores_refusals_is_disconnected_and_later_accepted() -> None:
    clocks = Clocks()
    budget = clocks.budgets().of("a")
    clocks.ask(budget, IDENTITY_BUDGET)
    dropped = []
    for _ in range(int(1.1 * MAX_DEBT / REQUEST_COST)):
        with pytest.raises(BusyError) as refused:
            clocks.ask(budget, 0.0)
        dropped.append(refused.value.gone)
    assert dropped.index(True) == pytest.approx(MAX_DEBT / REQUEST_COST, rel=0.01)
    assert budget.is_exhausted()
    clocks.now += 0.6 * MAX_DEBT / IDENTITY_BUDGET
    assert not budget.is_exhausted()
    clocks.now += 0.5 * MAX_DEBT / IDENTITY_BUDGET
    clocks.ask(budget, 0.0)


def test_bucket_gives_its_tokens_and_refills_with_time() -> None:
    bucket = TokenBucket(10.0, 3.0, 0.0)
    assert [bucket.take(0.0) for _ in range(4)] == [True, True, True, False]
    assert not bucket.take(0.09)
    assert bucket.take(0.11)
    assert [bucket.take(100.0) for _ in range(4)] == [True, True, True, False]


def test_bucket_does_not_refill_when_time_goes_back() -> None:
    bucket = TokenBucket(1.0, 1.0, 10.0)
    assert bucket.take(10.0)
    assert not bucket.take(0.0)
    assert not bucket.take(10.5)


def test_browser_without_acknowledgements_gets_all_frames() -> None:
    flow = FlowControl()
    for t in range(2 * MAX_REMEMBERED_FRAMES):
        flow.sent(MAX_IN_FLIGHT_BYTES, float(t))
    assert flow.has_room(1e9)
    assert flow.age(1e9) == 0.0


def test_age_is_that_of_the_oldest_unseen_frame() -> None:
    flow = FlowControl()
    for t in (1.0, 2.0, 3.0):
        flow.sent(100, t)
    assert flow.seen(1, 3.0)
    assert flow.age(3.5) == pytest.approx(1.5)
    assert flow.seen(3, 3.5)
    assert flow.age(99.0) == 0.0


def test_no_frame_is_sent_while_one_is_overdue() -> None:
    flow = FlowControl()
    flow.sent(100, 0.0)
    assert flow.seen(1, 0.1)
    flow.sent(100, 1.0)
    assert flow.has_room(1.0 + 0.99 * OVERDUE)
    assert not flow.has_room(1.0 + OVERDUE)
    assert flow.seen(2, 1.0 + OVERDUE)
    # Now the delay of this line is known.
    flow.sent(100, 2.0)
    assert flow.has_room(2.0 + 1.99 * OVERDUE)
    assert not flow.has_room(2.0 + 2.0 * OVERDUE)


def test_frame_larger_than_the_line_is_sent_alone() -> None:
    flow = FlowControl()
    flow.sent(100, 0.0)
    assert flow.seen(1, 0.1)
    assert flow.has_room(0.1)
    flow.sent(10 * MAX_IN_FLIGHT_BYTES, 0.1)
    assert not flow.has_room(0.1)


@settings(deadline=None)
@given(st.floats(1.5e4, 5e6), st.floats(0.0, 0.3), st.integers(200, 3000))
def test_flow_control_keeps_frames_fresh_and_uses_the_bandwidth(
    rate: float, trip: float, size: int
) -> None:
    ages = ages_after(20.0, lambda _: rate, trip, size)
    assert max(ages) < 1.2 + trip
    assert len(ages) > 0.5 * 40.0 * min(rate / size, 1.0 / FRAME)


@pytest.mark.parametrize("trip", [0.0, 0.05])
@pytest.mark.parametrize("size", [300, 2000])
def test_little_data_is_in_flight_when_a_line_becomes_slow(size: int, trip: float) -> None:
    ages = ages_after(20.0, lambda t: 5e6 if t < 30.0 else 1.5e4, trip, size)
    assert max(ages) < 1.5
    assert np.median(ages[len(ages) // 2 :]) < 0.6


FRAME = 0.016
"""[s]"""


def ages_after(warm: float, rate: Callable[[float], float], trip: float, size: int) -> list[float]:
    """Return the ages of the frames of ``size`` seen from ``warm`` [s] to the end of a minute.

    The line has ``rate`` [bytes/s] and round trip ``trip`` [s]; viser has a frame every FRAME.
    """
    flow, t, free_at, count = FlowControl(), 0.0, 0.0, 1
    flow.sent(100, 0.0)
    assert flow.seen(1, 0.0)
    on_the_line: deque[tuple[float, float]] = deque()
    ages = []
    while t < 60.0:
        t += FRAME
        while on_the_line and on_the_line[0][0] + trip <= t:
            arrived, sent_at = on_the_line.popleft()
            count += 1
            assert flow.seen(count, t)
            if t > warm:
                ages.append(arrived - sent_at)
        if flow.has_room(t):
            flow.sent(size, t)
            free_at = max(free_at, t) + size / rate(t)
            on_the_line.append((free_at, t))
    return ages


@pytest.mark.parametrize("count", [-1, 1, 4, 10**30])
def test_impossible_acknowledgement_is_ignored(count: int) -> None:
    flow = FlowControl()
    for t in range(3):
        flow.sent(100, float(t))
    assert flow.seen(2, 2.0)
    assert not flow.seen(count, 2.5)
    assert flow.age(3.0) == pytest.approx(1.0)


def test_senders_have_buckets_of_their_own_and_one_together() -> None:
    buckets = SenderBuckets(1.0, 2.0, 3, TokenBucket(0.0, 5.0, 0.0))
    assert [buckets.take("Anna", 0.0) for _ in range(3)] == [True, True, False]
    assert [buckets.take(sender, 0.0) for sender in ("Bert", "Cleo", "Dora", "Eve")] == [
        *(True, True, True, False)
    ]
    # The oldest one was replaced.
    assert len(buckets) == 3
