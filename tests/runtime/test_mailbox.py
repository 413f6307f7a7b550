"""The mailbox: order, tickets, replacement in a stream, capacity and checks."""

from __future__ import annotations

import threading

import numpy as np
import pytest

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.session.session import Session
from katana450.arm.control.session.stopping import joined
from katana450.arm.control.state.state import Finding, Reason
from katana450.arm.control.state.stop_cause import pressed
from katana450.arm.runtime.mailbox import CAPACITY, Drained, Mailbox
from katana450.arm.runtime.tick import Submission
from katana450.errors import InputError


@pytest.fixture
def mailbox(session: Session) -> Mailbox:
    return Mailbox(session.check)


def test_commands_leave_once_and_in_order(mailbox: Mailbox) -> None:
    sent: list[cmd.Command] = [cmd.Home(), cmd.Joint(1, 1.0), cmd.Hold()]
    tickets = [mailbox.put(command) for command in sent]
    assert tickets == [1, 2, 3]
    submissions = [Submission(command, None) for command in sent]
    assert mailbox.drain() == Drained(submissions, [[1], [2], [3]], [], 3)
    assert mailbox.drain() == Drained([], [], [], 3)


def test_last_of_a_stream_is_kept_and_every_ticket_counts(mailbox: Mailbox) -> None:
    for i in range(50):
        mailbox.put(cmd.Position(np.array([0.3, 0.0, 0.001 * i])))
    drained = mailbox.drain()
    assert drained.last == 50 == mailbox.last_ticket
    assert drained.tickets == [list(range(1, 51))]
    (last,) = drained.commands
    assert isinstance(last, cmd.Position)
    assert last.p[2] == 0.049


def test_sliders_of_two_axes_do_not_replace_each_other(mailbox: Mailbox) -> None:
    for command in (cmd.Joint(1, 1.0), cmd.Joint(2, -1.0), cmd.Joint(2, -1.1)):
        mailbox.put(command)
    assert mailbox.drain().commands == [cmd.Joint(1, 1.0), cmd.Joint(2, -1.1)]


def test_stop_reports_the_dropped_tickets(mailbox: Mailbox) -> None:
    for command in (cmd.Home(), cmd.Joint(1, 0.1), cmd.Joint(1, 0.2), cmd.Stop()):
        mailbox.put(command)
    mailbox.put(cmd.Home())
    assert mailbox.drain() == Drained(
        [Submission(cmd.Stop(), None), Submission(cmd.Home(), None)], [[4], [5]], [1, 2, 3], 5
    )


def test_stop_drops_no_clearing_of_the_stop_before_it(mailbox: Mailbox, session: Session) -> None:
    state = session.begin(session.ready, 0.0, 0.0)
    state = session.step(state, [press("one")], 1.0)
    stops = (cmd.Home(), cmd.ClearStop(), press("two"), cmd.ClearStop(), press("three"))
    for command in stops:
        mailbox.put(command)
    drained = mailbox.drain()
    assert (drained.tickets, drained.dropped) == ([[2], [3, 5]], [1, 4])
    state = session.step(state, drained.commands, 3.0)
    assert state.stopped is not None
    assert state.stopped.cause.press == "two"


def press(name: str) -> cmd.Stop:
    return cmd.Stop(pressed("Anna", "a", name, 0.0))


def test_copy_of_a_press_has_no_effect_and_drops_no_command(mailbox: Mailbox) -> None:
    mailbox.put(press("one"))
    assert mailbox.drain().commands == [press("one")]
    mailbox.put(cmd.Home())
    assert mailbox.put(press("one")) == 3
    assert mailbox.drain() == Drained(
        [Submission(cmd.Home(), None)], [[2]], [], 3, {3: press("one").cause}
    )


def test_new_press_is_not_lost_in_a_copy_of_another(mailbox: Mailbox) -> None:
    mailbox.put(press("one"))
    mailbox.drain()
    mailbox.put(press("two"))
    mailbox.put(press("one"))
    mailbox.put(press("three"))
    drained = mailbox.drain()
    (stop,) = drained.commands
    assert isinstance(stop, cmd.Stop)
    assert stop.presses == ("two", "three")
    assert (drained.tickets, list(drained.repeated)) == ([[2, 4]], [3])
    # Copies of joined presses are known as well.
    for name in ("two", "three"):
        mailbox.put(press(name))
    assert mailbox.drain().commands == []


def test_joined_stop_with_one_new_press_counts(mailbox: Mailbox) -> None:
    mailbox.put(press("one"))
    mailbox.drain()
    mailbox.put(joined(press("one"), press("two")))
    assert len(mailbox.drain().commands) == 1


def test_stop_without_a_name_always_counts(mailbox: Mailbox) -> None:
    for _ in range(2):
        mailbox.put(cmd.Stop())
        assert mailbox.drain().commands == [cmd.Stop()]


def test_flood_is_refused_and_waiting_commands_are_kept(mailbox: Mailbox) -> None:
    for _ in range(CAPACITY):
        mailbox.put(cmd.Home())
    with pytest.raises(InputError, match="slower"):
        mailbox.put(cmd.Home())
    assert len(mailbox.drain().commands) == CAPACITY
    assert mailbox.put(cmd.Home()) == CAPACITY + 1


def test_full_mailbox_refuses_no_pause_by_the_server(mailbox: Mailbox) -> None:
    for _ in range(CAPACITY):
        mailbox.put(cmd.Home())
    pause = cmd.HoldFor(Finding(Reason.LOOP_LATE, 0.3))
    assert mailbox.put(pause) == CAPACITY + 1
    with pytest.raises(InputError, match="slower"):
        mailbox.put(cmd.Hold())
    assert mailbox.drain().commands[-1] is pause


def test_unsupported_command_is_refused_by_the_session(mailbox: Mailbox) -> None:
    with pytest.raises(InputError, match="no axis 9"):
        mailbox.put(cmd.Joint(9, 0.0))
    assert mailbox.drain() == Drained([], [], [], 0)


def test_concurrent_threads_lose_no_command(mailbox: Mailbox) -> None:
    drained: list[cmd.Command] = []
    writers = [
        threading.Thread(target=lambda: [mailbox.put(cmd.Home()) for _ in range(60)])
        for _ in range(4)
    ]
    for writer in writers:
        writer.start()
    while any(writer.is_alive() for writer in writers):
        drained += mailbox.drain().commands
    drained += mailbox.drain().commands
    assert len(drained) == 240
