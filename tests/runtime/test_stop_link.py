"""The two ends of the pipe of STOP: one in the process of STOP, one with a real control loop."""

from __future__ import annotations

import asyncio
import multiprocessing
import os
import queue
import socket
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from multiprocessing.connection import Connection

import pytest

from katana450.arm.control.actor import Actor, CommandChannel
from katana450.arm.control.arm import ArmModel
from katana450.arm.control.lease import Person, Role
from katana450.arm.control.session import Session
from katana450.arm.control.stop_cause import pressed
from katana450.arm.drivers.simulated import SimulatedDriver
from katana450.arm.runtime.clock import MonotonicClock
from katana450.arm.runtime.loop import ControlLoop
from katana450.arm.runtime.mailbox import Mailbox
from katana450.arm.runtime.stop_end import StopEnd
from katana450.arm.runtime.stop_link import StopLink
from katana450.arm.runtime.stop_messages import StopPress

TIMEOUT = 5.0


def press(name: str) -> StopPress:
    person = Person("v", "Vera", Role.VIEWER)
    return StopPress(pressed("Vera", "v", name, 1.0), Actor(person, CommandChannel.HTTP))


def connected(link: StopLink) -> bool:
    return link.status is not None


async def ended(link: StopLink) -> None:
    """Wait until the thread of ``link`` has read the end of its connection."""
    async with asyncio.timeout(TIMEOUT):
        while link.running:
            await asyncio.sleep(0.01)


def _next(pipes: Iterator[Connection]) -> Connection:
    for pipe in pipes:
        return pipe
    raise EOFError


@contextmanager
def arm_end(
    arm: ArmModel, session: Session, drivers: Callable[[], tuple[str, ...]] = tuple
) -> Iterator[Connection]:
    """Run an arm; yield the far end of its pipe, which is cut afterwards."""
    mailbox = Mailbox(session.check)
    driver = SimulatedDriver(arm, session.ready, 0.0)
    loop = ControlLoop(session, driver, mailbox, MonotonicClock(), 100.0)
    ours, theirs = multiprocessing.Pipe()
    end = StopEnd(ours, loop, mailbox, drivers)
    loop.start()
    end.start()
    yield theirs
    end.close()
    # Closing alone does not wake the thread that reads.
    with socket.socket(fileno=os.dup(ours.fileno())) as line:
        line.shutdown(socket.SHUT_RDWR)
    loop.stop()


def test_press_is_executed_and_confirmed_and_survives_a_new_arm(
    arm: ArmModel, session: Session
) -> None:
    pipes: queue.Queue[Connection | None] = queue.Queue()

    def connect() -> Connection:
        pipe = pipes.get()
        if pipe is None:
            raise EOFError
        return pipe

    async def act() -> None:
        link = StopLink(connect)
        # Before the arm is there.
        link.press(press("one"))
        assert await link.executed("one", 0.1) is None
        with arm_end(arm, session) as first:
            pipes.put(first)
            assert await link.executed("one", TIMEOUT) == press("one").cause
            # The cause stays that of the first press.
            link.press(press("two"))
            assert await link.executed("two", TIMEOUT) == press("one").cause
            assert link.status is not None
            assert link.status.presses == ("one", "two")
            assert link.age < TIMEOUT
        first.close()
        async with asyncio.timeout(TIMEOUT):
            while connected(link):
                await asyncio.sleep(0.01)
        link.press(press("three"))
        with arm_end(arm, session) as second:
            pipes.put(second)
            assert await link.executed("three", TIMEOUT) == press("three").cause
        second.close()
        assert link.running
        pipes.put(None)
        await ended(link)

    asyncio.run(act())


@pytest.mark.parametrize("name", ["one", "two"])
def test_unknown_press_is_not_confirmed_by_an_earlier_stop(
    arm: ArmModel, session: Session, name: str
) -> None:
    async def act() -> None:
        with arm_end(arm, session) as pipe:
            pipes = iter((pipe,))
            link = StopLink(lambda: _next(pipes))
            link.press(press("one"))
            found = await link.executed(name, TIMEOUT if name == "one" else 0.3)
            assert (found is not None) == (name == "one")
        await ended(link)
        pipe.close()

    asyncio.run(act())


def test_status_names_the_newest_drivers(arm: ArmModel, session: Session) -> None:
    drivers: list[str] = []

    async def act() -> None:
        with arm_end(arm, session, lambda: tuple(drivers)) as pipe:
            pipes = iter((pipe,))
            link = StopLink(lambda: _next(pipes))

            async def names(expected: tuple[str, ...]) -> None:
                async with asyncio.timeout(TIMEOUT):
                    while link.status is None or link.status.drivers != expected:
                        await asyncio.sleep(0.01)

            await names(())
            drivers.append("oda")
            await names(("oda",))
        await ended(link)
        pipe.close()

    asyncio.run(act())
