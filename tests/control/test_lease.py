"""The lease: every event by every person in every state has its defined effect, or none."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from katana450.arm.control.lease import LEASE_TIMEOUT, RETURN_TIME, Lease, Person, Role
from katana450.errors import LeaseError

ANNA = Person("a", "Anna", Role.OPERATOR)
BERT = Person("b", "Bert", Role.OPERATOR)
CARA = Person("c", "Cara", Role.ADMIN)
DORA = Person("d", "Dora", Role.VIEWER)
PEOPLE = (ANNA, BERT, CARA, DORA)

Event = Callable[[Lease, Person, Person, float], Lease]

EVENTS: dict[str, Event] = {
    "acquire": lambda lease, person, _, t: lease.acquire(person, t),
    "take": lambda lease, person, _, t: lease.take(person, t),
    "request": lambda lease, person, _, __: lease.request(person),
    "withdraw": lambda lease, person, _, __: lease.withdraw(person),
    "hand over": lambda lease, person, to, t: lease.hand_over(person, to, t),
    "release": lambda lease, person, _, __: lease.release(person),
    "hear": lambda lease, person, _, t: lease.hear(person, t),
    "close": lambda lease, person, _, t: lease.close(person, t),
    "leave": lambda lease, person, _, __: lease.leave(person),
    "expire": lambda lease, _, __, t: lease.expire(t),
}


def legal(event: str, lease: Lease, person: Person, to: Person) -> bool:
    """Return whether the rules of the lease allow the event, written independently of the code."""
    mine = lease.holder == person
    # An arm whose holder has closed its window is free for others.
    free = lease.holder is None or (lease.left < math.inf and not mine)
    drives = person.role is not Role.VIEWER
    match event:
        case "acquire":
            return free and drives
        case "take":
            return drives and not mine and (free or person.role is Role.ADMIN)
        case "request":
            return drives and not free and not mine and person not in lease.waiting
        case "withdraw":
            return person in lease.waiting
        case "hand over":
            return mine and to != person and to.role is not Role.VIEWER
        case "release" | "hear" | "close":
            return mine
    return True


def leases() -> list[Lease]:
    """Return leases with every holder and every queue of the others."""
    result = []
    for holder in (None, ANNA, BERT, CARA):
        others = [person for person in (ANNA, BERT, CARA) if person != holder]
        for size in range(len(others) + 1):
            for waiting in itertools.permutations(others, size):
                result.append(Lease(holder, 10.0 if holder else -math.inf, waiting))
    return result + [replace(lease, left=10.5) for lease in result if lease.holder is not None]


@pytest.mark.parametrize("event", EVENTS)
def test_checks_raise_exactly_for_forbidden_actions(event: str) -> None:
    count = 0
    for lease, person, to in itertools.product(leases(), PEOPLE, PEOPLE):
        before = replace(lease)
        if legal(event, lease, person, to):
            EVENTS[event](lease, person, to, 11.0)
        else:
            with pytest.raises(LeaseError):
                EVENTS[event](lease, person, to, 11.0)
        assert lease == before
        count += 1
    assert count == len(leases()) * 16


@given(
    st.lists(
        st.tuples(
            st.sampled_from(sorted(EVENTS)),
            st.sampled_from(PEOPLE),
            st.sampled_from(PEOPLE),
            st.floats(0.0, 1.0),
        ),
        max_size=40,
    )
)
def test_lease_has_at_most_one_holder_who_never_waits_for_it(
    story: list[tuple[str, Person, Person, float]],
) -> None:
    lease, t = Lease(), 0.0
    for event, person, to, dt in story:
        t += dt
        before = lease
        try:
            lease = EVENTS[event](lease, person, to, t)
        except LeaseError:
            assert not legal(event, before, person, to)
            continue
        assert lease.holder is None or lease.holder.role is not Role.VIEWER
        assert lease.holder not in lease.waiting
        assert len(set(lease.waiting)) == len(lease.waiting)
        assert DORA not in lease.waiting
        if lease.holder != before.holder and before.holder is not None:
            # Only these events take the arm from its holder.
            takings = {"take", "hand over", "release", "expire"}
            assert event in takings or (event == "acquire" and before.left < math.inf)
        if event == "hear":
            assert replace(lease, left=before.left) == replace(before, heard=t)


def test_only_a_free_lease_is_granted() -> None:
    lease = Lease().acquire(ANNA, 1.0)
    assert lease.holder == ANNA
    with pytest.raises(LeaseError, match="Anna holds the arm"):
        lease.acquire(BERT, 2.0)
    with pytest.raises(LeaseError, match="Only an admin may take the arm from Anna"):
        lease.take(BERT, 2.0)
    assert lease.take(CARA, 2.0).holder == CARA


def test_lease_goes_to_the_first_in_the_queue() -> None:
    lease = Lease().acquire(ANNA, 1.0).request(CARA).request(BERT)
    assert lease.waiting == (CARA, BERT)
    lease = lease.hand_over(ANNA, BERT, 2.0)
    assert (lease.holder, lease.waiting) == (BERT, (CARA,))
    lease = lease.release(BERT)
    assert (lease.holder, lease.waiting) == (None, (CARA,))
    assert lease.acquire(CARA, 3.0).waiting == ()


def test_silence_ends_the_lease_and_a_heartbeat_keeps_it() -> None:
    lease = Lease().acquire(ANNA, 1.0)
    assert lease.silence(1.25) == 0.25
    assert lease.expire(1.0 + LEASE_TIMEOUT - 1e-9) is lease
    assert lease.expire(1.0 + LEASE_TIMEOUT).holder is None
    heard = lease.hear(ANNA, 2.0)
    assert heard.expire(1.0 + LEASE_TIMEOUT).holder == ANNA
    assert heard.expire(2.0 + LEASE_TIMEOUT).holder is None
    # A free lease has no silence.
    assert Lease().silence(1e9) == 0.0


def test_clock_that_stands_or_runs_back_does_not_shorten_the_lease() -> None:
    lease = Lease().acquire(ANNA, 5.0)
    assert lease.hear(ANNA, 4.0).heard == 5.0
    assert lease.silence(4.0) == 0.0


def test_lease_of_a_departed_driver_expires_after_the_timeout() -> None:
    lease = Lease().acquire(ANNA, 1.0).request(BERT)
    assert lease.leave(BERT).waiting == ()
    assert lease.leave(ANNA).holder == ANNA


def test_closed_window_frees_the_arm_until_its_page_is_back() -> None:
    lease = Lease().acquire(ANNA, 1.0).request(BERT).close(ANNA, 2.0)
    assert (lease.holder, lease.driver) == (ANNA, None)
    assert lease.acquire(BERT, 2.1).driver == BERT
    with pytest.raises(LeaseError, match="is free"):
        lease.request(CARA)
    # A heartbeat that was under way when the window was closed is no return.
    assert lease.hear(ANNA, 2.1).driver is None
    assert lease.hear(ANNA, 2.1 + RETURN_TIME).driver == ANNA
    assert lease.expire(1.0 + LEASE_TIMEOUT).holder is None
