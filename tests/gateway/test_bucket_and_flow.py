"""How often something may happen, and how far a browser may be behind."""

from __future__ import annotations

import pytest

from app.gateway.bucket import Bucket
from app.gateway.flow import LONGEST, OVERDUE, Flow


def test_a_bucket_gives_what_it_holds_and_fills_with_time() -> None:
    bucket = Bucket(10.0, 3.0, 0.0)
    assert [bucket.take(0.0) for _ in range(4)] == [True, True, True, False]
    assert not bucket.take(0.09)
    assert bucket.take(0.11)
    assert [bucket.take(100.0) for _ in range(4)] == [True, True, True, False]


def test_a_bucket_takes_many_or_none() -> None:
    bucket = Bucket(1.0, 5.0, 0.0)
    assert not bucket.take(0.0, 6.0)
    assert bucket.take(0.0, 5.0)


def test_time_that_goes_back_fills_nothing() -> None:
    bucket = Bucket(1.0, 1.0, 10.0)
    assert bucket.take(10.0)
    assert not bucket.take(0.0)
    assert not bucket.take(10.5)


def test_who_says_nothing_of_what_it_sees_is_sent_all() -> None:
    flow = Flow()
    for t in range(2 * LONGEST):
        flow.sent(float(t))
    assert flow.has_room(1e9)
    assert flow.age(1e9) == 0.0


def test_the_age_is_that_of_the_oldest_frame_that_is_not_seen() -> None:
    flow = Flow()
    for t in (1.0, 2.0, 3.0):
        flow.sent(t)
    assert flow.seen(1)
    assert flow.age(3.5) == pytest.approx(1.5)
    assert flow.seen(3)
    assert flow.age(99.0) == 0.0


def test_nothing_more_is_sent_while_something_is_overdue() -> None:
    flow = Flow()
    flow.sent(0.0)
    assert flow.seen(1)
    flow.sent(1.0)
    assert flow.has_room(1.0 + 0.99 * OVERDUE)
    assert not flow.has_room(1.0 + OVERDUE)
    assert flow.seen(2)
    assert flow.has_room(1.0 + OVERDUE)


@pytest.mark.parametrize("count", [-1, 0, 4, 10**30])
def test_what_cannot_have_been_seen_is_no_word(count: int) -> None:
    flow = Flow()
    for t in range(3):
        flow.sent(float(t))
    assert flow.seen(2)
    assert not flow.seen(1 if count == 0 else count)
    assert flow.age(3.0) == pytest.approx(1.0)
