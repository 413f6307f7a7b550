"""An error in a thread of either end closes the pipe, and the ends connect again."""

from __future__ import annotations

import multiprocessing
from multiprocessing.connection import Connection

import pytest

from katana450.arm.control import commands as cmd
from katana450.arm.control.arm import ArmModel
from katana450.arm.control.session import Session
from katana450.arm.runtime.arm_end import ArmEnd
from katana450.arm.runtime.front_end import FrontEnd
from tests.runtime.test_arm_end import SILENCE, Ends, clear_stop, until


class Again:
    """A front end that connects again to its arm."""

    def __init__(self, arm: ArmModel, session: Session) -> None:
        self.ends = Ends(arm, session)
        self.arm_ends: list[ArmEnd] = []
        self.front = FrontEnd(self.connection(), session.check, self.connection)

    def connection(self, number: int = 0) -> Connection:
        ours, theirs = multiprocessing.Pipe()
        self.arm_ends.append(ArmEnd(ours, self.ends.loop, self.ends.mailbox, SILENCE, number))
        self.arm_ends[-1].start()
        return theirs

    def works_by_a_second_pipe(self) -> None:
        until(lambda: len(self.arm_ends) == 2 and self.front.age < SILENCE)
        assert self.arm_ends[0].cut.is_set()
        ticket = clear_stop(self.front)
        until(lambda: self.front.state_publisher.snapshot.ticket == ticket)
        for arm_end in (self.ends.arm_end, *self.arm_ends):
            arm_end.close()
        self.ends.loop.stop()


@pytest.mark.parametrize("name", ["_outcomes", "_put"])
def test_error_in_a_thread_of_the_arm_closes_the_pipe(
    arm: ArmModel, session: Session, name: str
) -> None:
    again = Again(arm, session)

    def fail(*_: object) -> None:
        raise RuntimeError("dictionary changed size during iteration")

    setattr(again.arm_ends[0], name, fail)
    again.front.start()
    again.front.deliver(cmd.SetJoint(0, 1.0))
    # No command can come any more, so the arm stops.
    until(lambda: again.front.state_publisher.snapshot.state.stopped is not None)
    again.works_by_a_second_pipe()


def test_error_in_the_thread_of_the_front_end_closes_the_pipe(
    arm: ArmModel, session: Session
) -> None:
    again = Again(arm, session)

    def fail() -> None:
        again.front.on_stop_change = lambda: None
        raise RuntimeError("a callback met an error")

    again.front.on_stop_change = fail
    again.front.start()
    again.front.deliver(cmd.Stop())
    again.works_by_a_second_pipe()
