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
from typing import Any

import pytest

from katana450.arm.control.actor import Actor, CommandChannel
from katana450.arm.control.arm import ArmModel
from katana450.arm.control.lease import Person, Role
from katana450.arm.control.session.session import Session
from katana450.arm.control.state.stop_cause import pressed
from katana450.arm.drivers.simulated import SimulatedDriver
from katana450.arm.runtime.clock import MonotonicClock
from katana450.arm.runtime.loop import ControlLoop
from katana450.arm.runtime.mailbox import Mailbox
from katana450.arm.runtime.pipes import stop_end
from katana450.arm.runtime.pipes.stop_end import StopEnd
from katana450.arm.runtime.pipes.stop_messages import StopPress, StopStatus
from katana450.arm.runtime.pipes.stop_pipe import StopPipe

TIMEOUT = 5.0


def press(name: str) -> StopPress:
    person = Person("v", "Vera", Role.VIEWER)
    return StopPress(pressed("Vera", "v", name, 1.0), Actor(person, CommandChannel.HTTP))


def connected(stop_pipe: StopPipe) -> bool:
    return stop_pipe.status is not None


async def ended(stop_pipe: StopPipe) -> None:
    """Wait until the thread of ``stop_pipe`` has read the end of its connection."""
    async with asyncio.timeout(TIMEOUT):
        while stop_pipe.running:
            await asyncio.sleep(0.01)


def _next(pipes: Iterator[Connection]) -> Connection:
    for pipe in pipes:
        return pipe
    raise EOFError


@contextmanager
def arm_end(arm: ArmModel, session: Session) -> Iterator[Connection]:
    """Run an arm; yield the far end of its pipe, which is cut afterwards."""
    mailbox = Mailbox(session.check)
    driver = SimulatedDriver(arm, session.ready, 0.0)
    loop = ControlLoop(session, driver, mailbox, MonotonicClock(), 100.0)
    ours, theirs = multiprocessing.Pipe()
    end = StopEnd(ours, loop, mailbox)
    loop.start()
    end.start()
    yield theirs
    end.close()
    # Closing alone does not wake the thread that reads.
    with socket.socket(fileno=os.dup(ours.fileno())) as line:
        line.shutdown(socket.SHUT_RDWR)
    loop.stop()


async def test_press_is_executed_and_confirmed_and_survives_a_new_arm(
    arm: ArmModel, session: Session
) -> None:
    pipes: queue.Queue[Connection | None] = queue.Queue()

    def connect() -> Connection:
        pipe = pipes.get()
        if pipe is None:
            raise EOFError
        return pipe

    stop_pipe = StopPipe(connect)
    # Before the arm is there.
    stop_pipe.press(press("one"))
    assert await stop_pipe.executed("one", 0.1) is None
    with arm_end(arm, session) as first:
        pipes.put(first)
        assert await stop_pipe.executed("one", TIMEOUT) == press("one").cause
        # The cause stays that of the first press.
        stop_pipe.press(press("two"))
        assert await stop_pipe.executed("two", TIMEOUT) == press("one").cause
        assert stop_pipe.status is not None
        assert stop_pipe.status.presses == ("one", "two")
        assert stop_pipe.age < TIMEOUT
    # The event loop has not learned of the end yet.
    assert connected(stop_pipe)
    stop_pipe.press(press("meanwhile"))
    first.close()
    async with asyncio.timeout(TIMEOUT):
        while connected(stop_pipe):
            await asyncio.sleep(0.01)
    stop_pipe.press(press("three"))
    with arm_end(arm, session) as second:
        pipes.put(second)
        assert await stop_pipe.executed("three", TIMEOUT) == press("meanwhile").cause
        assert await stop_pipe.executed("meanwhile", TIMEOUT) is not None
    second.close()
    assert stop_pipe.running
    pipes.put(None)
    await ended(stop_pipe)


@pytest.mark.parametrize("name", ["one", "two"])
async def test_unknown_press_is_not_confirmed_by_an_earlier_stop(
    arm: ArmModel, session: Session, name: str
) -> None:
    with arm_end(arm, session) as pipe:
        pipes = iter((pipe,))
        stop_pipe = StopPipe(lambda: _next(pipes))
        stop_pipe.press(press("one"))
        cause = await stop_pipe.executed(name, TIMEOUT if name == "one" else 0.3)
        assert (cause is not None) == (name == "one")
    await ended(stop_pipe)
    pipe.close()


@pytest.mark.parametrize("failing", ["arm", "process of STOP"])
def test_error_in_a_thread_closes_the_pipe_of_stop(
    arm: ArmModel, session: Session, failing: str
) -> None:
    def status(stopped: Any, presses: tuple[str, ...]) -> StopStatus:
        if failing == "arm" and "zero" in presses:
            raise RuntimeError(failing)
        return StopStatus(stopped, presses)

    async def act() -> None:
        with arm_end(arm, session) as first, arm_end(arm, session) as second:
            pipes = iter((first, second))
            stop_pipe = StopPipe(lambda: _next(pipes))
            call = stop_pipe._call

            def stumble(act: Callable[..., None], *values: object) -> None:
                if "zero" in getattr(values[-1], "presses", ()):
                    raise RuntimeError(failing)
                call(act, *values)

            with pytest.MonkeyPatch.context() as patch:
                patch.setattr(stop_end, "StopStatus", status)
                patch.setattr(stop_pipe, "_call", stumble)
                async with asyncio.timeout(TIMEOUT):
                    while not connected(stop_pipe):
                        await asyncio.sleep(0.01)
                    stop_pipe.press(press("zero"))
                    while stop_pipe._pipe is not second:
                        await asyncio.sleep(0.01)
            stop_pipe.press(press("one"))
            assert await stop_pipe.executed("one", TIMEOUT) is not None
        await ended(stop_pipe)

    asyncio.run(act())
